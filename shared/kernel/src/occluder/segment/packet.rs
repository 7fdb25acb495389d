//! Eight triangles that a segment is tested against together.
//!
//! A first test in f32 decides wherever rounding cannot change the answer, and leaves the rest to a test in f64: the answer is that of
//! the f64 test for every segment, on every processor.

use std::array::from_fn;

use glam::DVec3;
use pulp::Simd;

use super::OccluderPolygon;
use super::lanes::{LANES, Lanes, bits};
use crate::geometry::PlaneId;

/// Bound of the rounding of f32 in a corner seen along a segment, relative to the largest coordinate of scene and segment.
///
/// With u = 2^-24 and coordinates up to M: corner and origin are rounded to f32 and subtracted (4 u M), the shear has a relative
/// error of 4 u and a height of up to 2 M (14 u M in the product), and the difference of both is rounded (4 u M): 22 u M.
/// A side's determinant cx by - cy bx then is off by 22 u M (|bx| + |by| + |cx| + |cy|) from that, and its own rounding is
/// below 8 u M (|cx| + |cy|), as |bx| and |by| are at most 4 M. 40 covers both, and the rounding of the bound.
const ROUNDING: f32 = 40.0 / 16_777_216.0;

/// Least magnitude of a part of the span: its inverse is finite.
const LEAST_SPAN: f32 = 1e-30;

/// The axes in turn, by the last.
const AXES: [[usize; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];

/// Triangles of occluders; unused lanes repeat a used one.
pub(super) struct Packet {
    /// Coordinates of all lanes, by corner and axis.
    corners: [[Lanes; 3]; 3],
    /// Polygon of each lane, and the place of the triangle in its fan.
    places: [(u32, u32); LANES],
    planes: [PlaneId; LANES],
    /// The next packet belongs to the same part of the tree.
    pub(super) goes_on: bool,
}

/// A segment in f32.
pub(super) struct Rounded {
    pub(super) origin: [f32; 3],
    pub(super) span: [f32; 3],
    /// Inverse of the span, finite.
    pub(super) inverse: [f32; 3],
    /// At least the largest coordinate of occluders and segment.
    pub(super) reach: f32,
}

impl Rounded {
    /// `largest`: largest coordinate of the occluders.
    #[inline(always)]
    pub(super) fn new(origin: DVec3, span: DVec3, largest: f32) -> Self {
        let origin = [origin.x as f32, origin.y as f32, origin.z as f32];
        let span = [span.x as f32, span.y as f32, span.z as f32];
        let (mut inverse, mut reach) = (span, largest);
        for axis in 0..3 {
            let length = span[axis].abs();
            inverse[axis] =
                (1.0 / if length > LEAST_SPAN { length } else { LEAST_SPAN }).copysign(span[axis]);
            let farthest = origin[axis].abs() + length;
            reach = if farthest > reach { farthest } else { reach };
        }
        Self { origin, span, inverse, reach }
    }
}

/// A segment, prepared for packets.
pub(super) struct Sight<'a> {
    /// What packets refer to.
    polygons: &'a [OccluderPolygon],
    origin: DVec3,
    span: DVec3,
    /// Length of the segment, at either end, that does not count.
    clearance: f64,
    planes: [PlaneId; 2],
    /// The axis along which the span is longest comes last.
    axes: [usize; 3],
    rounded_origin: [f32; 3],
    /// How far the two other axes move along with the last.
    shear: [f32; 2],
    /// Extent along the last axis.
    depth: f32,
    /// Bound of the error of a sheared corner.
    rounding: f32,
}

impl<'a> Sight<'a> {
    /// `clearance`: length at either end that does not count.
    #[inline(always)]
    pub(super) fn new(
        origin: DVec3,
        span: DVec3,
        rounded: &Rounded,
        clearance: f64,
        planes: [PlaneId; 2],
        polygons: &'a [OccluderPolygon],
    ) -> Self {
        // Arrays and conditional moves: which axis it is cannot be predicted.
        let lengths = rounded.span.map(f32::abs);
        let last = usize::from(lengths[1] > lengths[0]);
        let last = if lengths[2] > lengths[last] { 2 } else { last };
        let axes = AXES[last];
        let inverse = rounded.inverse[last];
        Self {
            polygons,
            origin,
            span,
            clearance,
            planes,
            axes,
            rounded_origin: [rounded.origin[axes[0]], rounded.origin[axes[1]], rounded.origin[last]],
            shear: [rounded.span[axes[0]] * inverse, rounded.span[axes[1]] * inverse],
            depth: rounded.span[last],
            rounding: ROUNDING * rounded.reach,
        }
    }

