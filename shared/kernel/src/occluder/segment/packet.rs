//! Eight triangles that a segment is tested against together.
//!
//! A first test in f32 decides wherever rounding cannot change the answer, and leaves the rest to a test in f64: the answer is that of
//! the f64 test for every segment, on every processor.

use std::array::from_fn;

use glam::DVec3;

use super::OccluderPolygon;
use super::lanes::{Eight, LANES, Lanes, Wide};
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
    pub(super) fn blocks<W: Wide>(&self, wide: W, sight: &Sight<'_>) -> bool {
        let splat = |value: f32| Eight::splat(wide, value);
        let [a, b, c] = &self.corners;
        let (a, b, c) = (Seen::new(wide, a, sight), Seen::new(wide, b, sight), Seen::new(wide, c, sight));
        let (u, v, w) = (c.side(&b), a.side(&c), b.side(&a));
        let (zero, rounding) = (splat(0.0), splat(sight.rounding));
        let bound = rounding * (a.spread() + b.spread() + c.spread() + rounding);
        let negative_bound = zero - bound;
        let (least, greatest) = (u.min(v).min(w), u.max(v).max(w));
        // Bits of lanes: on the same side of all edges, up to rounding.
        let may_be_inside = negative_bound.at_most(least) | greatest.at_most(bound);
        if may_be_inside == 0 {
            return false;
        }
        let inside = bound.at_most(least) | greatest.at_most(negative_bound);
        // Heights of both ends over the triangle's plane, times a common factor: compared without a division.
        let depth = splat(sight.depth);
        let determinant = u + v + w;
        let near = u * a.height + v * b.height + w * c.height;
        let far = near.minus_product(determinant, depth);
        let reach = a.height.abs() + b.height.abs() + c.height.abs() + depth.abs() * splat(3.0);
        let end_bound = bound * reach + rounding * determinant.abs() * splat(2.0);
        let (least, greatest) = (near.min(far), near.max(far));
        let negative_end_bound = zero - end_bound;
        // The segment crosses the plane where its ends are on different sides.
        let apart = end_bound.at_most(least) | greatest.at_most(negative_end_bound);
        let across = least.at_most(negative_end_bound) & end_bound.at_most(greatest);
        let certain = inside & across;
        let mut left = may_be_inside & !(inside & apart);
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            if sight.leaves_out(self.planes[lane]) {
                continue;
            }
            if certain >> lane & 1 == 1 || crosses(self.places[lane], sight) {
                return true;
            }
        }
        false
    }
}

/// A corner of all lanes as a segment sees it: across it and along it.
struct Seen<W: Wide> {
    x: Eight<W>,
    y: Eight<W>,
    height: Eight<W>,
}

impl<W: Wide> Seen<W> {
    #[inline(always)]
    fn new(wide: W, corner: &[Lanes; 3], sight: &Sight<'_>) -> Self {
        let load = |axis: usize| Eight::load(wide, &corner[axis]);
        let splat = |value: f32| Eight::splat(wide, value);
        let [x, y, z] = sight.axes;
        let height = load(z) - splat(sight.rounded_origin[2]);
        let x = (load(x) - splat(sight.rounded_origin[0])).minus_product(height, splat(sight.shear[0]));
        let y = (load(y) - splat(sight.rounded_origin[1])).minus_product(height, splat(sight.shear[1]));
        Self { x, y, height }
    }

    /// Twice the area between the segment and the edge to another corner, with its sign.
    #[inline(always)]
    fn side(&self, other: &Self) -> Eight<W> {
        (self.x * other.y).minus_product(self.y, other.x)
    }

    #[inline(always)]
    fn spread(&self) -> Eight<W> {
        self.x.abs() + self.y.abs()
    }
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
