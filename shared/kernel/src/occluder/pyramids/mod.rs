//! Which occluders lie between points and a convex polygon? Asked for many points at once.

mod body;
mod polygon;

use glam::DVec3;
use pulp::{Arch, Simd, WithSimd};

use super::wide::{Wide, cross, dot, load, minus, splat, store};
use super::{Body, OccluderPolygon};
use crate::form_factor::PreparedPolygon;
use crate::geometry::lanes::{LANES, Mask, Vectors};
use body::ReachBody;
use polygon::{CutOff, ReachInto};

/// Sides that are compared with an occluder's corners in one pass.
const SIDES_AT_ONCE: usize = 8;

/// The pyramids between some points and a convex polygon that faces them: from each apex to the one base.
///
/// Written with explicit vectors: loops over lanes of so few operations are not made wide as a whole by the compiler. No number
/// depends on the width of the vectors.
#[derive(Debug)]
pub struct Pyramids {
    arch: Arch,
    apexes: Vectors,
    /// Corners of the base, relative to each apex.
    base: Vec<Vectors>,
    /// Inward normals of the sides, not normalised.
    sides: Vec<Vectors>,
}

/// What an occluder does to some pyramids.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Reach {
    /// The pyramids that it reaches into without filling them.
    pub partly: Mask,
    /// The pyramids that it fills.
    pub wholly: Mask,
}

impl Default for Pyramids {
    fn default() -> Self {
        Self { arch: Arch::new(), apexes: Vectors::ZERO, base: vec![], sides: vec![] }
    }
}

impl Pyramids {
    /// Aims the pyramids from these apexes at the polygon with these corners, counter-clockwise seen from the apexes.
    pub fn aim(&mut self, apexes: &Vectors, corners: &[DVec3]) {
        self.apexes = *apexes;
        self.base.resize(corners.len(), Vectors::ZERO);
        self.sides.resize(corners.len(), Vectors::ZERO);
        self.arch.dispatch(Aim { apexes, corners, base: &mut self.base, sides: &mut self.sides });
    }

    /// What an occluder does to the pyramids, given the corners of its part in front of the base's plane. Exact up to rounding:
    /// two convex cones with a common apex overlap unless a side of one of them parts them.
    #[must_use]
    pub fn reach(&self, occluder: &OccluderPolygon, front: &[DVec3]) -> Reach {
        self.arch.dispatch(ReachInto { pyramids: self, occluder, front })
    }

    /// The same of a body that is wholly in front of the base's plane, for apexes outside of it. The second mask is that of these.
    #[must_use]
    pub fn reach_body(&self, body: &Body) -> (Reach, Mask) {
        self.arch.dispatch(ReachBody { pyramids: self, body })
    }

    /// True where an occluder crosses every segment from an apex to a point of the base: the apexes are on one side of its plane,
    /// the base is on the other, and all corners of the base are in the cone of each.
    #[must_use]
    pub fn are_cut_off_by(&self, occluder: &OccluderPolygon) -> bool {
        self.arch.dispatch(CutOff { pyramids: self, occluder })
    }

    /// The same of a body that stands in front of the base's plane, all of it.
    #[must_use]
    pub fn are_cut_off_by_body(&self, body: &Body, base: &PreparedPolygon) -> bool {
        let over_plane = |corner: &DVec3| base.normal().dot(*corner - base.corners()[0]);
        body.corners.iter().all(|corner| over_plane(corner) >= -body.rounding)
            && self.reach_body(body).0.wholly == Mask::MAX
    }

    /// The pyramids that no side parts from all of these corners.
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
