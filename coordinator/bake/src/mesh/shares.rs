use glam::DVec3;
use kernel::geometry::{ConvexPolygon, area_vector};
use rayon::prelude::*;
use scene::Scene;
use smallvec::SmallVec;

use super::{Mesh, Patch, PatchId, VertexId};

/// Leaves whose surroundings are added up at a time.
const AT_ONCE: usize = 1 << 14;

/// The surface represented by a vertex: its corner quadrilaterals of the leaves around it, or what it was on another mesh.
#[derive(Debug, Clone)]
pub struct Share {
    /// The vertex, or the one nearest to it.
    pub vertex: VertexId,
    /// Surface that the share lies on; a vertex between two surfaces has a share on each.
    pub surface: u32,
    /// The quadrilaterals, joined where that gives a convex polygon; none where the share is a leaf that needs no row.
    pub polygons: Vec<ConvexPolygon>,
    /// Its leaves, with the vertex's corner in each.
    pub corners: Vec<(PatchId, usize)>,
    /// Leaves that a polygon covers or has a part of, with the index of the polygon: instead of corners, where the share was made
    /// on another mesh.
    pub overlaps: Vec<(PatchId, usize)>,
    /// Total area.
    pub area: f64,
}

impl Share {
    /// The leaf that it is the whole of.
    #[must_use]
    pub fn whole_leaf(&self, mesh: &Mesh) -> Option<PatchId> {
        let (id, _) = *self.corners.first()?;
        let patch = mesh.patch(id);
        let is_whole = patch.first_child.is_none() && self.corners.len() == patch.corners.len();
        (is_whole && self.corners.iter().all(|corner| corner.0 == id)).then_some(id)
    }
}

impl Mesh {
    /// Each leaf as a share, in their order, without its polygon.
    #[must_use]
    pub fn leaf_shares(&self) -> Vec<Share> {
        let share = |(id, patch): (PatchId, &Patch)| Share {
            vertex: patch.corners[0],
            surface: patch.surface,
            polygons: vec![],
            corners: (0..patch.corners.len()).map(|corner| (id, corner)).collect(),
            overlaps: vec![],
            area: patch.area,
        };
        self.leaves().map(share).collect()
    }

    /// Divides the leaves among their vertices, in the order of vertices and surfaces. The shares tile the mesh.
    #[must_use]
    pub fn shares(&self, scene: &Scene) -> Vec<Share> {
        let mut corners: Vec<(VertexId, u32, PatchId, usize)> = vec![];
        for (id, patch) in self.leaves() {
            corners
                .extend(patch.corners.iter().enumerate().map(|(i, vertex)| (*vertex, patch.surface, id, i)));
        }
        corners.sort_unstable();
        corners
            .chunk_by(|a, b| (a.0, a.1) == (b.0, b.1))
            .map(|own| {
                let quads: Vec<ConvexPolygon> = own
                    .iter()
                    .map(|&(_, surface, id, corner)| ConvexPolygon {
                        plane: scene.plane(surface, self.patch(id).facet),
                        corners: self.corner_quad(id, corner).to_vec(),
                    })
                    .collect();
                Share {
                    vertex: own[0].0,
                    surface: own[0].1,
                    area: quads.iter().map(ConvexPolygon::area).sum(),
                    polygons: join(quads),
                    corners: own.iter().map(|&(_, _, id, corner)| (id, corner)).collect(),
                    overlaps: vec![],
                }
            })
            .collect()
    }

    /// The part of a patch that belongs to one of its corners: corner, middle of the next edge, centroid, middle of the edge
    /// before.
    #[must_use]
    pub fn corner_quad(&self, id: PatchId, corner: usize) -> [DVec3; 4] {
        let corners = &self.patch(id).corners;
        let at = |i: usize| self.position(corners[i % corners.len()]);
        let (here, next, before) = (at(corner), at(corner + 1), at(corner + corners.len() - 1));
        [here, (here + next) * 0.5, self.centre(id), (here + before) * 0.5]
    }
}

/// The surface around a vertex: the parts of leaves that belong to it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Surroundings {
    /// Mean of all directions from the vertex into the surface, about as long as the parts are wide. Unlike the direction to their
    /// centroid it points into the surface at concave corners too, and vanishes inside every mesh, however irregular.
    pub inward: DVec3,
    /// Area of the parts.
    pub area: f64,
}

