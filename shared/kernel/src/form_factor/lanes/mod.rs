//! Many receivers to one polygon, in the lanes of wide vectors.
//!
//! [`PreparedPolygon::view_lanes`] gives [`LANES`] receivers their unoccluded form factors at once. Each lane does the same
//! arithmetic whatever the others hold, and no sum crosses lanes: the bits depend neither on the width of the vectors nor on
//! the neighbours. Everything is in f64: in f32 the contour sum leaves an error of about 1e-7 over the product of the two
//! cosines, too much towards the horizon.
//!
//! Loops over lanes are written so that the compiler makes them wide, under [`crate::simd::widest`].

mod angle;
mod cluster;
mod contour;
mod cut;
mod point;
mod row;
#[cfg(test)]
mod tests;

use std::f64::consts::TAU;

use glam::DVec3;

use super::PreparedPolygon;
use super::prepared::EDGE_ON;
use contour::Sum;

pub use crate::geometry::lanes::LANES;
pub use cluster::{ClusterLanes, PolygonCluster};

/// Below this tolerance the contour sum takes the arc tangent's full digits.
const FULL_DIGITS: f64 = 1e-6;

/// Error up to which a factor counts as exact, as the series of the scalar code has it.
const EXACT: f64 = 1e-9;

/// A number for each lane.
pub type Lanes = [f64; LANES];

/// Positions and normals of [`LANES`] receivers, coordinate by coordinate.
#[derive(Debug, Clone, PartialEq)]
#[repr(align(64))]
pub struct ReceiverLanes {
    position: [Lanes; 3],
    normal: [Lanes; 3],
}

impl ReceiverLanes {
    /// Takes the positions and unit normals of the first [`LANES`] receivers of an iterator. Where there are fewer, the lanes
    /// left over see nothing.
    #[must_use]
    pub fn new(receivers: impl IntoIterator<Item = (DVec3, DVec3)>) -> Self {
        let mut lanes = Self { position: [[0.0; LANES]; 3], normal: [[0.0; LANES]; 3] };
        for (lane, (position, normal)) in receivers.into_iter().take(LANES).enumerate() {
            for axis in 0..3 {
                lanes.position[axis][lane] = position[axis];
                lanes.normal[axis][lane] = normal[axis];
            }
        }
        lanes
    }

    /// Position of a lane's receiver.
    #[inline(always)]
    #[must_use]
    pub fn position(&self, lane: usize) -> DVec3 {
        DVec3::new(self.position[0][lane], self.position[1][lane], self.position[2][lane])
    }

    /// Unit normal of a lane's receiver; zero where there is none.
    #[inline(always)]
    #[must_use]
    pub fn normal(&self, lane: usize) -> DVec3 {
        DVec3::new(self.normal[0][lane], self.normal[1][lane], self.normal[2][lane])
    }
}

/// What [`LANES`] receivers see of a polygon when nothing is between.
#[derive(Debug, Clone, Default, PartialEq)]
#[repr(align(64))]
pub struct ViewLanes {
    /// The form factors; 0 where a receiver sees nothing, and where it is not answered.
    pub factors: Lanes,
    /// Mean error of the rule used for each factor; 0 of rules that are exact up to rounding.
    pub errors: Lanes,
    /// Receivers whose horizon cuts the polygon, a bit each; what touches it within rounding is not cut.
    pub cut: u32,
    /// Receivers without an answer, a bit each; they are left to [`PreparedPolygon::view`]. The horizon of theirs cuts the
    /// polygon, or they are so close to it, or so low over it, that rounding would cost more than the tolerance.
    pub unanswered: u32,
}

impl PreparedPolygon {
    /// What each receiver sees of the polygon: the factor of [`PreparedPolygon::view`] up to the relative error `tolerance`, 0
    /// exactly where that sees nothing, and a mask of the receivers to be asked about one by one.
    ///
    /// A tolerance under 1e-9 counts as 1e-9, the error of the scalar rules that are "exact".
    #[inline(always)]
    #[must_use]
    pub fn view_lanes(&self, receivers: &ReceiverLanes, tolerance: f64) -> ViewLanes {
        let point = self.point_lanes(receivers, tolerance);
        if point.settled.iter().fold(!0, |all, settled| all & settled) != 0 {
            return ViewLanes { factors: point.factors, errors: point.errors, cut: 0, unanswered: 0 };
        }
        let tolerance = tolerance.max(EXACT);
        let sum = if tolerance < FULL_DIGITS {
            self.contour_lanes::<angle::Full>(receivers)
        } else {
            self.contour_lanes::<angle::Quick>(receivers)
        };
        choose(&point, &sum, tolerance)
    }
}

/// The rule of each lane.
#[inline(always)]
fn choose(point: &point::Point, sum: &Sum, tolerance: f64) -> ViewLanes {
    let mut view = ViewLanes::default();
    let mut unanswered = [0; LANES];
    let mut cut = [0; LANES];
    for lane in 0..LANES {
        let sees = point.front[lane] & mask(sum.highest[lane] > 0.0);
        let whole = mask(sum.lowest[lane] >= -sum.touching[lane]);
        let exact = mask(is_exact(sum.factors[lane], sum.error_bounds[lane], tolerance));
        let by_point = sees & mask(sum.lowest[lane] > 0.0) & point.allowed[lane];
        let by_contour = sees & whole & exact & !by_point;
        let factor = keep(by_contour, (sum.factors[lane] / TAU).min(1.0)).to_bits();
        view.factors[lane] = f64::from_bits(factor | keep(by_point, point.factors[lane]).to_bits());
        view.errors[lane] = keep(by_point, point.errors[lane]);
        unanswered[lane] = sees & !(by_point | by_contour);
        cut[lane] = sees & !whole;
    }
    view.unanswered = bits(&unanswered);
    view.cut = bits(&cut);
    view
}

/// Whether a contour sum is as exact as it must be, given with its bound times 2 pi. One that is not a number, or more than all of a
/// hemisphere, is not.
#[inline(always)]
fn is_exact(sum: f64, error_bound: f64, tolerance: f64) -> bool {
    (error_bound <= tolerance * sum) & (sum <= TAU * (1.0 + tolerance))
}

/// Truth for each lane, as all bits or none: what branches on a condition is not made wide.
type Mask = [u64; LANES];

#[inline(always)]
fn mask(holds: bool) -> u64 {
    0u64.wrapping_sub(u64::from(holds))
}

/// A bit for each lane, the first the lowest.
#[inline(always)]
fn bits(mask: &Mask) -> u32 {
    // Mostly there are none.
    if mask.iter().fold(0, |any, mask| any | mask) == 0 {
        return 0;
    }
    mask.iter().enumerate().fold(0, |bits, (lane, mask)| bits | (u32::from(*mask != 0) << lane))
}

/// The number where the mask holds, else 0.
#[inline(always)]
fn keep(mask: u64, number: f64) -> f64 {
    f64::from_bits(number.to_bits() & mask)
}
