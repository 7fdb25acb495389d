//! Welds the corners of pieces into vertices of the mesh.

use std::ops::Range;

use foldhash::{HashMap, HashSet};

use glam::DVec3;
use kernel::disjoint_sets::DisjointSets;
use kernel::geometry::{Bounds, area_vector};
use rayon::prelude::*;
use smallvec::SmallVec;

use super::line::distance_to_line;
use super::outline::make_simple;
use super::planar::Piece;
use super::points::{PointId, Points, SmoothingGroup, UnweldedCorner};
use super::{Vertex, VertexId, WELD};
use scene::{Corner, Facet};

/// Polygons that a thread takes.
const AT_ONCE: usize = 256;

/// In place of the other end of an edge that lies on a contact.
const NONE: PointId = PointId::MAX;

/// The vertices, and the corners of each polygon; empty where welding removed it.
pub struct Welded {
    /// All vertices.
    pub vertices: Vec<Vertex>,
    /// In the order of the pieces.
    pub polygons: Vec<Vec<VertexId>>,
}

/// Welds the corners of pieces, each of which comes with its facet, and finds the vertices. The corners of `facets` come first: where a
/// computed point is welded to one, the corner must not move, or faces that meet there would gape.
#[must_use]
pub fn weld(facets: &[&Facet], pieces: &[(&Facet, &Piece)]) -> Welded {
    let of_facets = facets
        .par_iter()
        .with_min_len(AT_ONCE)
        .flat_map_iter(|&facet| facet.corners.iter().map(move |corner| UnweldedCorner::new(*corner, facet)));
    // The ends of lines become points, so that edges end there.
    let of_pieces = pieces.par_iter().with_min_len(AT_ONCE).flat_map_iter(|&(facet, piece)| {
        let ends = piece.lines.iter().flatten();
        let ends = ends.map(|end| Corner { position: *end, normal: facet.normal });
        ends.chain(piece.corners.iter().copied()).map(move |corner| UnweldedCorner::new(corner, facet))
    });
    let unwelded: Vec<UnweldedCorner> = of_facets.chain(of_pieces).collect();
    let points = Points::new(&unwelded);
    drop(unwelded);
    let first = facets.iter().map(|facet| facet.corners.len()).sum();
    let corners: Vec<Range<usize>> = pieces
        .iter()
        .scan(first, |next, (_, piece)| {
            let start = *next + 2 * piece.lines.len();
            *next = start + piece.corners.len();
            Some(start..*next)
        })
        .collect();
    let polygon = |corners: Range<usize>| {
        let mut ids = points.of_corners[corners].to_vec();
        ids.dedup();
        if ids.len() > 1 && ids.first() == ids.last() {
            ids.pop();
        }
        if ids.len() >= 3 { ids } else { vec![] }
    };
    let polygons = corners.into_par_iter().with_min_len(AT_ONCE).map(polygon).collect();
    Welder { points, polygons }.weld(pieces)
}

/// Polygons of points that are to become polygons of vertices.
struct Welder {
    points: Points,
    polygons: Vec<Vec<PointId>>,
}

impl Welder {
    /// Makes every point that lies on an edge of its own plane a corner there, so that both sides of the edge divide it alike;
    /// then finds the vertices.
    fn weld(mut self, pieces: &[(&Facet, &Piece)]) -> Welded {
        self.insert_t_vertices();
        self.simplify_polygons();
        let points = &self.points.vertices;
        let on_contact = |(polygon, (_, piece)): (&Vec<PointId>, &(&Facet, &Piece))| {
            // Next to none has any.
            let polygon = if piece.lines.is_empty() { &[][..] } else { polygon };
            let found = edges(polygon).filter(|(a, b)| {
                let middle = (points[*a as usize].position + points[*b as usize].position) / 2.0;
                piece.lines.iter().any(|contact| distance_to_line(middle, contact) < WELD)
            });
            found.map(sorted).collect::<SmallVec<[_; 4]>>()
        };
        let polygons = self.polygons.par_iter().zip(pieces).with_min_len(AT_ONCE);
        let contact_edges = polygons.flat_map_iter(on_contact).collect::<Vec<_>>().into_iter().collect();
        self.vertices(&contact_edges)
    }

    /// Cuts spikes off. A needle thinner than the welding distance folds onto itself, and is removed.
    fn simplify_polygons(&mut self) {
        let points = &self.points.vertices;
        self.polygons.par_iter_mut().with_min_len(AT_ONCE).for_each(|polygon| {
            make_simple(polygon, |id| points[id as usize].position);
            let positions: SmallVec<[DVec3; 8]> =
                polygon.iter().map(|id| points[*id as usize].position).collect();
            let longest = edges(polygon)
                .map(|(a, b)| points[a as usize].position.distance(points[b as usize].position));
            let least_area = WELD * longest.fold(0.0, f64::max);
            if area_vector(&positions).length() <= least_area {
                polygon.clear();
            }
        });
    }

