//! Does anything block a segment? Watertight: no ray passes between two polygons that share an edge or a corner.

mod lanes;
mod packet;
#[cfg(test)]
mod tests;
mod tree;

use glam::DVec3;

use super::{Occluder, OccluderPolygon};
use crate::geometry::PlaneId;
pub use tree::Tree;

impl Occluder {
    /// True when a polygon crosses the open segment between two points. Polygons in the planes of either end do not count:
    /// they cannot block light that leaves or reaches their own plane from the front, and rounding must not let them.
    /// Segments shorter than the clearance at both ends are never blocked.
    #[must_use]
    pub fn blocks(&self, from: DVec3, to: DVec3, planes: [PlaneId; 2]) -> bool {
        if self.polygons.is_empty() {
            return false;
        }
        let span = to - from;
        let clearance = self.clearance;
        if span.length_squared() <= 4.0 * clearance * clearance {
            return false;
        }
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = pulp::x86::V3::try_new() {
            return avx2.vectorize(
                #[inline(always)]
                || self.tree.blocks(avx2, &self.polygons, [from, span], clearance, planes),
            );
        }
        #[cfg(target_arch = "aarch64")]
        if let Some(neon) = pulp::aarch64::Neon::try_new() {
            return neon.vectorize(
                #[inline(always)]
                || self.tree.blocks(neon, &self.polygons, [from, span], clearance, planes),
            );
        }
        self.tree.blocks(pulp::Scalar, &self.polygons, [from, span], clearance, planes)
    }

    /// True when a polygon blocks light that reaches a point in a plane from infinitely far, travelling along this unit vector.
    ///
    /// The segment goes against the light for the point's own distance from the origin and twice the largest coordinate of all
    /// polygons. From there on it is farther from the origin than any of their corners, which are within sqrt(3) times that
    /// coordinate: nothing beyond can block.
    #[must_use]
    pub fn blocks_from_far(&self, point: DVec3, along: DVec3, plane: PlaneId) -> bool {
        let length = point.length() + 2.0 * f64::from(self.tree.largest());
        self.blocks(point, point - along * length, [plane; 2])
    }
}
