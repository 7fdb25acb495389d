//! Clipping of small convex polygons, given as lists of corners.

use glam::DVec3;
use smallvec::SmallVec;

/// Corners of a small convex polygon; no allocation up to eight corners.
pub type Corners = SmallVec<[DVec3; 8]>;

/// Corners closer than this part of their distance from the origin become one: the direction of the edge between them would be
/// rounding error, and so would be the side of a plane through it.
const SAME_CORNER: f64 = 1e-12;

/// The part of a convex polygon where `height` is positive or zero, given the height of each corner. Corners at height 0
/// belong to the part; cuts are made on the edges, between a corner above and one below. Empty where no area is left.
pub fn clip(corners: &[DVec3], heights: &[f64]) -> Corners {
    let (mut above, mut below) = (Corners::new(), Corners::new());
    split(corners, heights, &mut above, &mut below);
    above
}

/// Both parts of a convex polygon: where `height` is positive or zero, and where it is negative or zero, as [`clip`] finds each.
pub fn split(corners: &[DVec3], heights: &[f64], above: &mut Corners, below: &mut Corners) {
    above.clear();
    below.clear();
    let Some(last) = corners.len().checked_sub(1) else { return };
    let mut previous = (corners[last], heights[last]);
    for (&corner, &height) in corners.iter().zip(heights) {
        let (from, from_height) = previous;
        if (from_height > 0.0 && height < 0.0) || (from_height < 0.0 && height > 0.0) {
            let cut = from + (corner - from) * (from_height / (from_height - height));
            push_distinct(above, cut);
            push_distinct(below, cut);
        }
        if height >= 0.0 {
            push_distinct(above, corner);
        }
        if height <= 0.0 {
            push_distinct(below, corner);
        }
        previous = (corner, height);
    }
    for part in [above, below] {
        while part.len() > 1 && is_same(part[0], part[part.len() - 1]) {
            part.pop();
        }
        if part.len() < 3 {
            part.clear();
        }
    }
}

fn push_distinct(corners: &mut Corners, corner: DVec3) {
    if corners.last().is_none_or(|last| !is_same(*last, corner)) {
        corners.push(corner);
    }
}

fn is_same(a: DVec3, b: DVec3) -> bool {
    a.distance_squared(b) <= SAME_CORNER * SAME_CORNER * a.length_squared()
}

/// The part of a convex polygon on the positive side of a plane through the origin.
pub fn clip_by_plane(corners: &[DVec3], normal: DVec3) -> Corners {
    let heights: SmallVec<[f64; 8]> = corners.iter().map(|corner| normal.dot(*corner)).collect();
    clip(corners, &heights)
}
