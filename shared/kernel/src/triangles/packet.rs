//! Eight triangles that a ray or a segment is tested against together.

use std::array::from_fn;

use glam::DVec3;
use pulp::Simd;

use super::lanes::{LANES, Lanes, bits};
use super::sight::Sight;
use crate::geometry::PlaneId;

/// Triangles that follow each other; unused lanes are no numbers, which nothing meets.
pub(super) struct Packet {
    /// Coordinates of all lanes, by corner and axis.
    corners: [[Lanes; 3]; 3],
    pub(super) planes: [PlaneId; LANES],
    /// Number of the first triangle.
    pub(super) first: u32,
    /// The next packet belongs to the same part of the tree.
    pub(super) goes_on: bool,
}

impl Packet {
    /// Eight triangles or fewer.
    pub(super) fn new(triangles: &[([DVec3; 3], PlaneId)], first: u32, goes_on: bool) -> Self {
        let coordinate = |corner: usize, axis: usize| {
            Lanes(from_fn(|lane| {
                triangles.get(lane).map_or(f32::NAN, |(corners, _)| corners[corner][axis] as f32)
            }))
        };
        Self {
            corners: from_fn(|corner| from_fn(|axis| coordinate(corner, axis))),
            planes: from_fn(|lane| triangles.get(lane).map_or(PlaneId::default(), |(_, plane)| *plane)),
            first,
            goes_on,
        }
    }

    /// Bits of the lanes of a register's part: where the segment may cross the triangle, whatever its plane, and where it
    /// certainly does.
    #[inline(always)]
    pub(super) fn crossed<S: Simd>(&self, simd: S, part: usize, sight: &Sight) -> (u8, u8) {
        let [a, b, c] = &self.corners;
        let a = Seen::new(simd, a, part, sight);
        let b = Seen::new(simd, b, part, sight);
        let c = Seen::new(simd, c, part, sight);
        let (u, v, w) = (c.side(simd, &b), a.side(simd, &c), b.side(simd, &a));
        let rounding = simd.splat_f32s(sight.rounding);
        let spread = sum(simd, [a.spread(simd), b.spread(simd), c.spread(simd)]);
        let bound = simd.mul_f32s(rounding, simd.add_f32s(spread, rounding));
        let least = simd.min_f32s(simd.min_f32s(u, v), w);
        let greatest = simd.max_f32s(simd.max_f32s(u, v), w);
        // On the same side of all edges, up to rounding.
        let may_be_inside = bits(simd, are_apart(simd, [least, greatest], simd.neg_f32s(bound)));
        if may_be_inside == 0 {
            return (0, 0);
        }
        let inside = are_apart(simd, [least, greatest], bound);
        // Heights of both ends over the triangle's plane, times a common factor: compared without a division.
        let determinant = sum(simd, [u, v, w]);
        let near = simd.mul_add_e_f32s(v, b.height, simd.mul_f32s(u, a.height));
        let near = simd.mul_add_e_f32s(w, c.height, near);
        let far = simd.negate_mul_add_e_f32s(determinant, simd.splat_f32s(sight.depth), near);
        let heights = [simd.abs_f32s(a.height), simd.abs_f32s(b.height), simd.abs_f32s(c.height)];
        let reach = simd.add_f32s(sum(simd, heights), simd.splat_f32s(3.0 * sight.depth.abs()));
        let end_bound = simd.mul_f32s(simd.splat_f32s(2.0 * sight.rounding), simd.abs_f32s(determinant));
        let end_bound = simd.mul_add_e_f32s(bound, reach, end_bound);
        let (least, greatest) = (simd.min_f32s(near, far), simd.max_f32s(near, far));
        // The segment crosses the plane where its ends are on different sides.
        let misses = simd.and_m32s(inside, are_apart(simd, [least, greatest], end_bound));
        let across = simd.and_m32s(
            simd.less_than_or_equal_f32s(least, simd.neg_f32s(end_bound)),
            simd.less_than_or_equal_f32s(end_bound, greatest),
        );
        (may_be_inside & !bits(simd, misses), bits(simd, simd.and_m32s(inside, across)))
    }
}

/// A register's part of a corner's lanes as a segment sees it: across it and along it.
struct Seen<S: Simd> {
    x: S::f32s,
    y: S::f32s,
    height: S::f32s,
}

impl<S: Simd> Seen<S> {
    #[inline(always)]
    fn new(simd: S, corner: &[Lanes; 3], part: usize, sight: &Sight) -> Self {
        let mut seen = [simd.splat_f32s(0.0); 3];
        for (i, axis) in sight.axes.into_iter().enumerate() {
            let origin = simd.splat_f32s(sight.origin[i]);
            seen[i] = simd.sub_f32s(corner[axis].load::<S>(part), origin);
        }
        let [x, y, height] = seen;
        let x = simd.negate_mul_add_e_f32s(height, simd.splat_f32s(sight.shear[0]), x);
        let y = simd.negate_mul_add_e_f32s(height, simd.splat_f32s(sight.shear[1]), y);
        Self { x, y, height }
    }

    /// Twice the area between the segment and the edge to another corner, with its sign.
    #[inline(always)]
    fn side(&self, simd: S, other: &Self) -> S::f32s {
        simd.negate_mul_add_e_f32s(self.y, other.x, simd.mul_f32s(self.x, other.y))
    }

    #[inline(always)]
    fn spread(&self, simd: S) -> S::f32s {
        simd.add_f32s(simd.abs_f32s(self.x), simd.abs_f32s(self.y))
    }
}

#[inline(always)]
fn sum<S: Simd>(simd: S, [a, b, c]: [S::f32s; 3]) -> S::f32s {
    simd.add_f32s(simd.add_f32s(a, b), c)
}

/// The lanes in which all of a range is at least the bound, or at most its negative.
#[inline(always)]
fn are_apart<S: Simd>(simd: S, [least, greatest]: [S::f32s; 2], bound: S::f32s) -> S::m32s {
    let above = simd.less_than_or_equal_f32s(bound, least);
    let below = simd.less_than_or_equal_f32s(greatest, simd.neg_f32s(bound));
    simd.or_m32s(above, below)
}