    /// The corners of one point that are joined through edges without contact are one vertex. Corners of polygons are numbered through
    /// all of these, as slots.
    fn vertices(self, contact_edges: &HashSet<(PointId, PointId)>) -> Welded {
        let first_slots = self.polygons.iter().scan(0, |next, polygon| {
            let first = *next;
            *next += polygon.len();
            Some(first as u32)
        });
        let first_slots: Vec<u32> = first_slots.collect();
        let beyond = |from: PointId, to: PointId| {
            if contact_edges.contains(&sorted((from, to))) { NONE } else { to }
        };
        let of_polygon = |(polygon, first): (&Vec<PointId>, &u32)| {
            let count = polygon.len();
            let slot = |corner: usize| {
                let point = polygon[corner];
                let beside = [polygon[(corner + count - 1) % count], polygon[(corner + 1) % count]];
                (point, first + corner as u32, beside.map(|other| beyond(point, other)))
            };
            (0..count).map(slot).collect::<SmallVec<[_; 4]>>()
        };
        let polygons = self.polygons.par_iter().zip(&first_slots).with_min_len(AT_ONCE);
        let mut slots: Vec<(PointId, u32, [PointId; 2])> = polygons.flat_map_iter(of_polygon).collect();
        slots.par_sort_unstable();
        let joined: Vec<(u32, u32)> =
            slots.par_chunk_by(|one, other| one.0 == other.0).flat_map_iter(joined_at_point).collect();
        let mut first_of = vec![0; slots.len()];
        joined.into_iter().for_each(|(slot, first)| first_of[slot as usize] = first);
        let mut number = vec![VertexId(0); slots.len()];
        let mut vertices = Vec::with_capacity(self.points.vertices.len());
        for (slot, point) in self.polygons.iter().flatten().enumerate() {
            if first_of[slot] == slot as u32 {
                number[slot] = VertexId(vertices.len() as u32);
                vertices.push(self.points.vertices[*point as usize]);
            }
        }
        let corners = |(polygon, first): (&Vec<PointId>, &u32)| {
            let slots = *first as usize..*first as usize + polygon.len();
            first_of[slots].iter().map(|first| number[*first as usize]).collect()
        };
        let polygons = self.polygons.par_iter().zip(&first_slots).with_min_len(AT_ONCE);
        Welded { vertices, polygons: polygons.map(corners).collect() }
    }

    fn insert_t_vertices(&mut self) {
        let (points, groups) = (&self.points.vertices, &self.points.groups);
        let sort = |(group, ids): &(SmoothingGroup, Vec<PointId>)| {
            let axis =
                Bounds::around(ids.iter().map(|id| points[*id as usize].position)).extent().max_position();
            let mut along: Vec<_> = ids.iter().map(|id| (points[*id as usize].position[axis], *id)).collect();
            along.sort_by(|a, b| a.0.total_cmp(&b.0));
            (*group, (axis, along))
        };
        let several = self.points.flat.par_iter().filter(|(_, ids)| ids.len() > 2);
        let sorted: HashMap<SmoothingGroup, (usize, Vec<(f64, PointId)>)> =
            several.map(sort).collect::<Vec<_>>().into_iter().collect();
        self.polygons.par_iter_mut().with_min_len(AT_ONCE).for_each(|polygon| {
            let mut corners = Vec::with_capacity(polygon.len());
            for (from, to) in edges(polygon) {
                corners.push(from);
                let group = groups[from as usize];
                if group == groups[to as usize]
                    && let Some((axis, along)) = sorted.get(&group)
                {
                    corners.extend(points_between(points, from, to, *axis, along));
                }
            }
            *polygon = corners;
        });
    }
}

/// Of each slot of a point, the first slot that edges without contact join it with. Slots come with what lies beyond the two edges that
/// meet in them.
fn joined_at_point(slots: &[(PointId, u32, [PointId; 2])]) -> SmallVec<[(u32, u32); 8]> {
    let mut sets = DisjointSets::new(slots.len());
    let beyond =
        slots.iter().enumerate().flat_map(|(index, (.., beside))| beside.map(|other| (other, index)));
    let mut beyond: SmallVec<[(PointId, usize); 16]> = beyond.filter(|(other, _)| *other != NONE).collect();
    beyond.sort_unstable();
    for pair in beyond.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        sets.join(pair[0].1, pair[1].1);
    }
    (0..slots.len()).map(|index| (slots[index].1, slots[sets.representative(index)].1)).collect()
}

/// Points inside an edge, in order from its start; `along` holds the candidates sorted by their coordinate on `axis`.
fn points_between(
    points: &[Vertex],
    from: PointId,
    to: PointId,
    axis: usize,
    along: &[(f64, PointId)],
) -> impl Iterator<Item = PointId> + use<> {
    let (start, end) = (points[from as usize].position, points[to as usize].position);
    let span = end - start;
    let length = span.length();
    let (low, high) = (start[axis].min(end[axis]) - WELD, start[axis].max(end[axis]) + WELD);
    let first = along.partition_point(|(value, _)| *value < low);
    let mut inside: Vec<(f64, PointId)> = along[first..]
        .iter()
        .take_while(|(value, _)| *value <= high)
        .filter(|(_, id)| *id != from && *id != to)
        .filter_map(|(_, id)| {
            let offset = points[*id as usize].position - start;
            let distance = offset.dot(span) / length;
            let beside = (offset - span * (distance / length)).length();
            (beside < WELD && distance > WELD && distance < length - WELD).then_some((distance, *id))
        })
        .collect();
    inside.sort_by(|a, b| a.0.total_cmp(&b.0));
    inside.into_iter().map(|(_, id)| id)
}

fn edges(polygon: &[PointId]) -> impl Iterator<Item = (PointId, PointId)> + '_ {
    polygon.iter().copied().zip(polygon.iter().copied().cycle().skip(1))
}

fn sorted((a, b): (PointId, PointId)) -> (PointId, PointId) {
    (a.min(b), a.max(b))
}
