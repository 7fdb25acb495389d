//! How the triangles of the lit sides meet: where light goes on over an edge, and where charts end.

use glam::DVec3;
use rayon::prelude::*;

use crate::error::Stop;
use crate::sides::LitSide;

/// An edge with the bits of its ends.
type Placed = ([[u64; 3]; 2], EdgeOf);

/// Cosine of the angle (one degree) up to which two normals count as one.
const SAME_NORMAL: f64 = 0.999_847_695;

/// Cosine of the angle (45 degrees) between normals up to which charts lie across an edge of small facets.
const BENT: f64 = 0.707;

/// Facets that reach no farther from an edge are small, in texels: most of them lie within the texels that filtering mixes anyway.
const SMALL: f64 = 4.0;

/// An edge of a triangle of a side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct EdgeOf {
    /// Index of the side.
    pub side: u32,
    /// Index of the triangle.
    pub triangle: u32,
    /// Its first corner in the triangle.
    pub corner: u8,
}

impl EdgeOf {
    /// The corners of the triangle that it joins.
    pub fn corners(self) -> [usize; 2] {
        [usize::from(self.corner), (usize::from(self.corner) + 1) % 3]
    }
}

/// How the triangles of some sides meet.
#[derive(Default)]
pub struct Meetings {
    /// Edges over which light goes on smoothly, as far as normals tell: each pair once.
    pub smooth: Vec<[EdgeOf; 2]>,
    /// Edges at which charts end: all others but those where small facets meet at a small angle.
    pub sharp: Vec<EdgeOf>,
}

impl Meetings {
    fn and(mut self, other: Self) -> Self {
        self.smooth.extend(other.smooth);
        self.sharp.extend(other.sharp);
        self
    }
}

/// Finds where triangles of some sides meet: at edges with the same end points. `texel` is the edge of one, in frame units. None where
/// `stop` says so.
pub fn meetings(sides: &[LitSide], texel: f64, stop: Stop) -> Option<Meetings> {
    let bits = |position: DVec3| position.to_array().map(f64::to_bits);
    let of_side = |(side_index, side): (usize, &LitSide)| {
        let mut edges = vec![];
        let lit = side.triangles.iter().enumerate().filter(|(_, triangle)| !triangle.is_sealed);
        for (index, triangle) in lit {
            let corners = side.corners(triangle);
            for corner in 0..3u8 {
                let edge = EdgeOf { side: side_index as u32, triangle: index as u32, corner };
                let mut ends = edge.corners().map(|corner| bits(corners[corner]));
                ends.sort_unstable();
                edges.push((ends, edge));
            }
        }
        edges
    };
    let mut edges: Vec<Placed> = sides.par_iter().enumerate().flat_map_iter(of_side).collect();
    if stop() {
        return None;
    }
    edges.par_sort_unstable();
    let places = edges.par_chunk_by(|a, b| a.0 == b.0);
    let of_place = |place: &[Placed]| {
        let is_asked = place[0].1.triangle.is_multiple_of(256);
        if is_asked && stop() { None } else { Some(meetings_at(sides, texel, place)) }
    };
    places.map(of_place).try_reduce(Meetings::default, |one, other| Some(one.and(other)))
}

/// How triangles meet that have an edge in common.
fn meetings_at(sides: &[LitSide], texel: f64, edges: &[Placed]) -> Meetings {
    let mut meetings = Meetings::default();
    for (index, &(_, edge)) in edges.iter().enumerate() {
        // Fronts and backs of a sheet share their edges, and do not face the same way.
        let others = |least: f64| {
            let others = edges.iter().map(|(_, other)| *other);
            others.filter(move |other| *other != edge && cosine(sides, edge, *other) >= least)
        };
        let mut alike = others(SAME_NORMAL);
        match (alike.next(), alike.next()) {
            (Some(other), None) => {
                let is_first = edges[index..].iter().any(|(_, later)| *later == other);
                meetings.smooth.extend(is_first.then_some([edge, other]));
            }
            (None, _) if is_small_bend(sides, texel, edge, others(BENT)) => {}
            _ => meetings.sharp.push(edge),
        }
    }
    meetings
}

/// Whether one facet alone goes on from an edge at a small angle, and either is small.
fn is_small_bend(
    sides: &[LitSide],
    texel: f64,
    edge: EdgeOf,
    mut others: impl Iterator<Item = EdgeOf>,
) -> bool {
    let is_small = |edge: EdgeOf| reach(sides, edge) <= SMALL * texel;
    match (others.next(), others.next()) {
        (Some(other), None) => is_small(edge) || is_small(other),
        _ => false,
    }
}

/// Least cosine between the normals of two triangles along an edge that they share.
fn cosine(sides: &[LitSide], one: EdgeOf, other: EdgeOf) -> f64 {
    let ends = |edge: EdgeOf| {
        let side = &sides[edge.side as usize];
        let triangle = &side.triangles[edge.triangle as usize];
        let corners = side.corners(triangle);
        edge.corners().map(|corner| (corners[corner], triangle.normals[corner]))
    };
    let others = ends(other);
    let cosine = |(position, normal): (DVec3, DVec3)| {
        let same = others.iter().find(|(other, _)| *other == position);
        same.map_or(-1.0, |(_, other)| normal.dot(*other))
    };
    ends(one).map(cosine).into_iter().fold(1.0, f64::min)
}

/// How far the facet of an edge's triangle reaches from it, in the mean.
fn reach(sides: &[LitSide], edge: EdgeOf) -> f64 {
    let side = &sides[edge.side as usize];
    let triangle = &side.triangles[edge.triangle as usize];
    let corners = side.corners(triangle);
    let [a, b] = edge.corners().map(|corner| corners[corner]);
    triangle.facet_area / a.distance(b)
}
