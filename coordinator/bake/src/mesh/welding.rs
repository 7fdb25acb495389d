//! Welds the corners of pieces into vertices of the mesh.

use foldhash::{HashMap, HashMapExt, HashSet};

use glam::{DVec3, IVec3};
use kernel::disjoint_sets::DisjointSets;
use kernel::geometry::{Bounds, PlaneId, area_vector};
use rayon::prelude::*;
use smallvec::SmallVec;

use super::line::{Contact, distance_to_line};
use super::outline::make_simple;
use super::{Vertex, VertexId, WELD};
use scene::{Corner, Facet};

/// Distinguishes the two directions of a plane. Perpendicular to no likely normal, so that rounding does not decide.
const NO_COMMON_NORMAL: DVec3 = DVec3::new(0.537_7, 0.651_3, 0.535_4);

/// Which corners at one position have the same normal: those of one plane and direction, or of one smooth normal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
enum SmoothingGroup {
    Flat(PlaneId, bool),
    Smooth([i32; 3]),
}

/// Polygons that a thread takes.
const AT_ONCE: usize = 256;

/// Index of a point: a position and a smoothing group. A vertex is a point, or a part of one where a contact divides the
/// surface around it.
type PointId = u32;

/// Welds corners that are the same point, and finds the vertices.
#[derive(Default)]
pub struct Welder {
    points: Vec<Vertex>,
    groups: Vec<SmoothingGroup>,
    found: HashMap<(IVec3, SmoothingGroup), PointId>,
    /// Cells that have a point of any group: far fewer than there are points.
    cells: HashSet<IVec3>,
    /// Points of each plane, for T-vertices.
    flat: HashMap<SmoothingGroup, Vec<PointId>>,
    polygons: Vec<Vec<PointId>>,
    /// Edges that lie on a contact.
    contact_edges: HashSet<(PointId, PointId)>,
}

/// The vertices, and the corners of each polygon; empty where welding removed it.
pub struct Welded {
    /// All vertices.
    pub vertices: Vec<Vertex>,
    /// In the order in which the polygons were added.
    pub polygons: Vec<Vec<VertexId>>,
}

impl Welder {
    /// A welder with room for this many points.
    pub fn for_points(count: usize) -> Self {
        Self {
            points: Vec::with_capacity(count),
            groups: Vec::with_capacity(count),
            found: HashMap::with_capacity(count),
            ..Self::default()
        }
    }

    /// Makes a facet's own corners points. All of them come first: where a computed point is welded to one, the corner must not
    /// move, or faces that meet there would gape.
    pub fn add_corners(&mut self, facet: &Facet) {
        facet.corners.iter().for_each(|corner| {
            self.point(corner, facet);
        });
    }

    /// Adds a piece of a facet.
    pub fn add(&mut self, corners: &[Corner], facet: &Facet) {
        let mut ids: Vec<PointId> = corners.iter().map(|corner| self.point(corner, facet)).collect();
        ids.dedup();
        if ids.len() > 1 && ids.first() == ids.last() {
            ids.pop();
        }
        self.polygons.push(if ids.len() >= 3 { ids } else { vec![] });
    }

    /// Makes the ends of a facet's contacts points, so that edges end there.
    pub fn add_ends(&mut self, contacts: &[Contact], facet: &Facet) {
        for end in contacts.iter().flatten() {
            self.point(&Corner { position: *end, normal: facet.normal }, facet);
        }
    }

    fn point(&mut self, corner: &Corner, facet: &Facet) -> PointId {
        let smooth = corner.normal != facet.normal;
        let group = if smooth {
            SmoothingGroup::Smooth((corner.normal * 1e6).round().as_ivec3().to_array())
        } else {
            SmoothingGroup::Flat(facet.plane, facet.normal.dot(NO_COMMON_NORMAL) > 0.0)
        };
        let cell = (corner.position / WELD).round().as_ivec3();
        let here = (cell, group);
        let known = self.found.get(&here).copied().or_else(|| self.near(corner.position, cell, group));
        known.unwrap_or_else(|| {
            let id = self.points.len() as PointId;
            self.points.push(Vertex {
                position: corner.position,
                normal: corner.normal,
                plane: facet.plane,
                smooth,
                hovering: None,
            });
            self.groups.push(group);
            if !smooth {
                self.flat.entry(group).or_default().push(id);
            }
            self.found.insert(here, id);
            self.cells.insert(cell);
            id
        })
    }

    /// A point closer than half the welding distance in a cell beside: rounding may have put the two on either side of a border.
    fn near(&self, position: DVec3, cell: IVec3, group: SmoothingGroup) -> Option<PointId> {
        // The nearer neighbour on each axis: what is half the distance away lies there.
        let offset = position / WELD - cell.as_dvec3();
        let steps = [0, 1, 2].map(|axis| [0, if offset[axis] < 0.0 { -1 } else { 1 }]);
        let beside = steps[0].into_iter().flat_map(|x| {
            steps[1].into_iter().flat_map(move |y| steps[2].into_iter().map(move |z| IVec3::new(x, y, z)))
        });
        beside
            .filter(|step| self.cells.contains(&(cell + step)))
            .filter_map(|step| self.found.get(&(cell + step, group)).copied())
            .find(|point| self.points[*point as usize].position.distance(position) < WELD / 2.0)
    }

