//! The occluders between a group of points and a polygon: found once for the group, so that each point need only look at a short
//! list.

use glam::{DVec2, DVec3};
use smallvec::SmallVec;

use super::Occluder;
use super::boxes::HalfSpace;
use crate::geometry::Bounds;

/// Slack of sides, relative to the coordinates: rounding.
const ROUNDING: f64 = 1e-12;

/// The convex hull of two boxes, as Haines and Wallace ("Shaft Culling for Efficient Ray-Traced Radiosity", 1991) bound it:
/// the box around both, and planes parallel to an axis through an edge of each.
pub struct Shaft {
    bounds: Bounds,
    /// Inward normal and offset: inside where normal . x >= offset.
    sides: SmallVec<[HalfSpace; 12]>,
}

impl Shaft {
    /// The hull of two boxes, with its slanted sides moved inwards by `inset`; at 0 outwards by rounding.
    #[must_use]
    pub fn new(a: &Bounds, b: &Bounds, inset: f64) -> Self {
        let mut sides = SmallVec::new();
        for axes in [[0, 1], [1, 2], [2, 0]] {
            let kinds = [[false, false], [false, true], [true, true], [true, false]];
            // The corners of both rectangles, those of the same kind side by side.
            let corners = kinds.map(|kind| [a, b].map(|bounds| corner(bounds, axes, kind)));
            for [from, to] in corners {
                let across = (to - from).perp();
                let offset = across.dot(from);
                let slack = ROUNDING * across.length() * (from.length() + to.length());
                let heights = || corners.iter().flatten().map(|corner| across.dot(*corner) - offset);
                let above = heights().all(|height| height >= -slack);
                let below = heights().all(|height| height <= slack);
                // A flat shaft has no inside into which its sides could move.
                if (!above && !below) || (above && below && inset > 0.0) {
                    continue;
                }
                let sign = if above { 1.0 } else { -1.0 };
                let mut normal = DVec3::ZERO;
                (normal[axes[0]], normal[axes[1]]) = (across.x * sign, across.y * sign);
                let shift = if inset > 0.0 { inset * across.length() } else { -slack };
                sides.push((normal, offset * sign + shift));
            }
        }
        Self { bounds: a.union(*b), sides }
    }

    /// The box around both.
    #[must_use]
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// The half spaces whose intersection is the shaft: the six of the box around both first.
    pub(super) fn half_spaces(&self) -> impl Iterator<Item = HalfSpace> + '_ {
        let Bounds { low, high } = self.bounds;
        let of_axis = move |axis: DVec3| [(axis, axis.dot(low)), (-axis, -axis.dot(high))];
        DVec3::AXES.into_iter().flat_map(of_axis).chain(self.sides.iter().copied())
    }

    /// Cuts off all with normal . x < offset.
    pub fn add_side(&mut self, normal: DVec3, offset: f64) {
        self.sides.push((normal, offset));
    }

    /// False where the polygon with these corners cannot lie between two points of the boxes.
    #[must_use]
    pub fn meets(&self, corners: &[DVec3]) -> bool {
        let outside =
            |(normal, offset): &HalfSpace| corners.iter().all(|corner| normal.dot(*corner) < *offset);
        !self.sides.iter().any(outside)
    }

    fn misses_box(&self, centre: DVec3, half: DVec3) -> bool {
        (centre - self.bounds.centre()).abs().cmpgt(half + self.bounds.half()).any()
            || self.sides.iter().any(|(normal, offset)| normal.dot(centre) + normal.abs().dot(half) < *offset)
    }
}

fn corner(bounds: &Bounds, axes: [usize; 2], high: [bool; 2]) -> DVec2 {
    let pick = |i: usize| if high[i] { bounds.high[axes[i]] } else { bounds.low[axes[i]] };
    DVec2::new(pick(0), pick(1))
}

impl Occluder {
    /// The polygons whose boxes a segment meets.
    pub fn near_segment(&self, from: DVec3, to: DVec3, found: &mut Vec<u32>) {
        found.clear();
        let (middle, half) = ((from + to) * 0.5, (to - from) * 0.5);
        let misses = |centre: DVec3, extent: DVec3| {
            let apart = centre - middle;
            let across = half.cross(apart).abs();
            // The box's extent across the segment, along each axis crossed with it: the axes of separation of segment and box.
            let reach = DVec3::new(
                half.y.abs() * extent.z + half.z.abs() * extent.y,
                half.z.abs() * extent.x + half.x.abs() * extent.z,
                half.x.abs() * extent.y + half.y.abs() * extent.x,
            );
            apart.abs().cmpgt(half.abs() + extent).any() || across.cmpgt(reach).any()
        };
        self.for_each_leaf(misses, |polygons| found.extend(polygons));
    }

    /// The polygons that can lie between any two points of the shaft's boxes, in ascending order.
    pub fn candidates(&self, shaft: &Shaft, candidates: &mut Vec<u32>) {
        candidates.clear();
        self.for_each_leaf(
            |centre, half| shaft.misses_box(centre, half),
            |polygons| {
                candidates
                    .extend(polygons.filter(|index| shaft.meets(&self.polygons[*index as usize].corners)));
            },
        );
        candidates.sort_unstable();
    }
}
