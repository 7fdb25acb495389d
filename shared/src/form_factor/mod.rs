//! Form factors of a point on a surface to a polygon, without occlusion.
//!
//! The form factor F(point -> polygon) is the fraction of what leaves the point's surface element that arrives on the
//! polygon if nothing is between: the integral of cos cos / (pi r^2) over the polygon. Everything here sums the contour
//! (Lambert's formula) in f64, on corners relative to the point, so that the distance to the origin costs no digits.

mod contour;
mod prepared;

pub use contour::{contour, point_to_polygon, point_to_polygon_limit};
pub use prepared::{PreparedPolygon, View};
