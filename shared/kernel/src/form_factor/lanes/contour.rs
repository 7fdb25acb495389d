//! The contour sum in lanes.

use std::f64::consts::PI;

use glam::DVec3;

use super::angle::AngleOverSine;
use super::{EDGE_ON, LANES, Lanes, PreparedPolygon, ReceiverLanes, keep, mask};
use crate::form_factor::edges::{Edge, GROUP};

/// Rounding error of an edge's term of the contour sum, its angle apart, in parts of the edge's length times the size of
/// receiver and polygon over the product of the distances of its ends: a few roundings for each factor.
pub(super) const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// The contour sum of each lane over the whole polygon.
pub(super) struct Sum {
    /// Height of the lowest corner over the horizon.
    pub lowest: Lanes,
    /// Depth under the horizon down to which a corner only touches it: on walls that adjoin it is rounding. The factor holds
    /// down to there, as what is so near to the horizon adds to it with the square of its height.
    pub touching: Lanes,
    /// Height of the highest corner.
    pub highest: Lanes,
    /// Form factors, times 2 pi; not a number where a receiver lies on a corner.
    pub factors: Lanes,
    /// Bounds of their absolute errors.
    pub error_bounds: Lanes,
    /// Largest w of the edges.
    widest: Lanes,
}

/// A receiver seen from the polygon's centre.
#[derive(Clone, Copy)]
pub(super) struct Sight {
    pub position: DVec3,
    pub normal: DVec3,
    /// Centre x normal.
    moment: DVec3,
    /// At least the distance of the centre, and the polygon's radius on top.
    pub span: f64,
}

impl PreparedPolygon {
    /// The contour sum, with theta / |c| taken as (1 + w p(w)) / (r r') where theta is at most a right angle:
    ///
    /// w = 2 (1 - cos theta) = (L^2 - (r - r')^2) / (r r') with r and r' the distances of an edge's ends and L its length.
    /// Beyond a right angle theta is pi minus the angle of cosine -cos theta, which has 4 - w for w.
    /// n . c = n . (edge x start) = edge . (centre x n) + n . moment.
    #[inline(always)]
    pub(super) fn contour_lanes<A: AngleOverSine>(&self, receivers: &ReceiverLanes) -> Sum {
        let zero = [0.0; LANES];
        let mut sum = Sum {
            lowest: [f64::INFINITY; LANES],
            touching: zero,
            highest: [f64::NEG_INFINITY; LANES],
            factors: zero,
            error_bounds: zero,
            widest: zero,
        };
        if let Ok(edges) = <&[Edge; 3]>::try_from(self.edges.as_slice()) {
            self.add_edges::<A, 3, true>(receivers, edges, &mut sum);
        } else if let Ok(edges) = <&[Edge; GROUP]>::try_from(self.edges.as_slice()) {
            self.add_edges::<A, GROUP, true>(receivers, edges, &mut sum);
        } else {
            for group in self.edges.as_chunks::<GROUP>().0 {
                self.add_edges::<A, GROUP, false>(receivers, group, &mut sum);
            }
        }
        if any_obtuse(&sum.widest) {
            for edge in &self.edges {
                let w = self.openings(receivers, edge);
                if any_obtuse(&w) {
                    self.add_half_turns(receivers, edge, &w, &mut sum.factors, &mut sum.error_bounds);
                }
            }
        }
        sum
    }

    /// Adds the terms of edges that follow each other, without the half turns of those of more than a right angle. `CLOSED`
    /// where the last ends at the start of the first.
    ///
    /// In two loops, as a processor looks ahead only so far: what waits for roots in the first would hold up the second.
    #[inline(always)]
    fn add_edges<A: AngleOverSine, const COUNT: usize, const CLOSED: bool>(
        &self,
        receivers: &ReceiverLanes,
        edges: &[Edge; COUNT],
        sum: &mut Sum,
    ) {
        let mut starts = [Ends::NONE; COUNT];
        let mut last = Ends::NONE;
        for lane in 0..LANES {
            let (position, normal) = (receivers.position(lane), receivers.normal(lane));
            let heights = each::<COUNT>(|i| normal.dot(edges[i].start - position));
            let heights = &heights[..COUNT];
            sum.lowest[lane] = heights.iter().fold(sum.lowest[lane], |a, b| if *b < a { *b } else { a });
            sum.highest[lane] = heights.iter().fold(sum.highest[lane], |a, b| if *b > a { *b } else { a });
            let distances = each::<COUNT>(|i| (edges[i].start - position).length_squared().sqrt());
            let reciprocals = each::<COUNT>(|i| 1.0 / distances[i]);
            starts[0].set(lane, distances[0], reciprocals[0]);
            starts[1].set(lane, distances[1], reciprocals[1]);
            starts[2].set(lane, distances[2], reciprocals[2]);
            if COUNT > 3 {
                starts[3].set(lane, distances[3], reciprocals[3]);
            }
            if !CLOSED {
                let distance = (edges[COUNT - 1].end - position).length_squared().sqrt();
                last.set(lane, distance, 1.0 / distance);
            }
        }
        let next = |i: usize| if !CLOSED && i + 1 == COUNT { &last } else { &starts[(i + 1) % COUNT] };
        let radius = self.squared_radius.sqrt();
        let longest = edges.iter().fold(0.0, |longest, edge| edge.length.max(longest));
        for lane in 0..LANES {
            let sight = self.sight(receivers, lane, radius);
            let reciprocals = each::<COUNT>(|i| starts[i].reciprocal[lane] * next(i).reciprocal[lane]);
            let w = each::<COUNT>(|i| {
                let (here, next) = (starts[i].distance[lane], next(i).distance[lane]);
                opening(edges[i].squared_length, here, next, reciprocals[i])
            });
            let parts = each::<COUNT>(|i| along_normal(&sight, &edges[i]) * reciprocals[i]);
            let terms = each::<COUNT>(|i| term::<A>(parts[i], w[i]));
            sum.factors[lane] += total(terms);
            let widest = w.iter().fold(sum.widest[lane], |a, b| if *b > a { *b } else { a });
            sum.widest[lane] = widest;
            sum.touching[lane] = EDGE_ON * sight.span;
            sum.error_bounds[lane] +=
                longest * total(reciprocals) * sight.span * (ROUNDING + widest * A::ERROR);
        }
    }

