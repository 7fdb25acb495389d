//! Which occluders lie between a group of points and a polygon? Asked once for the group, so that each of its shafts need only
//! look at a short list, or at nothing.

use glam::{DVec2, DVec3};
use smallvec::SmallVec;

use super::Occluder;

/// An axis-aligned box.
#[derive(Debug, Clone, Copy)]
pub struct Bounds {
    low: DVec3,
    high: DVec3,
}

impl Bounds {
    /// The smallest box around some points; an inside-out one around none.
    #[must_use]
    pub fn around(points: impl Iterator<Item = DVec3>) -> Self {
        let start = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };
        points.fold(start, |bounds, point| Self { low: bounds.low.min(point), high: bounds.high.max(point) })
    }

    /// The middle.
    #[must_use]
    pub fn centre(&self) -> DVec3 {
        (self.low + self.high) * 0.5
    }

    /// Length of the diagonal.
    #[must_use]
    pub fn size(&self) -> f64 {
        (self.high - self.low).length()
    }

    /// The eight corners.
    #[must_use]
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            DVec3::from_array(std::array::from_fn(|axis| {
                if i >> axis & 1 == 1 { self.high[axis] } else { self.low[axis] }
            }))
        })
    }

    /// The largest of n . x over the box.
    #[must_use]
    pub fn farthest_along(&self, n: DVec3) -> f64 {
        n.dot(self.centre()) + n.abs().dot(self.high - self.low) * 0.5
    }

    fn corner(&self, axes: [usize; 2], high: [bool; 2]) -> DVec2 {
        let pick = |i: usize| if high[i] { self.high[axes[i]] } else { self.low[axes[i]] };
        DVec2::new(pick(0), pick(1))
    }
}

/// The convex hull of two boxes, as Haines and Wallace ("Shaft Culling for Efficient Ray-Traced Radiosity", 1991) bound it:
/// the box around both, and planes parallel to an axis through an edge of each.
pub struct Bundle {
    centre: DVec3,
    half: DVec3,
    /// Inward normal and offset: inside where normal . x >= offset.
    planes: SmallVec<[(DVec3, f64); 12]>,
}

impl Bundle {
    /// The hull of two boxes.
    #[must_use]
    pub fn new(a: &Bounds, b: &Bounds) -> Self {
        let (low, high) = (a.low.min(b.low), a.high.max(b.high));
        let mut planes = SmallVec::new();
        for axes in [[0, 1], [1, 2], [2, 0]] {
            let kinds = [[false, false], [false, true], [true, true], [true, false]];
            let corners: SmallVec<[DVec2; 8]> =
                kinds.iter().flat_map(|kind| [a.corner(axes, *kind), b.corner(axes, *kind)]).collect();
            for kind in 0..4 {
                let (from, to) = (corners[2 * kind], corners[2 * kind + 1]);
                let across = (to - from).perp();
                let offset = across.dot(from);
                let slack = 1e-12 * across.length() * (from.length() + to.length());
                let heights = || corners.iter().map(|corner| across.dot(*corner) - offset);
                let sign = if heights().all(|height| height >= -slack) {
                    1.0
                } else if heights().all(|height| height <= slack) {
                    -1.0
                } else {
                    continue;
                };
                let mut normal = DVec3::ZERO;
                normal[axes[0]] = across.x * sign;
                normal[axes[1]] = across.y * sign;
                planes.push((normal, offset * sign - slack));
            }
        }
        Self { centre: (low + high) * 0.5, half: (high - low) * 0.5, planes }
    }

    /// False where the polygon with these corners cannot lie between two points of the boxes.
    #[must_use]
    pub fn meets(&self, corners: &[DVec3]) -> bool {
        let outside =
            |(normal, offset): &(DVec3, f64)| corners.iter().all(|corner| normal.dot(*corner) < *offset);
        !self.planes.iter().any(outside)
    }

    fn misses_box(&self, centre: DVec3, half: DVec3) -> bool {
        (centre - self.centre).abs().cmpgt(half + self.half).any()
            || self
                .planes
                .iter()
                .any(|(normal, offset)| normal.dot(centre) + normal.abs().dot(half) < *offset)
    }
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

    /// The polygons that can lie between any two points of the bundle's boxes, in ascending order.
    pub fn candidates(&self, bundle: &Bundle, candidates: &mut Vec<u32>) {
        candidates.clear();
        self.for_each_leaf(
            |centre, half| bundle.misses_box(centre, half),
            |polygons| {
                candidates
                    .extend(polygons.filter(|index| bundle.meets(&self.polygons[*index as usize].corners)));
            },
        );
        candidates.sort_unstable();
    }
}
