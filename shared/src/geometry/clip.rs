//! Clipping of small convex polygons, given as lists of corners.

use glam::DVec3;
use smallvec::SmallVec;

/// Corners of a small convex polygon; no allocation up to eight corners.
pub type Corners = SmallVec<[DVec3; 8]>;

/// Corners closer than this part of their distance from the origin are one.
const SAME: f64 = 1e-10;

/// The part of a convex polygon where `height` is positive or zero, given the height of each corner. Corners at height 0
/// belong to the part; cuts are made on the edges, between a corner above and one below.
///
/// Corners are relative to the point that looks at the polygon. A cut beside a corner would give a second one in the same
/// place, and the plane through the origin and an edge without length has no direction: whatever is tested against it comes
/// out at random. Of such corners one is kept.
pub fn clip(corners: &[DVec3], heights: &[f64]) -> Corners {
    let mut kept = Corners::new();
    let Some(last) = corners.len().checked_sub(1) else { return kept };
    let mut previous = (corners[last], heights[last]);
    for (&corner, &height) in corners.iter().zip(heights) {
        let (from, from_height) = previous;
        if (from_height > 0.0 && height < 0.0) || (from_height < 0.0 && height > 0.0) {
            kept.push(from + (corner - from) * (from_height / (from_height - height)));
        }
        if height >= 0.0 {
            kept.push(corner);
        }
        previous = (corner, height);
    }
    let same = |a: DVec3, b: DVec3| a.distance_squared(b) <= SAME * SAME * b.length_squared();
    kept.dedup_by(|corner, before| same(*corner, *before));
    while kept.len() > 1 && same(kept[kept.len() - 1], kept[0]) {
        kept.pop();
    }
    kept
}

/// The part of a convex polygon on the positive side of a plane through the origin.
pub fn clip_by_plane(corners: &[DVec3], normal: DVec3) -> Corners {
    let heights: SmallVec<[f64; 8]> = corners.iter().map(|corner| normal.dot(*corner)).collect();
    clip(corners, &heights)
}
