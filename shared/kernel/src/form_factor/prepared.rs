use std::f64::consts::TAU;

use glam::DVec3;
use smallvec::SmallVec;

use super::contour;
use super::edges::{Edges, edges};
use crate::geometry::{ConvexPolygon, Corners, PlaneId, area_vector, clip_by_plane};

/// Below this ratio of the polygon's radius to its distance the centred form takes over from the contour sum: its series
/// then has an error under 1e-8 of the factor, also where a polygon ten times as long as wide stands close to the horizon;
/// under 2e-10 for squares.
const CENTRED_FORM_RATIO: f64 = 0.15;

/// Relative error of the point rule in the mean over orientations, in squared ratios of reach to distance: of a square it is
/// 2 sin^2 - 2/3 of the angle at which it is seen, and a similar term of the receiver's angle.
pub(super) const MEAN_POINT_RULE_ERROR: f64 = 0.6;
/// The series of asin(s)/s - 1 in powers of s^2: (2k)! / (4^k (k!)^2 (2k + 1)). Four terms would leave errors of 2e-5 near the
/// horizon, where the sum cancels.
const ARC_SINE: [f64; 7] = [
    1.0 / 6.0,
    3.0 / 40.0,
    15.0 / 336.0,
    105.0 / 3456.0,
    945.0 / 42240.0,
    10395.0 / 599_040.0,
    135_135.0 / 9_676_800.0,
];

/// A point lower than this part of its distance over a polygon's plane sees the polygon edge-on: which side it is on would be
/// rounding, and so would be what stands between.
pub(super) const EDGE_ON: f64 = 1e-12;

/// A polygon with all that its form factors need and that does not depend on the receiver.
#[derive(Debug, Clone)]
pub struct PreparedPolygon {
    plane: PlaneId,
    corners: Corners,
    pub(super) normal: DVec3,
    pub(super) centre: DVec3,
    /// Centre of gravity of the area.
    pub(super) centroid: DVec3,
    /// Largest squared distance of a corner from it.
    pub(super) squared_reach: f64,
    /// Corners and edges from the centre: corner, next corner minus corner, squared length of the corner.
    spokes: SmallVec<[(DVec3, DVec3, f64); 8]>,
    pub(super) doubled_area: DVec3,
    pub(super) squared_radius: f64,
    /// The edges as the lanes take them.
    pub(super) edges: Edges,
}

/// What a point sees of a polygon when nothing is between.
#[derive(Debug, Clone)]
pub struct View {
    /// The form factor, at most 1: corners may be bent out of their plane by rounding, and more be summed next to them.
    pub factor: f64,
    /// Mean error of the rule used for the factor; 0 of rules that are exact up to rounding.
    pub error: f64,
    /// The part of the polygon above the point's horizon, relative to the point.
    pub corners: Corners,
}

impl PreparedPolygon {
    /// Prepares a polygon.
    #[must_use]
    pub fn new(polygon: &ConvexPolygon) -> Self {
        let centre = polygon.corner_mean();
        let from_centre: Corners = polygon.corners.iter().map(|corner| *corner - centre).collect();
        let next = from_centre.iter().cycle().skip(1);
        let spokes: SmallVec<[_; 8]> =
            from_centre.iter().zip(next).map(|(a, b)| (*a, *b - *a, a.length_squared())).collect();
        let centroid = centroid(&polygon.corners);
        let squared = |corner: &DVec3| corner.distance_squared(centroid);
        Self {
            centroid,
            squared_reach: polygon.corners.iter().map(squared).fold(0.0, f64::max),
            plane: polygon.plane,
            corners: polygon.corners.iter().copied().collect(),
            normal: polygon.normal(),
            centre,
            doubled_area: polygon.area_vector() * 2.0,
            squared_radius: spokes.iter().map(|spoke| spoke.2).fold(0.0, f64::max),
            edges: edges(&polygon.corners, centre),
            spokes,
        }
    }

    /// Corners, counter-clockwise seen from the front.
    #[must_use]
    pub fn corners(&self) -> &Corners {
        &self.corners
    }

    /// Plane that the polygon lies in.
    #[must_use]
    pub fn plane(&self) -> PlaneId {
        self.plane
    }

