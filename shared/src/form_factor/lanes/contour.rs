//! The contour sum in lanes.

use std::f64::consts::PI;

use glam::DVec3;
use smallvec::SmallVec;

use super::angle::AngleOverSine;
use super::{LANES, Lanes, PreparedPolygon, ReceiverLanes, keep, mask};

/// Rounding error of an edge's term of the contour sum, its angle apart, in parts of the edge's length times the size of
/// receiver and polygon over the product of the distances of its ends: a few roundings for each factor.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// Edges of a polygon of more than four corners that are summed at once.
pub(super) const GROUP: usize = 4;

/// An edge as the contour sum takes it.
#[derive(Debug, Clone, Copy)]
pub(in crate::form_factor) struct Edge {
    start: DVec3,
    end: DVec3,
    /// `end - start`.
    along: DVec3,
    /// `along` x start, from the polygon's centre.
    moment: DVec3,
    length: f64,
    squared_length: f64,
}

/// The edges of a polygon: three, four, or so many as fill groups of four, with edges without length after the last.
pub(in crate::form_factor) type Edges = SmallVec<[Edge; 4]>;

/// The edges of a polygon of these corners.
pub(in crate::form_factor) fn edges(corners: &[DVec3], centre: DVec3) -> Edges {
    let next = corners.iter().cycle().skip(1);
    let mut edges: Edges =
        corners.iter().zip(next).map(|(start, end)| Edge::new(*start, *end, centre)).collect();
    if let Some(end) = edges.last().map(|edge| edge.end).filter(|_| edges.len() != 3) {
        edges.resize(edges.len().next_multiple_of(GROUP), Edge::new(end, end, centre));
    }
    edges
}

impl Edge {
    fn new(start: DVec3, end: DVec3, centre: DVec3) -> Self {
        let along = end - start;
        let squared_length = along.length_squared();
        let moment = along.cross(start - centre);
        Self { start, end, along, moment, length: squared_length.sqrt(), squared_length }
    }
}

/// The contour sum of each lane over the whole polygon.
pub(super) struct Sum {
    /// Number of edges that start above the horizon. The factor holds where all do.
    pub above: Lanes,
    /// Form factors, times 2 pi; not a number where a receiver lies on a corner.
    pub factors: Lanes,
    /// Bounds of their absolute errors.
    pub error_bounds: Lanes,
    /// Largest w of the edges.
    widest: Lanes,
}

