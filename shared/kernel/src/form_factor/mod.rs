//! Form factors of a point on a surface, or of a polygon, to a polygon, without occlusion.
//!
//! The form factor F(point -> polygon) is the fraction of what leaves the point's surface element that arrives on the
//! polygon if nothing is between: the integral of cos cos / (pi r^2) over the polygon. F(polygon -> polygon) is its mean over
//! the first polygon. Everything here is in f64, on corners relative to the point or to each other, so that the distance to the
//! origin costs no digits.
//!
//! [`kernel`] is the integrand, by which sampling weighs its rays; all others integrate it.
//!
//! | file | what it does |
//! |---|---|
//! | `contour` | a point to a polygon, exactly: Lambert's contour sum |
//! | `edges` | edges of a polygon, prepared |
//! | `prepared` | many points to one polygon, fast |
//! | `lanes` | the same in wide vectors, many points at once, and to polygons that count as one |
//! | `polygon_to_polygon` | a polygon to a polygon |

mod contour;
mod edges;
mod lanes;
mod polygon_to_polygon;
mod prepared;

use glam::DVec3;

pub use contour::{contour, point_to_polygon, point_to_polygon_limit};
pub use lanes::{ClusterLanes, LANES, Lanes, PolygonCluster, ReceiverLanes, ViewLanes};
pub use polygon_to_polygon::{AreaPoint, area_points, between_areas, exchange_area, polygon_to_polygon};
pub use prepared::{PreparedPolygon, View};

/// The integrand of form factors without 1 / pi, cos cos / r^2: how rays to points of a polygon are weighed. Not positive where one
/// of both looks away from the other; `to` is the way to the point.
#[inline]
#[must_use]
pub fn kernel(normal: DVec3, polygon_normal: DVec3, to: DVec3) -> f64 {
    let squared = to.length_squared();
    normal.dot(to) * -polygon_normal.dot(to) / (squared * squared)
}
