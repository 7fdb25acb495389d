use std::collections::{BTreeMap, HashMap};

use glam::DVec3;
use shared::geometry::{PlaneId, area_vector};
use smallvec::SmallVec;

use super::{Mesh, Patch, PatchId, Vertex, VertexId, edge};
use crate::scene::{Corner, Facet, Scene};

/// Positions closer than this, in frame units, are one vertex; a vertex this close to an edge lies on it. The frame is 1024
/// to 2048 units long, where f32 coordinates of the input are 6e-5 to 1.2e-4 apart.
const WELD: f64 = 2e-4;

/// Facets more elongated than this are cut across before they are divided about their centre, which keeps proportions.
const LONGEST_PROPORTION: f64 = 2.0;

/// Which vertices of one position are the same: those of one plane and direction, or of one smooth normal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
enum SmoothingGroup {
    Flat(PlaneId, bool),
    Smooth([i32; 3]),
}

/// A facet or a piece of one.
struct Piece {
    surface: u32,
    facet: u32,
    corners: Vec<Corner>,
}

impl Mesh {
    /// The mesh of a scene's facets, divided until no edge is longer than `longest_edge` (in frame units), but no more than
    /// `max_level` times.
    #[must_use]
    pub fn new(scene: &Scene, longest_edge: f64, max_level: u32) -> Self {
        let mut mesh = Self::default();
        let mut welder = Welder::default();
        let mut pieces = vec![];
        for (surface_index, surface) in scene.surfaces.iter().enumerate() {
            for (facet_index, facet) in surface.facets.iter().enumerate() {
                let place = (surface_index as u32, facet_index as u32);
                cut_long(facet.corners.clone(), facet.normal, longest_edge, &mut |corners| {
                    pieces.push(Piece { surface: place.0, facet: place.1, corners });
                });
            }
        }
        let mut polygons: Vec<Vec<VertexId>> = pieces
            .iter()
            .map(|piece| {
                let facet = facet_of(scene, piece);
                let mut ids: Vec<VertexId> =
                    piece.corners.iter().map(|corner| welder.vertex(&mut mesh, corner, facet)).collect();
                ids.dedup();
                if ids.len() > 1 && ids.first() == ids.last() {
                    ids.pop();
                }
                ids
            })
            .collect();
        welder.insert_t_vertices(&mesh, &mut polygons);
        for (piece, ids) in pieces.iter().zip(polygons) {
            // Welding can leave nothing of a piece that is smaller than the tolerance.
            if ids.len() >= 3 {
                mesh.add_leaf(piece.surface, piece.facet, ids.into(), None);
            }
        }
        mesh.divide_longer_than(longest_edge, max_level);
        mesh
    }

    fn divide_longer_than(&mut self, longest_edge: f64, max_level: u32) {
        for _ in 0..max_level {
            let long: Vec<PatchId> =
                self.leaves().map(|(id, _)| id).filter(|id| self.longest_edge(*id) > longest_edge).collect();
            if long.is_empty() {
                break;
            }
            for id in long {
                self.divide(id);
            }
        }
    }

    pub(super) fn add_leaf(
        &mut self,
        surface: u32,
        facet: u32,
        corners: SmallVec<[VertexId; 4]>,
        parent: Option<PatchId>,
    ) -> PatchId {
        let id = PatchId(self.patches.len() as u32);
        let positions: SmallVec<[DVec3; 8]> = corners.iter().map(|corner| self.position(*corner)).collect();
        let area = area_vector(&positions).length();
        self.patches.push(Patch { surface, facet, corners, first_child: None, parent, area });
        let edges: SmallVec<[_; 8]> = self.edges(id).map(|(a, b)| edge(a, b)).collect();
        for edge in edges {
            self.leaves_at.entry(edge).or_default().push(id);
        }
        id
    }
}

fn facet_of<'a>(scene: &'a Scene, piece: &Piece) -> &'a Facet {
    &scene.surfaces[piece.surface as usize].facets[piece.facet as usize]
}

/// Cuts a convex polygon across its longest extent until it is short or of fair proportions.
fn cut_long(corners: Vec<Corner>, normal: DVec3, longest_edge: f64, done: &mut impl FnMut(Vec<Corner>)) {
    let pairs = corners.iter().enumerate().flat_map(|(i, a)| corners[i + 1..].iter().map(move |b| (a, b)));
    let span = pairs.map(|(a, b)| b.position - a.position).fold(DVec3::ZERO, |longest, span| {
        if span.length_squared() > longest.length_squared() { span } else { longest }
    });
    let length = span.length();
    let positions: Vec<DVec3> = corners.iter().map(|corner| corner.position).collect();
    let area = area_vector(&positions).length();
    // Along the longest edge rather than the diagonal, so that rectangles are cut into rectangles.
    let direction = longest_side(&positions).normalize_or_zero();
    if length <= longest_edge || length * length <= LONGEST_PROPORTION * area || direction == DVec3::ZERO {
        done(corners);
        return;
    }
    let along: Vec<f64> = positions.iter().map(|position| direction.dot(*position)).collect();
    let (low, high) = along.iter().fold((f64::MAX, f64::MIN), |(low, high), s| (low.min(*s), high.max(*s)));
    let breadth = area / (high - low);
    if high - low <= LONGEST_PROPORTION * breadth {
        done(corners);
        return;
    }
    let middle = (low + high) / 2.0;
    let [below, above] = [-1.0, 1.0].map(|sign: f64| half(&corners, &along, middle, sign, normal));
    cut_long(below, normal, longest_edge, done);
    cut_long(above, normal, longest_edge, done);
}

