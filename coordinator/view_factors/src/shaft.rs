//! Occlusion between two clusters or elements: none, some, or a polygon that hides one from the other.

use glam::DVec3;
use kernel::geometry::{Bounds, ConvexPolygon, PlaneId, area_vector};
use kernel::occluder::Shaft;
use smallvec::SmallVec;

use super::element::IN_PLANE;

/// Slack of sides, relative to the coordinates: rounding.
const ROUNDING: f64 = 1e-12;

/// A polygon that can block.
pub struct Blocker {
    plane: PlaneId,
    normal: DVec3,
    height: f64,
    bounds: Bounds,
    corners: SmallVec<[DVec3; 4]>,
    /// Inward unit normals of the sides, in the polygon's plane, and their heights.
    sides: SmallVec<[(DVec3, f64); 4]>,
}

impl Blocker {
    /// Prepares a polygon.
    #[must_use]
    pub fn new(polygon: &ConvexPolygon) -> Self {
        let corners = &polygon.corners;
        let normal = area_vector(corners).normalize_or_zero();
        let next = corners.iter().cycle().skip(1);
        let side = |(from, to): (&DVec3, &DVec3)| {
            let inward = normal.cross(*to - *from).normalize_or_zero();
            (inward, inward.dot(*from))
        };
        Self {
            plane: polygon.plane,
            normal,
            height: normal.dot(corners[0]),
            bounds: Bounds::around(corners),
            corners: corners.iter().copied().collect(),
            sides: corners.iter().zip(next).map(side).collect(),
        }
    }

    /// True where every segment between the hulls of two sets of points meets the polygon.
    ///
    /// For a fixed end on one side of the plane the map from the other end to the crossing is a central projection, which
    /// keeps hulls: the crossings of all segments lie in the hull of those between the sets' points. A convex polygon that
    /// holds the latter holds them all. A set touches the plane at its own risk: what lies in the plane is not hidden, so that
    /// `may_touch` must be false for sets with elements in it.
    #[must_use]
    pub fn hides(&self, from: &[DVec3], to: &[DVec3], may_touch: [bool; 2]) -> bool {
        let heights = |points: &[DVec3]| -> SmallVec<[f64; 8]> {
            points.iter().map(|point| self.normal.dot(*point) - self.height).collect()
        };
        let (mut before, mut behind) = (heights(from), heights(to));
        let sign = if before.iter().sum::<f64>() >= 0.0 { 1.0 } else { -1.0 };
        for (heights, sign, may_touch) in
            [(&mut before, sign, may_touch[0]), (&mut behind, -sign, may_touch[1])]
        {
            let least = if may_touch { -IN_PLANE } else { IN_PLANE };
            for height in heights.iter_mut() {
                if sign * *height < least {
                    return false;
                }
                *height = (sign * *height).max(0.0);
            }
            if heights.iter().all(|height| *height <= IN_PLANE) {
                return false;
            }
        }
        let slack = ROUNDING * self.bounds.largest_coordinate();
        self.sides.iter().all(|(inward, offset)| {
            let inside = |points: &[DVec3]| -> SmallVec<[f64; 8]> {
                points.iter().map(|point| inward.dot(*point) - offset).collect()
            };
            let (near, far) = (inside(from), inside(to));
            near.iter().zip(&before).all(|(near, up)| {
                far.iter().zip(&behind).all(|(far, down)| near * down + far * up >= -slack * (up + down))
            })
        })
    }

    /// Unit normal of the polygon's plane.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        self.normal
    }
}

/// The corners of a box, each once: four of a flat one.
#[must_use]
pub fn box_corners(Bounds { low, high }: Bounds) -> SmallVec<[DVec3; 8]> {
    let mut corners = SmallVec::from_slice(&[low]);
    for axis in 0..3 {
        if high[axis] > low[axis] {
            for index in 0..corners.len() {
                let mut corner: DVec3 = corners[index];
                corner[axis] = high[axis];
                corners.push(corner);
            }
        }
    }
    corners
}

/// The space between two clusters or elements: a [`Shaft`] that also knows both ends.
pub struct Between {
    shaft: Shaft,
    ends: [Bounds; 2],
    /// The planes of all elements at either end, where that is one.
    planes: [Option<PlaneId>; 2],
    /// Corners of both ends, where they do not fill their boxes.
    corners: SmallVec<[DVec3; 8]>,
}

impl Between {
    /// Between two boxes, and the planes in which the elements in them lie.
    #[must_use]
    pub fn new(ends: [Bounds; 2], planes: [Option<PlaneId>; 2]) -> Self {
        // Blockers that reach in by no more than rounding do not count.
        Self { shaft: Shaft::new(&ends[0], &ends[1], IN_PLANE), ends, planes, corners: SmallVec::new() }
    }

    /// Adds the planes that hold an edge of one set of corners, a corner of the other, and all of both on one side: with them
    /// the shaft is the hull of the corners, not of their boxes.
    pub fn tighten(&mut self, a: &[DVec3], b: &[DVec3]) {
        let all = || a.iter().chain(b);
        self.corners = all().copied().collect();
        for (edges, others) in [(a, b), (b, a)] {
            let next = edges.iter().cycle().skip(1);
            for (from, to) in edges.iter().zip(next) {
                for other in others {
                    let normal = (*to - *from).cross(*other - *from).normalize_or_zero();
                    let offset = normal.dot(*from);
                    let slack = ROUNDING * from.abs().max_element();
                    let heights = || all().map(|corner| normal.dot(*corner) - offset);
                    if normal == DVec3::ZERO {
                        continue;
                    } else if heights().all(|height| height >= -slack) {
                        self.shaft.add_side(normal, offset + IN_PLANE);
                    } else if heights().all(|height| height <= slack) {
                        self.shaft.add_side(-normal, -offset + IN_PLANE);
                    }
                }
            }
        }
    }

    /// False where a polygon certainly blocks nothing: outside, in the plane of either end, or with both ends on one side.
    #[must_use]
    pub fn may_hold(&self, blocker: &Blocker) -> bool {
        if !self.shaft.bounds().meets(&blocker.bounds) || self.planes.contains(&Some(blocker.plane)) {
            return false;
        }
        let range = |end: Bounds| {
            let height = blocker.normal.dot(end.centre()) - blocker.height;
            let reach = blocker.normal.abs().dot(end.half());
            (height - reach, height + reach)
        };
        let [a, b] = self.ends.map(range);
        if a.0.min(b.0) >= -IN_PLANE || a.1.max(b.1) <= IN_PLANE {
            return false;
        }
        if !self.corners.is_empty() {
            let heights = || self.corners.iter().map(|corner| blocker.normal.dot(*corner) - blocker.height);
            if heights().all(|height| height >= -IN_PLANE) || heights().all(|height| height <= IN_PLANE) {
                return false;
            }
        }
        self.shaft.meets(&blocker.corners)
    }
}
