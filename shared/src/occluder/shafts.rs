//! Which occluders lie between points and a convex polygon? Asked for many points at once.

use glam::DVec3;
use pulp::{Arch, Simd, WithSimd};

use super::wide::{Wide, bits, cross, dot, load, minus, none, splat, store};
use super::{Body, EDGE_ON, OccluderPolygon};
use crate::form_factor::PreparedPolygon;
use crate::geometry::lanes::{LANES, Mask, Vectors};

/// Sides that are held against an occluder's corners in one pass.
const SIDES_AT_ONCE: usize = 8;

/// A base that reaches out of a cone by less than this part of what it reaches into it is inside: the rest is rounding, as where
/// base, occluder and apex all touch the floor.
const INSIDE: f64 = 1e-12;

/// The pyramids between some points and a convex polygon that faces them: from each apex to the one base.
///
/// Written with explicit vectors: loops over lanes of so few operations are not made wide as a whole by the compiler. No number
/// depends on the width of the vectors.
#[derive(Debug)]
pub struct Shafts {
    arch: Arch,
    apexes: Vectors,
    /// Corners of the base, relative to each apex.
    base: Vec<Vectors>,
    /// Inward normals of the sides, not normalised.
    sides: Vec<Vectors>,
}

/// What an occluder does to some shafts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Reach {
    /// The shafts that it reaches into without filling them.
    pub partly: Mask,
    /// The shafts that it fills.
    pub wholly: Mask,
}

impl Default for Shafts {
    fn default() -> Self {
        Self { arch: Arch::new(), apexes: Vectors::ZERO, base: vec![], sides: vec![] }
    }
}

impl Shafts {
    /// Aims the shafts from these apexes at the polygon with these corners, counter-clockwise seen from the apexes.
    pub fn aim(&mut self, apexes: &Vectors, corners: &[DVec3]) {
        self.apexes = *apexes;
        self.base.resize(corners.len(), Vectors::ZERO);
        self.sides.resize(corners.len(), Vectors::ZERO);
        self.arch.dispatch(Aim { apexes, corners, base: &mut self.base, sides: &mut self.sides });
    }

    /// What an occluder does to the shafts, given the corners of its part in front of the base's plane. Exact up to rounding:
    /// two convex cones with a common apex overlap unless a side of one of them parts them.
    #[must_use]
    pub fn reach(&self, occluder: &OccluderPolygon, front: &[DVec3]) -> Reach {
        self.arch.dispatch(ReachInto { shafts: self, occluder, front })
    }

    /// The same of a body that is wholly in front of the base's plane, for apexes outside of it. The second mask is that of these.
    #[must_use]
    pub fn reach_body(&self, body: &Body) -> (Reach, Mask) {
        self.arch.dispatch(ReachBody { shafts: self, body })
    }

    /// True where an occluder crosses every segment from an apex to a point of the base: the apexes are on one side of its plane,
    /// the base is on the other, and all corners of the base are in the cone of each.
    #[must_use]
    pub fn are_cut_off_by(&self, occluder: &OccluderPolygon) -> bool {
        self.arch.dispatch(CutOff { shafts: self, occluder })
    }

    /// The same of a body that stands in front of the base's plane, all of it.
    #[must_use]
    pub fn are_cut_off_by_body(&self, body: &Body, base: &PreparedPolygon) -> bool {
        let over_plane = |corner: &DVec3| base.normal().dot(*corner - base.corners()[0]);
        body.corners.iter().all(|corner| over_plane(corner) >= -body.rounding)
            && self.reach_body(body).0.wholly == Mask::MAX
    }