/// The surroundings of each vertex from `first` on.
#[must_use]
pub fn surroundings(mesh: &Mesh, first: VertexId) -> Vec<Surroundings> {
    let mut all = vec![Surroundings::default(); mesh.vertices.len() - first.index()];
    let leaves: Vec<PatchId> = mesh.leaves().map(|(id, _)| id).collect();
    let of_leaf = |id: &PatchId| -> SmallVec<[(usize, Surroundings); 4]> {
        let corners = mesh.patch(*id).corners.iter().enumerate();
        let own = corners.filter_map(|(i, vertex)| {
            let index = vertex.index().checked_sub(first.index())?;
            let quad = mesh.corner_quad(*id, i);
            let [next, centre, before] = [1, 2, 3].map(|k| (quad[k] - quad[0]).normalize_or_zero());
            // In two parts, since the corner of a patch may be straight.
            let inward = direction_integral(next, centre) + direction_integral(centre, before);
            Some((index, Surroundings { inward, area: area_vector(&quad).length() }))
        });
        own.collect()
    };
    for some in leaves.chunks(AT_ONCE) {
        let own: Vec<_> = some.par_iter().with_min_len(256).map(of_leaf).collect();
        for (index, part) in own.into_iter().flatten() {
            all[index].inward += part.inward;
            all[index].area += part.area;
        }
    }
    for around in &mut all {
        around.inward *= around.area.sqrt() / 2.0;
    }
    all
}

/// Integral of the unit vectors between two, over the angle between them: 2 sin(angle / 2) along the middle.
fn direction_integral(from: DVec3, to: DVec3) -> DVec3 {
    let cosine = from.dot(to);
    // Opposite directions, or none: the parts of a patch are never that wide unless they have no area.
    if cosine < -1.0 + 1e-12 {
        return DVec3::ZERO;
    }
    let half_tangent = from.cross(to).length() / (1.0 + cosine);
    (from + to) * half_tangent
}

/// Joins polygons along common edges where the union is convex: fewer polygons make cheaper rows.
fn join(mut polygons: Vec<ConvexPolygon>) -> Vec<ConvexPolygon> {
    'search: loop {
        for i in 0..polygons.len() {
            for j in i + 1..polygons.len() {
                if let Some(union) = convex_union(&polygons[i], &polygons[j]) {
                    polygons[i] = union;
                    polygons.swap_remove(j);
                    continue 'search;
                }
            }
        }
        return polygons;
    }
}

/// Two polygons that share more than one edge leave a way there and back in their union.
fn remove_spikes(corners: &mut Vec<DVec3>) {
    let tip = |corners: &[DVec3]| {
        let count = corners.len();
        (0..count).find(|k| count > 2 && corners[(k + count - 1) % count] == corners[(k + 1) % count])
    };
    while let Some(k) = tip(corners) {
        let next = (k + 1) % corners.len();
        corners.remove(k.max(next));
        corners.remove(k.min(next));
    }
}

/// The union of two polygons of one plane with a common edge, if it is convex.
fn convex_union(a: &ConvexPolygon, b: &ConvexPolygon) -> Option<ConvexPolygon> {
    if a.plane != b.plane {
        return None;
    }
    let (n, m) = (a.corners.len(), b.corners.len());
    let (i, j) = (0..n)
        .flat_map(|i| (0..m).map(move |j| (i, j)))
        .find(|&(i, j)| a.corners[i] == b.corners[(j + 1) % m] && a.corners[(i + 1) % n] == b.corners[j])?;
    let from_a = (1..=n).map(|k| a.corners[(i + k) % n]);
    let from_b = (2..m).map(|k| b.corners[(j + k) % m]);
    let mut corners: Vec<DVec3> = from_a.chain(from_b).collect();
    remove_spikes(&mut corners);
    let normal = area_vector(&corners);
    let count = corners.len();
    let turn = |k: usize| {
        let (before, here, next) = (corners[(k + count - 1) % count], corners[k], corners[(k + 1) % count]);
        let (along, onward) = (here - before, next - here);
        along.cross(onward).dot(normal) / (normal.length() * along.length() * onward.length())
    };
    // A hair of concavity is rounding; a larger one would bend the contour.
    let turns: Vec<f64> = (0..count).map(turn).collect();
    if !turns.iter().all(|turn| *turn >= -1e-9) {
        return None;
    }
    let kept = corners.iter().zip(&turns).filter(|(_, turn)| **turn > 1e-9).map(|(corner, _)| *corner);
    Some(ConvexPolygon { plane: a.plane, corners: kept.collect() }).filter(|union| union.corners.len() >= 3)
}