/// A receiver seen from the polygon's centre.
#[derive(Clone, Copy)]
struct Sight {
    position: DVec3,
    normal: DVec3,
    /// Centre x normal.
    moment: DVec3,
    /// At least the distance of the centre, and the polygon's radius on top.
    span: f64,
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
        let mut sum = Sum { above: zero, factors: zero, error_bounds: zero, widest: zero };
        if let Ok(edges) = <&[Edge; 3]>::try_from(self.edges.as_slice()) {
            self.add_edges::<A, 3, true>(receivers, edges, &mut sum);
        } else if let Ok(edges) = <&[Edge; GROUP]>::try_from(self.edges.as_slice()) {
            self.add_edges::<A, GROUP, true>(receivers, edges, &mut sum);
        } else {
            for group in self.edges.as_chunks::<GROUP>().0 {
                self.add_edges::<A, GROUP, false>(receivers, group, &mut sum);
            }
        }
        if sum.widest.iter().fold(false, |any, widest| any | (*widest > 2.0)) {
            for edge in &self.edges {
                self.add_half_turns(receivers, edge, &mut sum);
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
        let mut ends = Ends { distance: [[0.0; LANES]; GROUP + 1], reciprocal: [[0.0; LANES]; GROUP + 1] };
        for lane in 0..LANES {
            let (position, normal) = (receivers.position(lane), receivers.normal(lane));
            let above = each::<COUNT>(|i| keep(mask(normal.dot(edges[i].start - position) > 0.0), 1.0));
            sum.above[lane] += total(above);
            let distances = each::<COUNT>(|i| (edges[i].start - position).length_squared().sqrt());
            let reciprocals = each::<COUNT>(|i| 1.0 / distances[i]);
            ends.set(lane, 0, distances[0], reciprocals[0]);
            ends.set(lane, 1, distances[1], reciprocals[1]);
            ends.set(lane, 2, distances[2], reciprocals[2]);
            if COUNT > 3 {
                ends.set(lane, 3, distances[3], reciprocals[3]);
            }
            if !CLOSED {
                let last = (edges[COUNT - 1].end - position).length_squared().sqrt();
                ends.set(lane, COUNT, last, 1.0 / last);
            }
        }
        let radius = self.squared_radius.sqrt();
        for lane in 0..LANES {
            let sight = self.sight(receivers, lane, radius);
            let next = |i| if CLOSED { (i + 1) % COUNT } else { i + 1 };
            let distance = |i: usize| ends.distance[i][lane];
            let reciprocals = each::<COUNT>(|i| ends.reciprocal[i][lane] * ends.reciprocal[next(i)][lane]);
            let w = each::<COUNT>(|i| opening(&edges[i], distance(i), distance(next(i)), reciprocals[i]));
            let acute = each::<COUNT>(|i| 2.0 - (2.0 - w[i]).abs());
            let beyond = A::beyond_one(acute);
            let parts = each::<COUNT>(|i| along_normal(&sight, &edges[i]) * reciprocals[i]);
            let terms = each::<COUNT>(|i| {
                1.0f64.copysign(2.0 - w[i]) * (parts[i] + parts[i] * (acute[i] * beyond[i]))
            });
            sum.factors[lane] += total(terms);
            let widest = w.iter().fold(sum.widest[lane], |a, b| if *b > a { *b } else { a });
            sum.widest[lane] = widest;
            let bound = total(each::<COUNT>(|i| edges[i].length * reciprocals[i]));
            sum.error_bounds[lane] += bound * sight.span * (ROUNDING + widest * A::ERROR);
        }
    }

    /// Adds pi n . c / |c| where an edge's angle is more than a right angle.
    #[inline(always)]
    fn add_half_turns(&self, receivers: &ReceiverLanes, edge: &Edge, sum: &mut Sum) {
        let radius = self.squared_radius.sqrt();
        for lane in 0..LANES {
            let sight = self.sight(receivers, lane, radius);
            let (here, next) = (distance(&sight, edge.start), distance(&sight, edge.end));
            let w = opening(edge, here, next, (1.0 / here) * (1.0 / next));
            let turns = mask(w > 2.0);
            let reciprocal = 1.0 / edge.along.cross(edge.start - sight.position).length_squared().sqrt();
            sum.factors[lane] += keep(turns, PI * along_normal(&sight, edge) * reciprocal);
            sum.error_bounds[lane] += keep(turns, PI * ROUNDING * edge.length * sight.span * reciprocal);
        }
    }

    #[inline(always)]
    fn sight(&self, receivers: &ReceiverLanes, lane: usize, radius: f64) -> Sight {
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

/// Distances of corners, and their reciprocals.
struct Ends {
    distance: [Lanes; GROUP + 1],
    reciprocal: [Lanes; GROUP + 1],
}

impl Ends {
    #[inline(always)]
    fn set(&mut self, lane: usize, corner: usize, distance: f64, reciprocal: f64) {
        self.distance[corner][lane] = distance;
        self.reciprocal[corner][lane] = reciprocal;
    }
}

#[inline(always)]
fn distance(sight: &Sight, corner: DVec3) -> f64 {
    (corner - sight.position).length_squared().sqrt()
}

/// w of an edge whose ends are at these distances.
#[inline(always)]
fn opening(edge: &Edge, here: f64, next: f64, reciprocal: f64) -> f64 {
    let difference = here - next;
    (edge.squared_length - difference * difference) * reciprocal
}

/// n . c of an edge.
#[inline(always)]
fn along_normal(sight: &Sight, edge: &Edge) -> f64 {
    edge.along.dot(sight.moment) + sight.normal.dot(edge.moment)
}