    #[inline(always)]
    fn leaves_out(&self, plane: PlaneId) -> bool {
        self.planes[0] == plane || self.planes[1] == plane
    }
}

impl Packet {
    /// Eight triangles or fewer, and at least one: numbers of polygons, and places in their fans.
    pub(super) fn new(polygons: &[OccluderPolygon], triangles: &[(u32, u32)], goes_on: bool) -> Self {
        let place = |lane: usize| triangles[lane.min(triangles.len() - 1)];
        let corners = |lane: usize| {
            let (polygon, place) = place(lane);
            polygons[polygon as usize].triangle(place)
        };
        let coordinate =
            |corner: usize, axis: usize| Lanes(from_fn(|lane| corners(lane)[corner][axis] as f32));
        Self {
            corners: from_fn(|corner| from_fn(|axis| coordinate(corner, axis))),
            places: from_fn(place),
            planes: from_fn(|lane| polygons[place(lane).0 as usize].plane),
            goes_on,
        }
    }

    /// Does a triangle outside of the segment's planes cross it?
    #[inline(always)]
    pub(super) fn blocks<S: Simd>(&self, simd: S, sight: &Sight<'_>) -> bool {
        for part in 0..LANES / S::F32_LANES {
            let (mut left, certain) = self.crossed(simd, part, sight);
            while left != 0 {
                let bit = left.trailing_zeros() as usize;
                let lane = part * S::F32_LANES + bit;
                left &= left - 1;
                if sight.leaves_out(self.planes[lane]) {
                    continue;
                }
                if certain >> bit & 1 == 1 || crosses(self.places[lane], sight) {
                    return true;
                }
            }
        }
        false
    }

    /// Bits of the lanes of a register's part: where the segment may cross the triangle, whatever its plane, and where it
    /// certainly does.
    #[inline(always)]
    fn crossed<S: Simd>(&self, simd: S, part: usize, sight: &Sight<'_>) -> (u8, u8) {
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
    fn new(simd: S, corner: &[Lanes; 3], part: usize, sight: &Sight<'_>) -> Self {
        let mut seen = [simd.splat_f32s(0.0); 3];
        for (i, axis) in sight.axes.into_iter().enumerate() {
            let origin = simd.splat_f32s(sight.rounded_origin[i]);
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

/// The test in f64, after Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection" (JCGT 2013): sheared so that the segment
/// runs along one axis. An edge's side then is the sign of one 2-D determinant, which two triangles that share the edge
/// compute from the same numbers with opposite sign, so that at least one of them is hit; zero counts as a hit for both.
#[cold]
#[inline(never)]
pub(super) fn crosses((polygon, place): (u32, u32), sight: &Sight<'_>) -> bool {
    let [x, y, z] = sight.axes;
    let shear = [sight.span[x] / sight.span[z], sight.span[y] / sight.span[z]];
    let [a, b, c] = sight.polygons[polygon as usize].triangle(place).map(|corner| {
        let relative = corner - sight.origin;
        let along = relative[z];
        DVec3::new(relative[x] - shear[0] * along, relative[y] - shear[1] * along, along / sight.span[z])
    });
    let side = |a: DVec3, b: DVec3| a.x * b.y - a.y * b.x;
    let (u, v, w) = (side(c, b), side(a, c), side(b, a));
    let determinant = u + v + w;
    let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    if !inside || determinant == 0.0 {
        return false;
    }
    let part = (u * a.z + v * b.z + w * c.z) / determinant;
    let clearance = sight.clearance / sight.span.length();
    part > clearance && part < 1.0 - clearance
}
