//! The contour sum in lanes over what the horizon leaves of the polygon.

use std::f64::consts::PI;

use glam::DVec3;

use super::angle::AngleOverSine;
use super::contour::{ROUNDING, along_normal, any_obtuse, distance, opening, term};
use super::{LANES, Lanes, PreparedPolygon, ReceiverLanes, keep, mask};
use crate::form_factor::edges::Edge;

/// The contour sum of each lane over the part above its horizon.
pub(super) struct CutSum {
    /// Form factors, times 2 pi.
    pub factors: Lanes,
    /// Bounds of their absolute errors, and infinity where the contour does not cross the horizon twice, as rounding may
    /// have it of corners on the horizon.
    pub error_bounds: Lanes,
}

/// Where the contour goes under each lane's horizon, and where it comes up again.
struct Crossings {
    down: [Lanes; 3],
    up: [Lanes; 3],
    /// How often it goes under.
    count: Lanes,
}

impl PreparedPolygon {
    /// Each edge is kept between the parameters 0 and 1 of its ends, or that of its crossing; what is kept of it spans the same
    /// plane with the receiver, so that n . c falls with its length. An edge along the horizon, from where the contour goes
    /// under to where it comes up, closes the sum.
    #[inline(always)]
    pub(super) fn cut_lanes<A: AngleOverSine>(&self, receivers: &ReceiverLanes) -> CutSum {
        let zero = [0.0; LANES];
        let mut sum = CutSum { factors: zero, error_bounds: zero };
        let mut crossings = Crossings { down: [zero; 3], up: [zero; 3], count: zero };
        for edge in &self.edges {
            let w = self.add_cut_edge::<A>(receivers, edge, &mut sum, &mut crossings);
            if any_obtuse(&w) {
                self.add_half_turns(receivers, edge, &w, &mut sum.factors, &mut sum.error_bounds);
            }
        }
        self.close::<A>(receivers, &crossings, &mut sum);
        sum
    }

    /// Adds what is kept of an edge, without the half turns of more than a right angle. Returns w.
    #[inline(always)]
    fn add_cut_edge<A: AngleOverSine>(
        &self,
        receivers: &ReceiverLanes,
        edge: &Edge,
        sum: &mut CutSum,
        crossings: &mut Crossings,
    ) -> Lanes {
        let radius = self.squared_radius.sqrt();
        let mut openings = [0.0; LANES];
        for (lane, kept_opening) in openings.iter_mut().enumerate() {
            let sight = self.sight(receivers, lane, radius);
            let start = edge.start - sight.position;
            let (from, to) = (sight.normal.dot(start), sight.normal.dot(edge.end - sight.position));
            let (starts_below, ends_below) = (mask(from < 0.0), mask(to < 0.0));
            let kept = !(starts_below & ends_below);
            let parameter = from / (from - to);
            let crossing = start + edge.along * parameter;
            let to_crossing = crossing.length_squared().sqrt();

            let here = either(starts_below, to_crossing, distance(&sight, edge.start));
            let next = either(ends_below, to_crossing, distance(&sight, edge.end));
            let reciprocal = 1.0 / (here * next);
            let part = either(ends_below, parameter, 1.0) - keep(starts_below, parameter);
            let w = opening(part * part * edge.squared_length, here, next, reciprocal);
            let term = term::<A>(along_normal(&sight, edge) * part * reciprocal, w);
            sum.factors[lane] += keep(kept, term);
            let bound = edge.length * part * reciprocal * sight.span * (ROUNDING + w * A::ERROR);
            sum.error_bounds[lane] += keep(kept, bound);
            *kept_opening = keep(kept, w);

            let (down, up) = (ends_below & !starts_below, starts_below & !ends_below);
            for axis in 0..3 {
                crossings.down[axis][lane] = either(down, crossing[axis], crossings.down[axis][lane]);
                crossings.up[axis][lane] = either(up, crossing[axis], crossings.up[axis][lane]);
            }
            crossings.count[lane] += keep(down, 1.0);
        }
        openings
    }

    /// Adds the edge along the horizon.
    #[inline(always)]
    fn close<A: AngleOverSine>(&self, receivers: &ReceiverLanes, crossings: &Crossings, sum: &mut CutSum) {
        let radius = self.squared_radius.sqrt();
        let span = |lane: usize| self.sight(receivers, lane, radius).span;
        for lane in 0..LANES {
            let normal = receivers.normal(lane);
            let at = |points: &[Lanes; 3]| DVec3::new(points[0][lane], points[1][lane], points[2][lane]);
            let (start, end) = (at(&crossings.down), at(&crossings.up));
            let along = end - start;
            let cross = along.cross(start);
            let (here, next) = (start.length_squared().sqrt(), end.length_squared().sqrt());
            let reciprocal = 1.0 / (here * next);
            let length = along.length_squared();
            let w = opening(length, here, next, reciprocal);
            let along_normal = normal.dot(cross);
            let term = term::<A>(along_normal * reciprocal, w);
            let turn = PI * along_normal / cross.length_squared().sqrt();
            sum.factors[lane] += term + keep(mask(w > 2.0), turn);
            // The points where the horizon cuts are rounded in parts of the size of receiver and polygon, however near to each
            // other they are.
            let bound = (length.sqrt() * w * A::ERROR + span(lane) * ROUNDING) * (here + next) * reciprocal;
            sum.error_bounds[lane] += bound;
            sum.error_bounds[lane] =
                either(mask(crossings.count[lane] == 1.0), sum.error_bounds[lane], f64::INFINITY);
        }
    }
}

/// The first number where the mask holds, else the second.
#[inline(always)]
fn either(mask: u64, first: f64, second: f64) -> f64 {
    f64::from_bits((first.to_bits() & mask) | (second.to_bits() & !mask))
}
