use std::f64::consts::{PI, TAU};

use glam::DVec3;
// Not f64::atan2, which is the platform's: its last bit may differ between the machines of a cluster.
use libm::atan2;

use crate::geometry::{area_vector, clip_by_plane};

/// Lambert's contour sum over a polygon that lies wholly above the horizon of a point at the origin.
///
/// F = 1/(2 pi) sum theta_i n . c_i / |c_i| with c_i = R_{i+1} x R_i, taken as (R_{i+1} - R_i) x R_i: the edge is known
/// exactly where the cross product of two long, nearly parallel vectors would lose its digits. theta = atan2(|c|, R . R')
/// is accurate at every angle (an arc cosine is not near 0). Positive where the polygon is counter-clockwise seen from the
/// origin. The sum holds for simple concave polygons too.
#[must_use]
pub fn contour(normal: DVec3, corners: &[DVec3]) -> f64 {
    let Some(&last) = corners.last() else { return 0.0 };
    let mut previous = last;
    let mut sum = 0.0;
    for &corner in corners {
        let cross = (corner - previous).cross(previous);
        let length = cross.length();
        if length > 0.0 {
            sum += atan2(length, previous.dot(corner)) / length * normal.dot(cross);
        }
        previous = corner;
    }
    sum / TAU
}

/// Form factor of a surface element to a one-sided polygon (counter-clockwise seen from its front): 0 where the element
/// lies behind the polygon or in its plane; the part under the element's horizon does not count.
#[must_use]
pub fn point_to_polygon(position: DVec3, normal: DVec3, corners: &[DVec3]) -> f64 {
    let relative: Vec<DVec3> = corners.iter().map(|corner| *corner - position).collect();
    let Some(&first) = relative.first() else { return 0.0 };
    if area_vector(&relative).dot(first) >= 0.0 {
        return 0.0;
    }
    contour(normal, &clip_by_plane(&relative, normal)).max(0.0)
}

/// The one-sided limit of [`point_to_polygon`] as a point comes back to `position` from `inward`, a direction in the
/// element's own plane.
///
/// At a vertex the plain formula loses what its neighbours' planes send: on the common edge of two walls each sees half a
/// hemisphere of the other from everywhere but the edge itself. In the limit a corner that coincides with the point lies in
/// direction -inward, and an edge through the point spans the angle pi in the plane of -inward and the edge.
#[must_use]
pub fn point_to_polygon_limit(position: DVec3, normal: DVec3, inward: DVec3, corners: &[DVec3]) -> f64 {
    let relative: Vec<DVec3> = corners.iter().map(|corner| *corner - position).collect();
    let Some(&first) = relative.first() else { return 0.0 };
    let area = area_vector(&relative);
    let side = area.dot(first);
    if side > 0.0 || (side == 0.0 && area.dot(inward) <= 0.0) {
        return 0.0;
    }
    let relative = clip_by_plane(&relative, normal);
    let Some(&last) = relative.last() else { return 0.0 };
    let approached = |corner: DVec3| if corner == DVec3::ZERO { -inward } else { corner };
    let mut previous = last;
    let mut sum = 0.0;
    for &corner in &relative {
        let edge = corner - previous;
        let (from, to) = (approached(previous), approached(corner));
        let mut cross = if from == previous && to == corner { edge.cross(from) } else { to.cross(from) };
        let mut angle = atan2(cross.length(), from.dot(to));
        if cross == DVec3::ZERO && from.dot(to) < 0.0 {
            cross = -edge.cross(inward);
            angle = PI;
        }
        sum += angle * normal.dot(cross.normalize_or_zero());
        previous = corner;
    }
    (sum / TAU).max(0.0)
}