    /// Makes every point that lies on an edge of its own plane a corner there, so that both sides of the edge divide it alike;
    /// then finds the vertices. `contacts` gives the contacts that edges of each polygon lie on.
    #[must_use]
    pub fn weld<'a>(mut self, contacts: impl Fn(usize) -> &'a [Contact] + Sync) -> Welded {
        self.insert_t_vertices();
        self.simplify_polygons();
        let points = &self.points;
        let on_contact = |(index, polygon): (usize, &Vec<PointId>)| {
            let contacts = contacts(index);
            // Next to none has any.
            let polygon = if contacts.is_empty() { &[][..] } else { polygon };
            let found = edges(polygon).filter(|(a, b)| {
                let middle = (points[*a as usize].position + points[*b as usize].position) / 2.0;
                contacts.iter().any(|contact| distance_to_line(middle, contact) < WELD)
            });
            found.map(sorted).collect::<SmallVec<[_; 4]>>()
        };
        let polygons = self.polygons.par_iter().enumerate().with_min_len(AT_ONCE);
        self.contact_edges = polygons.flat_map_iter(on_contact).collect::<Vec<_>>().into_iter().collect();
        self.vertices()
    }

    /// Cuts spikes off. A needle thinner than the welding distance folds onto itself, and is removed.
    fn simplify_polygons(&mut self) {
        let points = &self.points;
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

    /// The corners of one point that are joined through edges without contact are one vertex.
    fn vertices(self) -> Welded {
        let slot_of: Vec<usize> = self
            .polygons
            .iter()
            .scan(0, |next, polygon| {
                let first = *next;
                *next += polygon.len();
                Some(first)
            })
            .collect();
        let count = self.polygons.iter().map(Vec::len).sum();
        // Edges with the slots of both ends, the lesser point first.
        let of_polygon = |(polygon, first): (&Vec<PointId>, &usize)| {
            let slots = edges(polygon).enumerate().map(|(i, (a, b))| {
                let slots = [i, (i + 1) % polygon.len()].map(|corner| (first + corner) as u32);
                let slots = if a < b { slots } else { [slots[1], slots[0]] };
                (sorted((a, b)), slots)
            });
            slots.filter(|(edge, _)| !self.contact_edges.contains(edge)).collect::<SmallVec<[_; 4]>>()
        };
        let polygons = self.polygons.par_iter().zip(&slot_of).with_min_len(AT_ONCE);
        let mut at_edges: Vec<((PointId, PointId), [u32; 2])> = polygons.flat_map_iter(of_polygon).collect();
        at_edges.par_sort_unstable();
        let mut joined = DisjointSets::new(count);
        for same in at_edges.chunk_by(|one, other| one.0 == other.0) {
            let [first, second] = same[0].1;
            for (_, slots) in &same[1..] {
                joined.join(slots[0] as usize, first as usize);
                joined.join(slots[1] as usize, second as usize);
            }
        }
        let mut vertex_of: Vec<Option<VertexId>> = vec![None; count];
        let mut vertices = Vec::with_capacity(self.points.len());
        let mut polygons = Vec::with_capacity(self.polygons.len());
        for (polygon, first) in self.polygons.iter().zip(&slot_of) {
            let corners = polygon.iter().enumerate().map(|(i, point)| {
                *vertex_of[joined.representative(first + i)].get_or_insert_with(|| {
                    vertices.push(self.points[*point as usize]);
                    VertexId(vertices.len() as u32 - 1)
                })
            });
            polygons.push(corners.collect());
        }
        Welded { vertices, polygons }
    }

    fn insert_t_vertices(&mut self) {
        let points = &self.points;
        let sort = |(group, ids): (&SmoothingGroup, &Vec<PointId>)| {
            let axis =
                Bounds::around(ids.iter().map(|id| points[*id as usize].position)).extent().max_position();
            let mut along: Vec<_> = ids.iter().map(|id| (points[*id as usize].position[axis], *id)).collect();
            along.sort_by(|a, b| a.0.total_cmp(&b.0));
            (*group, (axis, along))
        };
        let several = self.flat.iter().filter(|(_, ids)| ids.len() > 2);
        let sorted: HashMap<SmoothingGroup, (usize, Vec<(f64, PointId)>)> = several.map(sort).collect();
        self.polygons.par_iter_mut().with_min_len(AT_ONCE).for_each(|polygon| {
            let mut corners = Vec::with_capacity(polygon.len());
            for (from, to) in edges(polygon) {
                corners.push(from);
                let group = self.groups[from as usize];
                if group == self.groups[to as usize]
                    && let Some((axis, along)) = sorted.get(&group)
                {
                    corners.extend(points_between(points, from, to, *axis, along));
                }
            }
            *polygon = corners;
        });
    }
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
