//! Pyramids and the outline of a body.

use pulp::{Simd, WithSimd};

use super::{Pyramids, Reach};
use crate::geometry::lanes::{LANES, Mask};
use crate::occluder::Body;
use crate::occluder::wide::{bits, cross, dot, load, minus, none, splat};

/// What a body does to pyramids whose apexes are outside of it.
pub(super) struct ReachBody<'a> {
    pub pyramids: &'a Pyramids,
    pub body: &'a Body,
}

impl WithSimd for ReachBody<'_> {
    type Output = (Reach, Mask);

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> (Reach, Mask) {
        let (mut reach, mut outside) = (Reach::default(), 0);
        for part in 0..LANES / S::F64_LANES {
            let (one, is_outside) = self.of_part(simd, part);
            reach.partly |= one.partly << (part * S::F64_LANES);
            reach.wholly |= one.wholly << (part * S::F64_LANES);
            outside |= is_outside << (part * S::F64_LANES);
        }
        (reach, outside)
    }
}

impl ReachBody<'_> {
    #[inline(always)]
    fn of_part<S: Simd>(&self, simd: S, part: usize) -> (Reach, Mask) {
        let zero = simd.splat_f64s(0.0);
        let apex = load::<S>(&self.pyramids.apexes, part);
        let entered = self.pyramids.entered(simd, part, apex, &self.body.corners);
        if none(simd, entered) {
            return (Reach::default(), Mask::MAX >> (LANES - S::F64_LANES));
        }
        let rounding = simd.splat_f64s(self.body.rounding);
        let mut lowest = simd.splat_f64s(f64::INFINITY);
        let mut within = simd.splat_f64s(f64::INFINITY);
        let mut outside = simd.splat_f64s(f64::NEG_INFINITY);
        for edge in &self.body.edges {
            let left = dot(simd, splat(simd, edge.left.normal), apex);
            let left = simd.sub_f64s(left, simd.splat_f64s(edge.left.offset));
            let right = dot(simd, splat(simd, edge.right.normal), apex);
            let right = simd.sub_f64s(right, simd.splat_f64s(edge.right.offset));
            outside = simd.max_f64s(outside, simd.max_f64s(left, right));
            let sees_left = simd.less_than_f64s(rounding, left);
            let sees_right = simd.less_than_f64s(rounding, right);
            let is_outline = simd.xor_m64s(sees_left, sees_right);
            if none(simd, is_outline) {
                continue;
            }
            let from = minus(simd, splat(simd, edge.from), apex);
            let to = minus(simd, splat(simd, edge.to), apex);
            // Inwards, whichever of the two faces is seen: the other way round where that is the left one.
            let side = cross(simd, from, to);
            let sign = simd.select_f64s(sees_left, simd.splat_f64s(-1.0), simd.splat_f64s(1.0));
            let mut highest = simd.splat_f64s(f64::NEG_INFINITY);
            let mut least = simd.splat_f64s(f64::INFINITY);
            for base in &self.pyramids.base {
                let over = simd.mul_f64s(sign, dot(simd, side, load::<S>(base, part)));
                highest = simd.max_f64s(highest, over);
                least = simd.min_f64s(least, over);
            }
            within = simd.select_f64s(is_outline, simd.min_f64s(within, highest), within);
            lowest = simd.select_f64s(is_outline, simd.min_f64s(lowest, least), lowest);
        }
        let outside = simd.less_than_f64s(rounding, outside);
        let entered = simd.and_m64s(entered, outside);
        let overlapping = bits(simd, simd.and_m64s(entered, simd.less_than_f64s(zero, within)));
        let wholly = overlapping & bits(simd, simd.less_than_or_equal_f64s(zero, lowest));
        (Reach { partly: overlapping & !wholly, wholly }, bits(simd, outside))
    }
}
