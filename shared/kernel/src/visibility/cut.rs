//! Cutting the cones of blockers out of a polygon, as seen from the origin.

use glam::DVec3;
use smallvec::SmallVec;

use crate::geometry::{Corners, split};
use crate::occluder::Body;

/// Convex polygons, counter-clockwise seen from the origin.
#[derive(Debug, Default)]
pub struct Pieces {
    corners: Vec<DVec3>,
    /// Where each ends in `corners`.
    ends: Vec<usize>,
}

impl Pieces {
    /// Forgets all of them.
    pub fn clear(&mut self) {
        self.corners.clear();
        self.ends.clear();
    }

    /// Adds one.
    pub fn push(&mut self, corners: &[DVec3]) {
        self.corners.extend_from_slice(corners);
        self.ends.push(self.corners.len());
    }

    /// Number of pieces.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// True when nothing is left.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The pieces.
    pub fn iter(&self) -> impl Iterator<Item = &[DVec3]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, end)| &self.corners[start..*end])
    }
}

/// Cones from the origin around what blocks light.
#[derive(Debug, Default)]
pub struct Cones {
    /// Inward normals of the sides, not normalised.
    sides: Vec<DVec3>,
    corners: Vec<DVec3>,
    /// Where each ends in both.
    ends: Vec<[usize; 2]>,
}

/// One of them.
#[derive(Debug, Clone, Copy)]
pub struct Cone<'a> {
    sides: &'a [DVec3],
    /// Points that span it.
    corners: &'a [DVec3],
}

impl Cones {
    /// Forgets all of them.
    pub fn clear(&mut self) {
        self.sides.clear();
        self.corners.clear();
        self.ends.clear();
    }

    /// Adds the cone around a convex polygon, which may wind either way.
    pub fn push_polygon(&mut self, corners: &[DVec3]) {
        let first = self.sides.len();
        let next = corners.iter().cycle().skip(1);
        self.sides.extend(corners.iter().zip(next).map(|(a, b)| a.cross(*b)));
        let middle: DVec3 = corners.iter().sum();
        let sides = &mut self.sides[first..];
        if sides.iter().map(|side| side.dot(middle)).sum::<f64>() < 0.0 {
            sides.iter_mut().for_each(|side| *side = -*side);
        }
        self.corners.extend_from_slice(corners);
        self.ends.push([self.sides.len(), self.corners.len()]);
    }

    /// Adds the cone around a body, as seen from a point outside of it, which is the origin of the cone.
    pub fn push_outline(&mut self, body: &Body, point: DVec3) {
        for edge in &body.edges {
            let sees_left = body.sees(&edge.left, point);
            if sees_left != body.sees(&edge.right, point) {
                let (from, to) = (edge.from - point, edge.to - point);
                let side = from.cross(to);
                self.sides.push(if sees_left { -side } else { side });
                self.corners.extend([from, to]);
            }
        }
        self.ends.push([self.sides.len(), self.corners.len()]);
    }

    /// Number of cones.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// True when there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The cones.
    pub fn iter(&self) -> impl Iterator<Item = Cone<'_>> {
        let starts = std::iter::once([0, 0]).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|([side, corner], [last_side, last_corner])| Cone {
            sides: &self.sides[side..*last_side],
            corners: &self.corners[corner..*last_corner],
        })
    }
}

/// Cuts a cone out of pieces that lie behind what it is around; `scratch` is used on the way. True when a piece changed. The pieces
/// are and stay convex, counter-clockwise seen from the origin.
///
/// Two cones that share an edge cut along planes with exactly opposite normals: no light comes through the seam.
pub fn cut(pieces: &mut Pieces, cone: Cone<'_>, scratch: &mut Pieces) -> bool {
    let mut touched = false;
    scratch.clear();
    for piece in pieces.iter() {
        if is_apart(piece, cone) {
            scratch.push(piece);
        } else {
            touched = true;
            cut_piece(piece, cone.sides, scratch);
        }
    }
    std::mem::swap(pieces, scratch);
    touched
}

/// A side of either cone that has the other wholly outside proves that they do not overlap.
fn is_apart(piece: &[DVec3], cone: Cone<'_>) -> bool {
    let outside = |side: DVec3, corners: &[DVec3]| corners.iter().all(|corner| side.dot(*corner) <= 0.0);
    if cone.sides.iter().any(|side| outside(*side, piece)) {
        return true;
    }
    let next = piece.iter().cycle().skip(1);
    piece.iter().zip(next).any(|(a, b)| outside((*b - *a).cross(*a), cone.corners))
}

/// Splits a piece along each side in turn: what is outside is kept, what is inside of all is blocked.
fn cut_piece(piece: &[DVec3], sides: &[DVec3], kept: &mut Pieces) {
    let (mut inside, mut above, mut below) = (Corners::from_slice(piece), Corners::new(), Corners::new());
    let mut heights = SmallVec::<[f64; 8]>::new();
    for side in sides {
        heights.clear();
        heights.extend(inside.iter().map(|corner| side.dot(*corner)));
        if heights.iter().all(|height| *height >= 0.0) {
            continue;
        }
        split(&inside, &heights, &mut above, &mut below);
        if !below.is_empty() {
            kept.push(&below);
        }
        std::mem::swap(&mut inside, &mut above);
        if inside.is_empty() {
            return;
        }
    }
}
