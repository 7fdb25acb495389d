//! Which occluders lie between a point and a convex polygon?

use glam::DVec3;
use smallvec::SmallVec;

use super::Occluder;
use crate::geometry::{Corners, PlaneId};

/// Distances below this part of a polygon's own distance count as nothing: a plane that close to the point is seen edge-on.
const EDGE_ON: f64 = 1e-10;

/// The pyramid between a point and a convex polygon that faces it, in coordinates relative to the point.
pub struct Shaft {
    apex: DVec3,
    /// Inward normals of the sides, not normalised.
    sides: SmallVec<[DVec3; 8]>,
    base_normal: DVec3,
    /// Height of the base over the apex along the base's normal; negative.
    base_height: f64,
    base: Corners,
    planes: [PlaneId; 2],
}

impl Shaft {
    /// The shaft from `apex` to the polygon with these corners, relative to the apex and counter-clockwise seen from it.
    /// Occluders in one of the two planes do not count.
    #[must_use]
    pub fn new(apex: DVec3, base: &Corners, base_normal: DVec3, planes: [PlaneId; 2]) -> Self {
        let next = base.iter().cycle().skip(1);
        let sides = base.iter().zip(next).map(|(a, b)| (*b - *a).cross(*a)).collect();
        Self { apex, sides, base_normal, base_height: base_normal.dot(base[0]), base: base.clone(), planes }
    }

    fn misses_box(&self, centre: DVec3, half: DVec3) -> bool {
        let behind_base = self.base_normal.dot(centre) + self.base_normal.abs().dot(half) <= self.base_height;
        behind_base || self.sides.iter().any(|side| side.dot(centre) + side.abs().dot(half) <= 0.0)
    }

    /// The part of an occluder that blocks some of the shaft, as far as cheap tests can tell; relative to the apex.
    fn blocking_part(&self, corners: &[DVec3], normal: DVec3) -> Option<Corners> {
        let relative: Corners = corners.iter().map(|corner| *corner - self.apex).collect();
        if self.sides.iter().any(|side| relative.iter().all(|corner| side.dot(*corner) <= 0.0)) {
            return None;
        }
        let height = normal.dot(relative[0]);
        let tolerance = EDGE_ON * relative[0].length();
        if height.abs() <= tolerance {
            return None;
        }
        // The apex is on the side where the height is below 0 after this; a base wholly on that side is not blocked.
        let away = normal * height.signum();
        if self.base.iter().all(|corner| away.dot(*corner) <= height.abs() + tolerance) {
            return None;
        }
        // What lies behind the base does not block it.
        let heights: SmallVec<[f64; 8]> =
            relative.iter().map(|corner| self.base_normal.dot(*corner) - self.base_height).collect();
        if heights.iter().all(|height| *height >= 0.0) {
            return Some(relative);
        }
        let part = crate::geometry::clip(&relative, &heights);
        (!part.is_empty()).then_some(part)
    }
}

impl Occluder {
    /// Collects what may block the shaft, clipped to the near side of its base and relative to its apex. False when there
    /// are more than `limit` of them: the list is then incomplete.
    #[must_use]
    pub fn collect_blockers(&self, shaft: &Shaft, limit: usize, blockers: &mut Vec<Corners>) -> bool {
        blockers.clear();
        if self.polygons.is_empty() {
            return true;
        }
        let mut stack = SmallVec::<[u32; 64]>::from_slice(&[0]);
        while let Some(index) = stack.pop() {
            let node = &self.bvh.nodes[index as usize];
            let (low, high) = (node.aabb().min.as_dvec3(), node.aabb().max.as_dvec3());
            if shaft.misses_box((low + high) * 0.5 - shaft.apex, (high - low) * 0.5) {
                continue;
            }
            if !node.is_leaf() {
                stack.extend([node.first_index, node.first_index + 1]);
                continue;
            }
            for polygon in &self.polygons[node.first_index as usize..][..node.prim_count as usize] {
                if shaft.planes.contains(&polygon.plane) {
                    continue;
                }
                if let Some(part) = shaft.blocking_part(&polygon.corners, polygon.normal) {
                    if blockers.len() == limit {
                        return false;
                    }
                    blockers.push(part);
                }
            }
        }
        true
    }
}