fn longest_side(positions: &[DVec3]) -> DVec3 {
    let next = positions.iter().cycle().skip(1);
    positions.iter().zip(next).map(|(a, b)| *b - *a).fold(DVec3::ZERO, |longest, side| {
        if side.length_squared() > longest.length_squared() { side } else { longest }
    })
}

/// The corners on one side of a cut; new corners on the cut take the mean of normals.
fn half(corners: &[Corner], along: &[f64], middle: f64, sign: f64, facet_normal: DVec3) -> Vec<Corner> {
    let mut kept = vec![];
    for (i, corner) in corners.iter().enumerate() {
        let next = (i + 1) % corners.len();
        let (here, there) = (sign * (along[i] - middle), sign * (along[next] - middle));
        if here >= 0.0 {
            kept.push(*corner);
        }
        if (here > 0.0 && there < 0.0) || (here < 0.0 && there > 0.0) {
            // From the lower to the higher end, so that both halves get the same bits.
            let (a, b) = if along[i] < along[next] { (i, next) } else { (next, i) };
            let t = (middle - along[a]) / (along[b] - along[a]);
            let flat = corners[a].normal == facet_normal && corners[b].normal == facet_normal;
            let normal = corners[a].normal.lerp(corners[b].normal, t);
            kept.push(Corner {
                position: corners[a].position.lerp(corners[b].position, t),
                normal: if flat { facet_normal } else { normal.normalize_or(facet_normal) },
            });
        }
    }
    kept
}

/// Finds the vertex of a corner.
#[derive(Default)]
struct Welder {
    vertices: HashMap<([i64; 3], SmoothingGroup), VertexId>,
    flat: BTreeMap<SmoothingGroup, Vec<VertexId>>,
    groups: Vec<SmoothingGroup>,
}

impl Welder {
    fn vertex(&mut self, mesh: &mut Mesh, corner: &Corner, facet: &Facet) -> VertexId {
        let smooth = corner.normal != facet.normal;
        let group = if smooth {
            SmoothingGroup::Smooth((corner.normal * 1e6).round().as_ivec3().to_array())
        } else {
            let leading = facet.normal.to_array().into_iter().find(|value| value.abs() > 0.5).unwrap_or(0.0);
            SmoothingGroup::Flat(facet.plane, leading > 0.0)
        };
        let cell = (corner.position / WELD).round().as_i64vec3().to_array();
        *self.vertices.entry((cell, group)).or_insert_with(|| {
            let id = VertexId(mesh.vertices.len() as u32);
            mesh.vertices.push(Vertex {
                position: corner.position,
                normal: corner.normal,
                plane: facet.plane,
                smooth,
            });
            self.groups.push(group);
            if !smooth {
                self.flat.entry(group).or_default().push(id);
            }
            id
        })
    }

    /// Makes every vertex that lies on an edge of its own plane a corner there: both sides of the edge then divide it alike.
    fn insert_t_vertices(&mut self, mesh: &Mesh, polygons: &mut [Vec<VertexId>]) {
        let sorted: BTreeMap<SmoothingGroup, (usize, Vec<(f64, VertexId)>)> = self
            .flat
            .iter()
            .map(|(group, ids)| {
                let positions = ids.iter().map(|id| mesh.position(*id));
                let low = positions.clone().fold(DVec3::MAX, DVec3::min);
                let high = positions.fold(DVec3::MIN, DVec3::max);
                let axis = (high - low).max_position();
                let mut along: Vec<_> = ids.iter().map(|id| (mesh.position(*id)[axis], *id)).collect();
                along.sort_by(|a, b| a.0.total_cmp(&b.0));
                (*group, (axis, along))
            })
            .collect();
        for polygon in polygons {
            let mut corners = vec![];
            for (i, &from) in polygon.iter().enumerate() {
                let to = polygon[(i + 1) % polygon.len()];
                corners.push(from);
                let group = self.groups[from.index()];
                if group == self.groups[to.index()]
                    && let Some((axis, along)) = sorted.get(&group)
                {
                    corners.extend(vertices_between(mesh, from, to, *axis, along));
                }
            }
            *polygon = corners;
        }
    }
}

/// Vertices inside an edge, in order from its start.
fn vertices_between(
    mesh: &Mesh,
    from: VertexId,
    to: VertexId,
    axis: usize,
    along: &[(f64, VertexId)],
) -> impl Iterator<Item = VertexId> + use<> {
    let (start, end) = (mesh.position(from), mesh.position(to));
    let span = end - start;
    let length = span.length();
    let (low, high) = (start[axis].min(end[axis]) - WELD, start[axis].max(end[axis]) + WELD);
    let first = along.partition_point(|(value, _)| *value < low);
    let mut inside: Vec<(f64, VertexId)> = along[first..]
        .iter()
        .take_while(|(value, _)| *value <= high)
        .filter(|(_, id)| *id != from && *id != to)
        .filter_map(|(_, id)| {
            let offset = mesh.position(*id) - start;
            let distance = offset.dot(span) / length;
            let beside = (offset - span * (distance / length)).length();
            (beside < WELD && distance > WELD && distance < length - WELD).then_some((distance, *id))
        })
        .collect();
    inside.sort_by(|a, b| a.0.total_cmp(&b.0));
    inside.into_iter().map(|(_, id)| id)
}
