//! Which occluders lie between a point and a convex polygon?

use glam::DVec3;
use smallvec::SmallVec;

use super::{Occluder, OccluderPolygon};
use crate::geometry::{Corners, PlaneId, clip};

/// Distances below this part of a polygon's own distance count as nothing: a plane that close to the point is seen edge-on.
const EDGE_ON: f64 = 1e-10;

/// The pyramid between a point and a convex polygon that faces it, in coordinates relative to the point.
pub struct Shaft<'a> {
    apex: DVec3,
    /// Inward normals of the sides, not normalised.
    sides: SmallVec<[DVec3; 8]>,
    base_normal: DVec3,
    /// Height of the base over the apex along the base's normal; negative.
    base_height: f64,
    base: &'a Corners,
    planes: [PlaneId; 2],
}

/// What occluders do to a shaft.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Blockage {
    /// Nothing is in it.
    Free,
    /// One occluder fills it.
    Full,
    /// Occluders that may block a part of it were collected.
    Partial,
}

impl<'a> Shaft<'a> {
    /// The shaft from `apex` to the polygon with these corners, relative to the apex and counter-clockwise seen from it.
    /// Occluders in one of the two planes do not count.
    #[must_use]
    pub fn new(apex: DVec3, base: &'a Corners, base_normal: DVec3, planes: [PlaneId; 2]) -> Self {
        let next = base.iter().cycle().skip(1);
        let sides = base.iter().zip(next).map(|(a, b)| (*b - *a).cross(*a)).collect();
        Self { apex, sides, base_normal, base_height: base_normal.dot(base[0]), base, planes }
    }

    fn misses_box(&self, centre: DVec3, half: DVec3) -> bool {
        let centre = centre - self.apex;
        self.base_normal.dot(centre) + self.base_normal.abs().dot(half) <= self.base_height
            || self.sides.iter().any(|side| side.dot(centre) + side.abs().dot(half) <= 0.0)
    }

    /// The part of an occluder that blocks some of the shaft, as far as cheap tests can tell; relative to the apex.
    fn blocking_part(&self, polygon: &OccluderPolygon) -> Option<Corners> {
        let height = polygon.normal.dot(polygon.corners[0] - self.apex);
        let tolerance = EDGE_ON * polygon.corners[0].distance(self.apex);
        if height.abs() <= tolerance {
            return None;
        }
        // The apex is on the side where the height is below 0 after this; a base wholly on that side is not blocked.
        let away = polygon.normal * height.signum();
        if self.base.iter().all(|corner| away.dot(*corner) <= height.abs() + tolerance) {
            return None;
        }
        let relative: Corners = polygon.corners.iter().map(|corner| *corner - self.apex).collect();
        if self.sides.iter().any(|side| relative.iter().all(|corner| side.dot(*corner) <= 0.0)) {
            return None;
        }
        // What lies behind the base does not block it.
        let heights: SmallVec<[f64; 8]> =
            relative.iter().map(|corner| self.base_normal.dot(*corner) - self.base_height).collect();
        if heights.iter().all(|height| *height >= 0.0) {
            return Some(relative);
        }
        let part = clip(&relative, &heights);
        (!part.is_empty()).then_some(part)
    }

    /// True when the whole base lies behind a blocker.
    fn is_filled_by(&self, blocker: &Corners) -> bool {
        let next = blocker.iter().cycle().skip(1);
        let (mut above, mut below) = (true, true);
        for (a, b) in blocker.iter().zip(next) {
            let side = a.cross(*b);
            for corner in self.base {
                let height = side.dot(*corner);
                above &= height >= 0.0;
                below &= height <= 0.0;
            }
            if !above && !below {
                return false;
            }
        }
        // Exactly one: sides of no length would make it both.
        above != below
    }
}

impl Occluder {
    /// Collects what may block the shaft, clipped to the near side of its base and relative to its apex, in the order of the
    /// polygons. `candidates`, if given, are all polygons that can be in it, in ascending order; without them the BVH is
    /// asked.
    pub fn collect_blockers(
        &self,
        shaft: &Shaft<'_>,
        candidates: Option<&[u32]>,
        blockers: &mut Vec<Corners>,
    ) -> Blockage {
        blockers.clear();
        let mut found = SmallVec::<[u32; 64]>::new();
        let candidates = match candidates {
            Some(candidates) => candidates,
            None => {
                self.for_each_leaf(
                    |centre, half| shaft.misses_box(centre, half),
                    |polygons| {
                        found.extend(polygons);
                    },
                );
                found.sort_unstable();
                &found
            }
        };
        for index in candidates {
            let polygon = &self.polygons[*index as usize];
            if shaft.planes.contains(&polygon.plane) {
                continue;
            }
            if let Some(part) = shaft.blocking_part(polygon) {
                if shaft.is_filled_by(&part) {
                    return Blockage::Full;
                }
                blockers.push(part);
            }
        }
        if blockers.is_empty() { Blockage::Free } else { Blockage::Partial }
    }

    /// Visits the BVH's leaves except where `misses` says so of a box (centre and half extent).
    pub(super) fn for_each_leaf(
        &self,
        misses: impl Fn(DVec3, DVec3) -> bool,
        mut visit: impl FnMut(std::ops::Range<u32>),
    ) {
        if self.polygons.is_empty() {
            return;
        }
        let mut stack = SmallVec::<[u32; 64]>::from_slice(&[0]);
        while let Some(index) = stack.pop() {
            let node = &self.bvh.nodes[index as usize];
            let (low, high) = (node.aabb().min.as_dvec3(), node.aabb().max.as_dvec3());
            if misses((low + high) * 0.5, (high - low) * 0.5) {
                continue;
            }
            if node.is_leaf() {
                visit(node.first_index..node.first_index + node.prim_count);
            } else {
                stack.extend([node.first_index, node.first_index + 1]);
            }
        }
    }
}