    /// Unit normal.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// Area.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.doubled_area.length() / 2.0
    }

    /// Mean of the corners.
    #[must_use]
    pub fn centre(&self) -> DVec3 {
        self.centre
    }

    /// Centre of gravity of the area.
    #[must_use]
    pub fn centroid(&self) -> DVec3 {
        self.centroid
    }

    /// Largest squared distance of a corner from the centre of gravity.
    #[must_use]
    pub fn squared_reach(&self) -> f64 {
        self.squared_reach
    }

    /// The part of the polygon above a point's horizon, relative to the point.
    #[must_use]
    pub fn corners_above(&self, position: DVec3, normal: DVec3) -> Corners {
        let corners: Corners = self.corners.iter().map(|corner| *corner - position).collect();
        if corners.iter().all(|corner| normal.dot(*corner) > 0.0) {
            corners
        } else {
            clip_by_plane(&corners, normal)
        }
    }

    /// What a surface element sees of the polygon; `None` where it sees nothing: in the polygon's plane, behind it, or with
    /// the polygon under the horizon. A polygon that is wholly above the horizon and so far that its form factor is that of a
    /// point, up to a relative error of `tolerance`, is treated as one.
    #[must_use]
    pub fn view(&self, position: DVec3, normal: DVec3, tolerance: f64) -> Option<View> {
        let to_centre = self.centre - position;
        let squared_distance = to_centre.length_squared();
        if self.normal.dot(to_centre) >= -EDGE_ON * squared_distance.sqrt() {
            return None;
        }
        let corners: Corners = self.corners.iter().map(|corner| *corner - position).collect();
        let above = corners.iter().filter(|corner| normal.dot(**corner) > 0.0).count();
        if above == 0 {
            return None;
        }
        if above < corners.len() {
            let corners = clip_by_plane(&corners, normal);
            let factor = contour(normal, &corners).min(1.0);
            return (factor > 0.0).then_some(View { factor, error: 0.0, corners });
        }
        let to_centroid = self.centroid - position;
        let squared = to_centroid.length_squared();
        let relative_error = self.point_rule_error(normal.dot(to_centroid), squared);
        if relative_error <= tolerance {
            let factor = self.point_rule(normal, to_centroid, squared);
            let error = factor * MEAN_POINT_RULE_ERROR * self.squared_reach / squared;
            return (factor > 0.0).then_some(View { factor, error, corners });
        }
        let far = self.squared_radius < CENTRED_FORM_RATIO * CENTRED_FORM_RATIO * squared_distance;
        let factor = if far {
            self.centred_form(normal, to_centre, squared_distance)
        } else {
            contour(normal, &corners).min(1.0)
        };
        (factor > 0.0).then_some(View { factor, error: 0.0, corners })
    }

    /// Bound of the relative error of the point rule, for a polygon above the horizon.
    ///
    /// With d the way from the centre of gravity, n . (c + d) / |c + d|^4 is expanded to second order; first order vanishes. Over
    /// a polygon of reach R the mean of a component of d, squared, is at most R^2 / 3 (a needle along it). That leaves
    /// 12 (d.c)^2 / r^4 - 2 d^2 / r^2 <= (4 - 2/3) R^2 / r^2 and 4 (n.d) (c.d) / (n.c r^2) <= 4/3 R^2 / (n.c r).
    fn point_rule_error(&self, height: f64, squared_distance: f64) -> f64 {
        let cosine = height / squared_distance.sqrt();
        self.squared_reach / squared_distance * (10.0 / 3.0 + 4.0 / (3.0 * cosine))
    }

    /// The form factor of all of the area gathered at the centre of gravity, cos cos A / (pi r^2).
    fn point_rule(&self, normal: DVec3, to_centroid: DVec3, squared_distance: f64) -> f64 {
        -normal.dot(to_centroid) * self.doubled_area.dot(to_centroid)
            / (TAU * squared_distance * squared_distance)
    }

    /// The contour sum about the centre, without trigonometry and without cancellation: the leading term is the form factor
    /// of a small polygon at the centre, the others correct it.
    ///
    /// 2 pi F = n . sum D_i x D_{i+1} / r^2
    ///        + sum [ g_i / (r_i r_{i+1}) - (r (e_i + e_{i+1}) + e_i e_{i+1}) / (r^2 r_i r_{i+1}) ] n . c_i
    /// with D_i the corner from the centre, r and r_i the distances of centre and corner, e_i = r_i - r, c_i the cross product
    /// along the edge and g = s^2/6 + 3 s^4/40 + 15 s^6/336 + ..., the series of asin(s)/s - 1 for the edge's angle.
    fn centred_form(&self, normal: DVec3, to_centre: DVec3, squared_distance: f64) -> f64 {
        let distance = squared_distance.sqrt();
        // e = r_i - r from q = r_i^2 - r^2, which is known without cancellation.
        let corner_distance = |spoke: &(DVec3, DVec3, f64)| {
            let q = 2.0 * to_centre.dot(spoke.0) + spoke.2;
            let length = (squared_distance + q).sqrt();
            (length, q / (length + distance))
        };
        let mut sum = -normal.dot(self.doubled_area) / squared_distance;
        let first = corner_distance(&self.spokes[0]);
        let mut here = first;
        for (i, spoke) in self.spokes.iter().enumerate() {
            let next = self.spokes.get(i + 1).map_or(first, corner_distance);
            let cross = spoke.1.cross(to_centre + spoke.0);
            let product = here.0 * next.0;
            let sine2 = cross.length_squared() / (product * product);
            let series = ARC_SINE.iter().rev().fold(0.0, |sum, term| sine2 * (term + sum));
            let stretch = (distance * (here.1 + next.1) + here.1 * next.1) / squared_distance;
            sum += (series - stretch) / product * normal.dot(cross);
            here = next;
        }
        sum / TAU
    }
}

/// Centre of gravity of a polygon's area; the mean of the corners where it has none.
fn centroid(corners: &[DVec3]) -> DVec3 {
    let mean = corners.iter().sum::<DVec3>() / corners.len() as f64;
    let whole = area_vector(corners);
    let next = corners.iter().cycle().skip(1);
    let moment: DVec3 = corners
        .iter()
        .zip(next)
        .map(|(a, b)| (*a - mean + *b - mean) * (*a - mean).cross(*b - mean).dot(whole))
        .sum();
    // A third of the corners' sum is each triangle's centre; half of its cross product its area.
    let offset = moment / (6.0 * whole.length_squared());
    if offset.is_finite() { mean + offset } else { mean }
}
