//! Pyramids and a polygon.

use glam::DVec3;
use pulp::{Simd, WithSimd};

use super::{Pyramids, Reach, sign_of};
use crate::geometry::lanes::{LANES, Mask};
use crate::occluder::wide::{Wide, bits, cross, dot, load, minus, none, splat};
use crate::occluder::{EDGE_ON, OccluderPolygon};

/// A base that reaches out of a cone by less than this part of what it reaches into it is inside: the rest is rounding, as where
/// base, occluder and apex all touch the floor.
const INSIDE: f64 = 1e-12;

/// What a polygon does to pyramids, with the corners of its part in front of the base's plane.
pub(super) struct ReachInto<'a> {
    pub pyramids: &'a Pyramids,
    pub occluder: &'a OccluderPolygon,
    pub front: &'a [DVec3],
}

impl WithSimd for ReachInto<'_> {
    type Output = Reach;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Reach {
        let mut reach = Reach::default();
        for part in 0..LANES / S::F64_LANES {
            let one = self.of_part(simd, part);
            reach.partly |= one.partly << (part * S::F64_LANES);
            reach.wholly |= one.wholly << (part * S::F64_LANES);
        }
        reach
    }
}

impl ReachInto<'_> {
    #[inline(always)]
    fn of_part<S: Simd>(&self, simd: S, part: usize) -> Reach {
        let zero = simd.splat_f64s(0.0);
        let apex = load::<S>(&self.pyramids.apexes, part);
        let mut entered = self.pyramids.entered(simd, part, apex, self.front);
        if none(simd, entered) {
            return Reach::default();
        }
        // A plane through the apex blocks nothing, nor does one that has the base on the near side.
        let normal = splat(simd, self.occluder.normal);
        let first = minus(simd, splat(simd, self.occluder.corners[0]), apex);
        let height = dot(simd, first, normal);
        let sign =
            simd.select_f64s(simd.less_than_f64s(height, zero), simd.splat_f64s(-1.0), simd.splat_f64s(1.0));
        let distance = simd.sqrt_f64s(dot(simd, first, first));
        let tolerance = simd.mul_f64s(simd.splat_f64s(EDGE_ON), distance);
        let height = simd.mul_f64s(sign, height);
        let mut beyond = simd.splat_f64s(f64::NEG_INFINITY);
        for base in &self.pyramids.base {
            let reached = simd.mul_f64s(sign, dot(simd, load::<S>(base, part), normal));
            beyond = simd.max_f64s(beyond, reached);
        }
        let beyond = simd.sub_f64s(beyond, height);
        let counts =
            simd.and_m64s(simd.less_than_f64s(tolerance, height), simd.less_than_f64s(tolerance, beyond));
        entered = simd.and_m64s(entered, counts);
        if none(simd, entered) {
            return Reach::default();
        }
        let cone = cone(simd, self.pyramids, part, apex, self.front, sign);
        let overlapping = bits(simd, simd.and_m64s(entered, simd.less_than_f64s(zero, cone.within)));
        let wholly = overlapping & bits(simd, cone.holds_all(simd));
        Reach { partly: overlapping & !wholly, wholly }
    }
}

/// The base over the sides of an occluder's cone.
struct InCone<S: Simd> {
    /// The lowest of all corners over all sides.
    lowest: S::f64s,
    /// The highest.
    highest: S::f64s,
    /// The least over the sides of the highest corner over each.
    within: S::f64s,
}

impl<S: Simd> InCone<S> {
    #[inline(always)]
    fn holds_all(&self, simd: S) -> S::m64s {
        let slack = simd.mul_f64s(simd.splat_f64s(INSIDE), self.highest);
        simd.less_than_or_equal_f64s(simd.splat_f64s(0.0), simd.add_f64s(self.lowest, slack))
    }
}

/// The base over the sides of the cone around a polygon, whose `sign` is 1 where its corners run clockwise seen from the apex.
#[inline(always)]
fn cone<S: Simd>(
    simd: S,
    pyramids: &Pyramids,
    part: usize,
    apex: Wide<S>,
    corners: &[DVec3],
    sign: S::f64s,
) -> InCone<S> {
    let mut cone = InCone {
        lowest: simd.splat_f64s(f64::INFINITY),
        highest: simd.splat_f64s(f64::NEG_INFINITY),
        within: simd.splat_f64s(f64::INFINITY),
    };
    let mut previous = minus(simd, splat(simd, corners[corners.len() - 1]), apex);
    for corner in corners {
        let corner = minus(simd, splat(simd, *corner), apex);
        let side = cross(simd, previous, corner);
        let mut highest = simd.splat_f64s(f64::NEG_INFINITY);
        for base in &pyramids.base {
            let over = simd.mul_f64s(sign, dot(simd, side, load::<S>(base, part)));
            highest = simd.max_f64s(highest, over);
            cone.lowest = simd.min_f64s(cone.lowest, over);
        }
        cone.highest = simd.max_f64s(cone.highest, highest);
        cone.within = simd.min_f64s(cone.within, highest);
        previous = corner;
    }
    cone
}

/// Whether a polygon crosses all segments from the apexes to the base.
pub(super) struct CutOff<'a> {
    pub pyramids: &'a Pyramids,
    pub occluder: &'a OccluderPolygon,
}

impl WithSimd for CutOff<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let normal = splat(simd, self.occluder.normal);
        for part in 0..LANES / S::F64_LANES {
            let apex = load::<S>(&self.pyramids.apexes, part);
            let first = minus(simd, splat(simd, self.occluder.corners[0]), apex);
            let height = dot(simd, first, normal);
            let sign = sign_of(simd, height);
            let distance = simd.sqrt_f64s(dot(simd, first, first));
            let tolerance = simd.mul_f64s(simd.splat_f64s(EDGE_ON), distance);
            let height = simd.mul_f64s(sign, height);
            let mut nearest = simd.splat_f64s(f64::INFINITY);
            for base in &self.pyramids.base {
                let reached = simd.mul_f64s(sign, dot(simd, load::<S>(base, part), normal));
                nearest = simd.min_f64s(nearest, reached);
            }
            let is_between = simd.and_m64s(
                simd.less_than_f64s(tolerance, height),
                simd.less_than_or_equal_f64s(height, simd.add_f64s(nearest, tolerance)),
            );
            let cone = cone(simd, self.pyramids, part, apex, &self.occluder.corners, sign);
            let is_cut_off = simd.and_m64s(is_between, cone.holds_all(simd));
            let is_spread = simd.less_than_f64s(simd.splat_f64s(0.0), cone.highest);
            if bits(simd, simd.and_m64s(is_cut_off, is_spread)) != Mask::MAX >> (LANES - S::F64_LANES) {
                return false;
            }
        }
        true
    }
}