    /// The shafts that no side parts from all of these corners.
    #[inline(always)]
    fn entered<S: Simd>(&self, simd: S, part: usize, apex: Wide<S>, corners: &[DVec3]) -> S::m64s {
        let mut inside = simd.splat_f64s(f64::INFINITY);
        for sides in self.sides.chunks(SIDES_AT_ONCE) {
            // Of each side the farthest that a corner lies inside of it; the least of these.
            let mut farthest = [simd.splat_f64s(f64::NEG_INFINITY); SIDES_AT_ONCE];
            for corner in corners {
                let corner = minus(simd, splat(simd, *corner), apex);
                for (i, side) in sides.iter().enumerate() {
                    farthest[i] = simd.max_f64s(farthest[i], dot(simd, load::<S>(side, part), corner));
                }
            }
            for one in &farthest[..sides.len()] {
                inside = simd.min_f64s(inside, *one);
            }
        }
        simd.less_than_f64s(simd.splat_f64s(0.0), inside)
    }
}

/// -1 where a number is negative, else 1.
#[inline(always)]
fn sign_of<S: Simd>(simd: S, number: S::f64s) -> S::f64s {
    let is_negative = simd.less_than_f64s(number, simd.splat_f64s(0.0));
    simd.select_f64s(is_negative, simd.splat_f64s(-1.0), simd.splat_f64s(1.0))
}

struct Aim<'a> {
    apexes: &'a Vectors,
    corners: &'a [DVec3],
    base: &'a mut [Vectors],
    sides: &'a mut [Vectors],
}

impl WithSimd for Aim<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for (i, corner) in self.corners.iter().enumerate() {
            let along = splat(simd, self.corners[(i + 1) % self.corners.len()] - *corner);
            for part in 0..LANES / S::F64_LANES {
                let to_corner = minus(simd, splat(simd, *corner), load::<S>(self.apexes, part));
                store::<S>(&mut self.base[i], part, to_corner);
                store::<S>(&mut self.sides[i], part, cross(simd, along, to_corner));
            }
        }
    }
}

struct ReachInto<'a> {
    shafts: &'a Shafts,
    occluder: &'a OccluderPolygon,
    front: &'a [DVec3],
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
        let apex = load::<S>(&self.shafts.apexes, part);
        let mut entered = self.shafts.entered(simd, part, apex, self.front);
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
        for base in &self.shafts.base {
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
        let cone = cone(simd, self.shafts, part, apex, self.front, sign);
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
    shafts: &Shafts,
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
        for base in &shafts.base {
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

struct CutOff<'a> {
    shafts: &'a Shafts,
    occluder: &'a OccluderPolygon,
}

impl WithSimd for CutOff<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let normal = splat(simd, self.occluder.normal);
        for part in 0..LANES / S::F64_LANES {
            let apex = load::<S>(&self.shafts.apexes, part);
            let first = minus(simd, splat(simd, self.occluder.corners[0]), apex);
            let height = dot(simd, first, normal);
            let sign = sign_of(simd, height);
            let distance = simd.sqrt_f64s(dot(simd, first, first));
            let tolerance = simd.mul_f64s(simd.splat_f64s(EDGE_ON), distance);
            let height = simd.mul_f64s(sign, height);
            let mut nearest = simd.splat_f64s(f64::INFINITY);
            for base in &self.shafts.base {
                let reached = simd.mul_f64s(sign, dot(simd, load::<S>(base, part), normal));
                nearest = simd.min_f64s(nearest, reached);
            }
            let is_between = simd.and_m64s(
                simd.less_than_f64s(tolerance, height),
                simd.less_than_or_equal_f64s(height, simd.add_f64s(nearest, tolerance)),
            );
            let cone = cone(simd, self.shafts, part, apex, &self.occluder.corners, sign);
            let is_cut_off = simd.and_m64s(is_between, cone.holds_all(simd));
            let is_spread = simd.less_than_f64s(simd.splat_f64s(0.0), cone.highest);
            if bits(simd, simd.and_m64s(is_cut_off, is_spread)) != Mask::MAX >> (LANES - S::F64_LANES) {
                return false;
            }
        }
        true
    }
}

struct ReachBody<'a> {
    shafts: &'a Shafts,
    body: &'a Body,
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
        let apex = load::<S>(&self.shafts.apexes, part);
        let entered = self.shafts.entered(simd, part, apex, &self.body.corners);
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
            for base in &self.shafts.base {
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