    #[inline(always)]
    fn openings(&self, receivers: &ReceiverLanes, edge: &Edge) -> Lanes {
        let mut w = [0.0; LANES];
        for (lane, w) in w.iter_mut().enumerate() {
            let sight = self.sight(receivers, lane, 0.0);
            let (here, next) = (distance(&sight, edge.start), distance(&sight, edge.end));
            *w = opening(edge.squared_length, here, next, (1.0 / here) * (1.0 / next));
        }
        w
    }

    /// Adds pi n . c / |c| where an edge's angle is more than a right angle.
    #[inline(always)]
    pub(super) fn add_half_turns(
        &self,
        receivers: &ReceiverLanes,
        edge: &Edge,
        w: &Lanes,
        factors: &mut Lanes,
        error_bounds: &mut Lanes,
    ) {
        let radius = self.squared_radius.sqrt();
        for lane in 0..LANES {
            let sight = self.sight(receivers, lane, radius);
            let turns = mask(w[lane] > 2.0);
            let reciprocal = 1.0 / edge.along.cross(edge.start - sight.position).length_squared().sqrt();
            factors[lane] += keep(turns, PI * along_normal(&sight, edge) * reciprocal);
            error_bounds[lane] += keep(turns, PI * ROUNDING * edge.length * sight.span * reciprocal);
        }
    }

    #[inline(always)]
    pub(super) fn sight(&self, receivers: &ReceiverLanes, lane: usize, radius: f64) -> Sight {
        let (position, normal) = (receivers.position(lane), receivers.normal(lane));
        let to_centre = self.centre - position;
        let span = to_centre.x.abs() + to_centre.y.abs() + to_centre.z.abs() + radius;
        Sight { position, normal, moment: to_centre.cross(normal), span }
    }
}

/// The first `COUNT` results of a function; 0 beyond. A loop would keep the compiler from making that over the lanes wide.
#[inline(always)]
fn each<const COUNT: usize>(mut result: impl FnMut(usize) -> f64) -> [f64; GROUP] {
    [result(0), result(1), result(2), if COUNT > 3 { result(3) } else { 0.0 }]
}

#[inline(always)]
fn total(terms: [f64; GROUP]) -> f64 {
    (terms[0] + terms[1]) + (terms[2] + terms[3])
}

/// n . c / (r r') times theta over its sine, without the half turn.
#[inline(always)]
pub(super) fn term<A: AngleOverSine>(part: f64, w: f64) -> f64 {
    let short = 2.0 - w;
    let acute = 2.0 - short.abs();
    let term = part + part * (acute * A::beyond_one(acute));
    let sign = short.to_bits() & (1 << 63);
    f64::from_bits(term.to_bits() ^ sign)
}

/// Is an angle of more than a right angle among those of these w?
#[inline(always)]
pub(super) fn any_obtuse(w: &Lanes) -> bool {
    w.iter().fold(false, |any, w| any | (*w > 2.0))
}

/// Distances of the lanes from a corner, and their reciprocals.
#[derive(Clone, Copy)]
struct Ends {
    distance: Lanes,
    reciprocal: Lanes,
}

impl Ends {
    const NONE: Self = Self { distance: [0.0; LANES], reciprocal: [0.0; LANES] };

    #[inline(always)]
    fn set(&mut self, lane: usize, distance: f64, reciprocal: f64) {
        self.distance[lane] = distance;
        self.reciprocal[lane] = reciprocal;
    }
}

#[inline(always)]
pub(super) fn distance(sight: &Sight, corner: DVec3) -> f64 {
    (corner - sight.position).length_squared().sqrt()
}

/// w of an edge of this squared length between ends at these distances, of which the product has this reciprocal. Never below 0, where
/// the polynomial is of no use: next to an end rounding alone would bring it there. Not a number where it is none.
#[inline(always)]
pub(super) fn opening(squared_length: f64, here: f64, next: f64, reciprocal: f64) -> f64 {
    let difference = here - next;
    let w = (squared_length - difference * difference) * reciprocal;
    if w < 0.0 { 0.0 } else { w }
}

/// n . c of an edge.
#[inline(always)]
pub(super) fn along_normal(sight: &Sight, edge: &Edge) -> f64 {
    edge.along.dot(sight.moment) + sight.normal.dot(edge.moment)
}
