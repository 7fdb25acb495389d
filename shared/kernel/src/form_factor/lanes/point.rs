//! The point rule in lanes, and which lanes need no more.

use super::{EDGE_ON, LANES, Lanes, Mask, PreparedPolygon, ReceiverLanes, keep, mask};
use crate::form_factor::prepared::MEAN_POINT_RULE_ERROR;
use std::f64::consts::TAU;

/// What the point rule says of each lane.
pub(super) struct Point {
    /// Before the polygon, and not edge-on to it.
    pub front: Mask,
    /// The point rule is within the tolerance, if the whole polygon is above the horizon.
    pub allowed: Mask,
    /// No other rule is needed: behind the polygon, or the polygon wholly under the horizon, or `allowed` and wholly above.
    pub settled: Mask,
    /// Factors of the point rule; 0 where settled so.
    pub factors: Lanes,
    /// Their mean errors.
    pub errors: Lanes,
}

impl PreparedPolygon {
    /// The same bound and rule as [`PreparedPolygon::view`], without divisions in the bound.
    #[inline(always)]
    pub(super) fn point_lanes(&self, receivers: &ReceiverLanes, tolerance: f64) -> Point {
        let reach = self.squared_reach.sqrt();
        let mean_error = MEAN_POINT_RULE_ERROR * self.squared_reach;
        let mut point = Point {
            front: [0; LANES],
            allowed: [0; LANES],
            settled: [0; LANES],
            factors: [0.0; LANES],
            errors: [0.0; LANES],
        };
        for lane in 0..LANES {
            let (position, normal) = (receivers.position(lane), receivers.normal(lane));
            let to_centre = self.centre - position;
            let distance = to_centre.length_squared().sqrt();
            let front = self.normal.dot(to_centre) < -EDGE_ON * distance;

            let to_centroid = self.centroid - position;
            let squared = to_centroid.length_squared();
            let distance = squared.sqrt();
            let height = normal.dot(to_centroid);
            // The bound of `point_rule_error`, times height and squared distance.
            let bound = self.squared_reach * (10.0 / 3.0 * height + 4.0 / 3.0 * distance);
            let allowed = (height > 0.0) & (bound <= tolerance * squared * height);
            // Rounding of the corners' heights must not change the decision.
            let margin = reach + EDGE_ON * distance;
            let above = height > margin;
            let below = height < -margin;
            let reciprocal = 1.0 / squared;
            let cosines = -height * self.doubled_area.dot(to_centroid);
            let factor = cosines * (reciprocal * reciprocal) * (1.0 / TAU);
            let seen = mask(front & allowed & (factor > 0.0));
            point.front[lane] = mask(front);
            point.allowed[lane] = mask(allowed);
            point.settled[lane] = mask(!front | below | (allowed & above));
            point.factors[lane] = keep(seen, factor);
            point.errors[lane] = keep(seen, factor * (mean_error * reciprocal));
        }
        point
    }
}
