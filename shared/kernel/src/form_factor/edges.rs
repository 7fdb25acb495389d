//! Edges of a polygon, prepared for contour sums.

use glam::DVec3;
use smallvec::SmallVec;

/// Edges of a polygon of more than four corners that are summed at once.
pub(super) const GROUP: usize = 4;

/// An edge as the contour sum takes it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Edge {
    pub(super) start: DVec3,
    pub(super) end: DVec3,
    /// `end - start`.
    pub(super) along: DVec3,
    /// `along` x start, from the polygon's centre.
    pub(super) moment: DVec3,
    pub(super) length: f64,
    pub(super) squared_length: f64,
}

/// The edges of a polygon: three, four, or a multiple of four, filled up with edges without length.
pub(super) type Edges = SmallVec<[Edge; 4]>;

/// The edges of a polygon of these corners.
pub(super) fn edges(corners: &[DVec3], centre: DVec3) -> Edges {
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
