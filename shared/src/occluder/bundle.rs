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

    fn misses_box(&self, centre: DVec3, half: DVec3) -> bool {
        (centre - self.centre).abs().cmpgt(half + self.half).any()
            || self
                .planes
                .iter()
                .any(|(normal, offset)| normal.dot(centre) + normal.abs().dot(half) < *offset)
    }
}

impl Occluder {
    /// The polygons that can lie between any two points of the bundle's boxes, in ascending order.
    pub fn candidates(&self, bundle: &Bundle, candidates: &mut Vec<u32>) {
        candidates.clear();
        self.for_each_leaf(
            |centre, half| bundle.misses_box(centre, half),
            |polygons| {
                candidates.extend(polygons.filter(|index| {
                    let polygon = &self.polygons[*index as usize];
                    let outside = |(normal, offset): &(DVec3, f64)| {
                        polygon.corners.iter().all(|corner| normal.dot(*corner) < *offset)
                    };
                    !bundle.planes.iter().any(outside)
                }));
            },
        );
        candidates.sort_unstable();
    }
}
