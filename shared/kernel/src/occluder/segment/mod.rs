//! Does anything block a segment? Watertight: no ray passes between two polygons that share an edge or a corner.

#[cfg(test)]
mod tests;

use glam::DVec3;

use super::Occluder;
use crate::geometry::PlaneId;
use crate::triangles::{Fan, PacketId, Segment, crosses, with_lanes};

/// The polygons that blocked the latest of some segments that was blocked.
#[derive(Default)]
pub struct Blocking(Option<PacketId>);

impl Occluder {
    /// True when a polygon crosses the open segment between two points. Polygons in the planes of either end do not count:
    /// they cannot block light that leaves or reaches their own plane from the front, and rounding must not let them.
    /// Segments shorter than the clearance at both ends are never blocked.
    #[must_use]
    pub fn blocks(&self, from: DVec3, to: DVec3, planes: [PlaneId; 2]) -> bool {
        self.blocks_again(from, to, planes, &mut Blocking::default())
    }

    /// [`Self::blocks`] for one of many segments: what blocked an earlier one is looked at first. The answer is the same.
    #[must_use]
    pub fn blocks_again(
        &self,
        from: DVec3,
        to: DVec3,
        planes: [PlaneId; 2],
        blocking: &mut Blocking,
    ) -> bool {
        if self.polygons.is_empty() {
            return false;
        }
        let span = to - from;
        let clearance = self.clearance;
        if span.length_squared() <= 4.0 * clearance * clearance {
            return false;
        }
        let found = with_lanes(self.segment([&from, &span], planes, blocking.0));
        blocking.0 = found.or(blocking.0);
        found.is_some()
    }

    /// A segment, given by where it starts and its span, among the polygons.
    fn segment<'a>(
        &'a self,
        [from, span]: [&'a DVec3; 2],
        planes: [PlaneId; 2],
        likely: Option<PacketId>,
    ) -> Segment<'a, impl Fn(u32) -> bool> {
        let crosses = move |triangle: u32| self.is_crossed(triangle, [from, span]);
        Segment { tree: &self.tree, from, span, planes, likely, crosses }
    }

    /// Whether a segment crosses a triangle of the tree.
    #[cold]
    #[inline(never)]
    fn is_crossed(&self, triangle: u32, [from, span]: [&DVec3; 2]) -> bool {
        let (polygon, place) = self.tree.places()[triangle as usize];
        crosses(self.polygons[polygon as usize].triangle(place), *from, *span, self.clearance)
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
