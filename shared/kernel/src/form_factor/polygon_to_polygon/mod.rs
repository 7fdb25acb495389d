//! Form factors between polygons, without occlusion.
//!
//! | file | which pairs it is for |
//! |---|---|
//! | `contours` | near ones, up to those that share edges: a sum over both contours |
//! | `areas` | far ones, where contour sums cancel: quadrature over one area or both |
//! | `gauss` | the rules that both integrate with |

mod areas;
mod contours;
mod gauss;
#[cfg(test)]
mod tests;

use glam::DVec3;
use smallvec::SmallVec;

use crate::geometry::{ConvexPolygon, Corners, area_vector, clip};

pub use areas::{AreaPoint, between_areas, points as area_points};

/// From this ratio of distance to radius on, for both polygons, the kernel is integrated over both areas: nothing cancels there,
/// and few nodes are enough.
const FAR: f64 = 4.0;

/// From this ratio of a polygon's distance from the other's contour to its radius on, the exact form factor of its points is
/// integrated over its area alone. A contour sum would lose digits for a polygon that is small against the other.
const SMALL: f64 = 2.0;

/// Form factor of a polygon to another: the fraction of what leaves `from` that arrives on `to` if nothing is between. Only the
/// part of each in front of the other counts; polygons of one plane see nothing of each other.
///
/// Good to some 1e-14 of itself for polygons of any distance and of proportions that are not extreme, whether or not they share
/// edges. The rounding error of near pairs is up to 4e-16 times the product of the perimeters over the area of `from`: 1e-9
/// for slivers of proportions 1 : 1e6 along one edge.
#[must_use]
pub fn polygon_to_polygon(from: &ConvexPolygon, to: &ConvexPolygon) -> f64 {
    let area = from.area();
    if area > 0.0 { exchange_area(from, to) / area } else { 0.0 }
}

/// The direct exchange area of two polygons: the area of either times its form factor to the other, which is the same both ways
/// up to rounding. See [`polygon_to_polygon`].
#[must_use]
pub fn exchange_area(a: &ConvexPolygon, b: &ConvexPolygon) -> f64 {
    let Some(&origin) = a.corners.first() else { return 0.0 };
    let extent = |corner: &DVec3| (*corner - origin).abs().max_element();
    let extent = a.corners.iter().chain(&b.corners).map(extent).fold(0.0, f64::max);
    if a.plane == b.plane || extent == 0.0 {
        return 0.0;
    }
    // In a frame in which the pair has about the size 1 the logarithms of distances are small. A power of two costs no digit.
    let unit = libm::exp2(libm::floor(libm::log2(extent)));
    let in_frame = |polygon: &ConvexPolygon| -> Corners {
        polygon.corners.iter().map(|corner| (*corner - origin) / unit).collect()
    };
    let (a, b) = (in_frame(a), in_frame(b));
    let (seen_of_a, seen_of_b) = (in_front_of(&b, &a), in_front_of(&a, &b));
    if seen_of_a.is_empty() || seen_of_b.is_empty() {
        return 0.0;
    }
    between(&Part::new(seen_of_a), &Part::new(seen_of_b)).max(0.0) * unit * unit
}

/// The part of a polygon on the front of another.
fn in_front_of(front: &[DVec3], polygon: &[DVec3]) -> Corners {
    let normal = area_vector(front).normalize_or_zero();
    let heights: SmallVec<[f64; 8]> = polygon.iter().map(|corner| normal.dot(*corner - front[0])).collect();
    // Clipping would keep a polygon that lies in the plane.
    if heights.iter().all(|height| *height <= 0.0) {
        return Corners::new();
    }
    clip(polygon, &heights)
}

/// The part of a polygon that counts.
struct Part {
    corners: Corners,
    normal: DVec3,
    centre: DVec3,
    radius: f64,
}

impl Part {
    fn new(corners: Corners) -> Self {
        let centre = corners.iter().sum::<DVec3>() / corners.len() as f64;
        let radius = corners.iter().map(|corner| corner.distance(centre)).fold(0.0, f64::max);
        Self { normal: area_vector(&corners).normalize_or_zero(), corners, centre, radius }
    }

    /// Distance of the centre from the contour of another part, over the radius.
    fn clearance(&self, other: &Self) -> f64 {
        let next = other.corners.iter().cycle().skip(1);
        let distance = |(from, to): (&DVec3, &DVec3)| {
            let edge = *to - *from;
            let place = (self.centre - *from).dot(edge) / edge.length_squared();
            self.centre.distance(*from + edge * place.clamp(0.0, 1.0))
        };
        other.corners.iter().zip(next).map(distance).fold(f64::INFINITY, f64::min) / self.radius
    }
}

/// Exchange area of two parts of which each lies wholly in front of the other.
fn between(a: &Part, b: &Part) -> f64 {
    let distance = a.centre.distance(b.centre);
    let far = f64::min((distance - b.radius) / a.radius, (distance - a.radius) / b.radius);
    if far >= FAR {
        let nodes = areas::nodes_for(far);
        let (points, others) = (areas::points(&a.corners, nodes), areas::points(&b.corners, nodes));
        return areas::between_areas(&points, a.normal, &others, b.normal);
    }
    let (from_a, from_b) = (a.clearance(b), b.clearance(a));
    let (small, other, clearance) = if from_a > from_b { (a, b, from_a) } else { (b, a, from_b) };
    if clearance >= SMALL {
        let points = areas::points(&small.corners, areas::nodes_for(clearance));
        return areas::from_points(&points, small.normal, &other.corners);
    }
    contours::exchange_area(&a.corners, &b.corners)
}
