//! Cutting an occluder out of a polygon, as seen from the origin.

use glam::DVec3;
use smallvec::SmallVec;

use crate::geometry::{Corners, clip};

/// Cuts the cone from the origin through a convex blocker out of convex pieces that lie behind it. True when a piece
/// changed. The pieces are and stay convex, counter-clockwise seen from the origin; the blocker may wind either way.
///
/// Two blockers that share an edge cut along planes with exactly opposite normals: no light comes through the seam.
pub fn cut(pieces: &mut Vec<Corners>, blocker: &Corners, scratch: &mut Vec<Corners>) -> bool {
    let sides = cone_sides(blocker);
    let mut touched = false;
    scratch.clear();
    for piece in pieces.drain(..) {
        if is_apart(&piece, blocker, &sides) {
            scratch.push(piece);
        } else {
            touched = true;
            cut_piece(piece, &sides, scratch);
        }
    }
    std::mem::swap(pieces, scratch);
    touched
}

/// Inward normals of the cone's sides, not normalised.
fn cone_sides(blocker: &Corners) -> SmallVec<[DVec3; 8]> {
    let next = blocker.iter().cycle().skip(1);
    let sides: SmallVec<[DVec3; 8]> = blocker.iter().zip(next).map(|(a, b)| a.cross(*b)).collect();
    let middle: DVec3 = blocker.iter().sum();
    let orientation: f64 = sides.iter().map(|side| side.dot(middle)).sum();
    if orientation < 0.0 { sides.into_iter().map(|side| -side).collect() } else { sides }
}

/// A side of either cone that has the other wholly outside proves that they do not overlap.
fn is_apart(piece: &Corners, blocker: &Corners, sides: &[DVec3]) -> bool {
    let next = piece.iter().cycle().skip(1);
    let outside = |side: DVec3, corners: &Corners| corners.iter().all(|corner| side.dot(*corner) <= 0.0);
    sides.iter().any(|side| outside(*side, piece))
        || piece.iter().zip(next).any(|(a, b)| outside((*b - *a).cross(*a), blocker))
}

/// Splits a piece along each side in turn: what is outside is kept, what is inside of all is blocked.
fn cut_piece(piece: Corners, sides: &[DVec3], kept: &mut Vec<Corners>) {
    let mut inside = piece;
    for side in sides {
        let heights: SmallVec<[f64; 8]> = inside.iter().map(|corner| side.dot(*corner)).collect();
        if heights.iter().all(|height| *height >= 0.0) {
            continue;
        }
        let negated: SmallVec<[f64; 8]> = heights.iter().map(|height| -height).collect();
        let outside = clip(&inside, &negated);
        if !outside.is_empty() {
            kept.push(outside);
        }
        inside = clip(&inside, &heights);
        if inside.is_empty() {
            return;
        }
    }
}
