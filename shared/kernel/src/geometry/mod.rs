//! Planes, convex polygons and boxes, in f64.

mod bounds;
mod clip;
pub mod lanes;
mod polygon;
mod solid_angle;

use glam::DVec3;

pub use bounds::Bounds;
pub use clip::{Corners, clip, clip_by_plane, split};
pub use polygon::{ConvexPolygon, area_vector, uniform_point};
pub use solid_angle::SeenPolygon;

/// Equal for equal points, and in some order.
pub(crate) fn position_bits(point: DVec3) -> [u64; 3] {
    // Zero has two signs.
    (point + DVec3::ZERO).to_array().map(f64::to_bits)
}

/// Number of a plane of the scene. Polygons that lie in one plane, whichever way they face, share it: they can neither
/// see nor block each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct PlaneId(pub u32);

impl PlaneId {
    /// No plane of the scene: that of points in space, and of rays that may meet anything.
    pub const NONE: Self = Self(u32::MAX);
}
