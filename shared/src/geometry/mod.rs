//! Planes and convex polygons, in f64.

mod clip;
mod polygon;

pub use clip::{Corners, clip, clip_by_plane};
pub use polygon::{ConvexPolygon, area_vector, uniform_point};

/// Number of a plane of the scene. Polygons that lie in one plane, whichever way they face, share it: they can neither
/// see nor block each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PlaneId(pub u32);
