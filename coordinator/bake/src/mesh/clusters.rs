//! Clusters of leaves in small things, over which light hardly varies.

use glam::DVec3;
use rayon::prelude::*;

use super::{Mesh, PatchId, VertexId};

/// Facets at one place by which clusters grow, at most: thousands may meet in the middle of a disc.
const MOST_TOUCHING: usize = 64;

/// How far the leaves of a cluster may be apart.
#[derive(Debug, Clone, Copy)]
pub struct ClusterLimits {
    /// Longest leaf, and width of a cluster, in frame units.
    pub width: f64,
    /// Largest angle between the normals of a cluster's first leaf and of any other, in radians.
    pub angle: f64,
}

/// The leaf in the middle of the cluster of each leaf, by patch. None for leaves that are not small, have a smooth normal, lie under an
/// edge that hovers, or have a corner in common with another one.
///
/// Clusters grow from leaf to leaf of a surface where their corners touch: what only lies close by may be hidden, as the pages of a book
/// are.
pub fn clusters(mesh: &Mesh, limits: ClusterLimits) -> Vec<Option<PatchId>> {
    let mut is_free = lone_small_leaves(mesh, limits.width);
    let touching = Touching::new(mesh, &is_free);
    let least_cosine = limits.angle.cos();
    let mut middles = vec![None; is_free.len()];
    let mut members: Vec<PatchId> = vec![];
    for first in 0..is_free.len() {
        if !std::mem::take(&mut is_free[first]) {
            continue;
        }
        let first = PatchId(first as u32);
        let (centre, normal) = (mesh.centre(first), normal(mesh, first));
        let is_alike = |leaf: PatchId| {
            let near = limits.width / 2.0;
            mesh.centre(leaf).distance(centre) <= near && self::normal(mesh, leaf).dot(normal) >= least_cosine
        };
        members.push(first);
        let mut next = 0;
        while let Some(leaf) = members.get(next).copied() {
            for near in mesh.patch(leaf).corners.iter().flat_map(|corner| touching.of(*corner)) {
                if is_free[near.index()] && is_alike(near) {
                    is_free[near.index()] = false;
                    members.push(near);
                }
            }
            next += 1;
        }
        let mean = members.iter().map(|leaf| mesh.centre(*leaf)).sum::<DVec3>() / members.len() as f64;
        let distance = |leaf: &PatchId| mesh.centre(*leaf).distance_squared(mean);
        let middle = members.iter().copied().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        members.drain(..).for_each(|leaf| middles[leaf.index()] = middle);
    }
    middles
}

/// The normal of a flat leaf.
fn normal(mesh: &Mesh, leaf: PatchId) -> DVec3 {
    mesh.vertices[mesh.patch(leaf).corners[0].index()].normal
}

/// Whether each patch is a leaf no longer than this, flat, under no edge that hovers, and has all of its corners for itself.
fn lone_small_leaves(mesh: &Mesh, longest: f64) -> Vec<bool> {
    let mut leaves_around = vec![0_u32; mesh.vertices.len()];
    for (_, patch) in mesh.leaves() {
        patch.corners.iter().for_each(|corner| leaves_around[corner.index()] += 1);
    }
    let is_lone = |corner: &VertexId| {
        let vertex = &mesh.vertices[corner.index()];
        leaves_around[corner.index()] == 1 && !vertex.smooth && vertex.hovering.is_none()
    };
    let is_small = |index| {
        let id = PatchId(index as u32);
        let patch = mesh.patch(id);
        patch.first_child.is_none() && patch.corners.iter().all(is_lone) && mesh.size(id) <= longest
    };
    (0..mesh.patches.len()).into_par_iter().with_min_len(1024).map(is_small).collect()
}

/// A surface, and the bits of a place on it.
type Place = (u32, [u64; 3]);

/// Leaves with a corner at one place of one surface.
struct Touching {
    by_place: Vec<(Place, PatchId)>,
    /// Where those at the place of each vertex begin, and where they end.
    of_vertices: Vec<[u32; 2]>,
}

impl Touching {
    /// Those of some leaves.
    fn new(mesh: &Mesh, is_member: &[bool]) -> Self {
        let corners = |index: usize| {
            let leaf = PatchId(index as u32);
            let patch = mesh.patch(leaf);
            patch.corners.iter().map(move |corner| {
                let bits = mesh.position(*corner).to_array().map(f64::to_bits);
                (((patch.surface, bits), leaf), *corner)
            })
        };
        let members = (0..is_member.len()).into_par_iter().with_min_len(1024).filter(|leaf| is_member[*leaf]);
        let mut all: Vec<((Place, PatchId), VertexId)> = members.flat_map_iter(corners).collect();
        all.par_sort_unstable();
        let mut of_vertices = vec![[0; 2]; mesh.vertices.len()];
        let mut start = 0;
        for same in all.chunk_by(|((one, _), _), ((other, _), _)| one == other) {
            let end = start + same.len();
            // Two of one plane are lit and hidden: a contact runs between them.
            let is_divided = || {
                let plane = |(_, corner): &(_, VertexId)| mesh.vertices[corner.index()].plane;
                same.iter().enumerate().any(|(at, one)| same[..at].iter().any(|two| plane(one) == plane(two)))
            };
            if same.len() <= MOST_TOUCHING && !is_divided() {
                same.iter().for_each(|(_, corner)| of_vertices[corner.index()] = [start as u32, end as u32]);
            }
            start = end;
        }
        Self { by_place: all.into_iter().map(|(at, _)| at).collect(), of_vertices }
    }

    /// The leaves at the place of a vertex.
    fn of(&self, vertex: VertexId) -> impl Iterator<Item = PatchId> + '_ {
        let [start, end] = self.of_vertices[vertex.index()].map(|at| at as usize);
        self.by_place[start..end].iter().map(|(_, leaf)| *leaf)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{facet, scene};
    use scene::Facet;

    const EXTENT: f64 = 1000.0;
    const LIMITS: ClusterLimits = ClusterLimits { width: 4.0, angle: 0.3 };

    /// Half of a roof whose ridge is 1 long, on its left or its right.
    fn half(plane: u32, slope: f64, is_left: bool) -> Facet {
        let eaves = [if is_left { -slope.cos() } else { slope.cos() }, -slope.sin(), 0.5];
        let ridge = if is_left { [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]] } else { [[0.0; 3], [0.0, 0.0, 1.0]] };
        facet(plane, &[ridge[0], ridge[1], eaves])
    }

    /// Number of clusters.
    fn count(surfaces: Vec<Vec<Facet>>, limits: ClusterLimits) -> usize {
        let mesh = Mesh::new(&scene(surfaces, vec![]), EXTENT, EXTENT, 0, &[]);
        let mut middles: Vec<PatchId> = clusters(&mesh, limits).into_iter().flatten().collect();
        middles.sort_unstable();
        middles.dedup();
        middles.len()
    }

    #[test]
    fn halves_of_a_flat_roof_are_one_cluster_and_those_of_a_steep_one_two() {
        let roof = |slope| vec![vec![half(0, slope, true), half(1, slope, false)]];
        assert!(roof(0.1)[0].iter().all(|half| half.normal.y > 0.9));
        assert_eq!(count(roof(0.1), LIMITS), 1);
        assert_eq!(count(roof(0.2), LIMITS), 2, "the halves are .4 apart");
        assert_eq!(
            count(roof(0.1), ClusterLimits { width: 1.3, ..LIMITS }),
            2,
            "their centres are .66 apart"
        );
        assert_eq!(count(roof(0.1), ClusterLimits { width: 0.9, ..LIMITS }), 0, "they are longer");
    }

    #[test]
    fn what_only_lies_close_by_is_a_cluster_of_its_own() {
        let [one, other] = [half(0, 0.1, true), half(1, 0.1, false)];
        assert_eq!(count(vec![vec![one.clone()], vec![other]], LIMITS), 2, "of another surface");
        let page = facet(2, &[[0.0, 0.1, 1.0], [0.0, 0.1, 0.0], [-1.0, 0.0, 0.5]]);
        assert_eq!(count(vec![vec![one, page]], LIMITS), 2, "one lies under the other");
    }

    #[test]
    fn leaves_with_an_edge_in_common_have_vertices_that_stay_apart() {
        let flat = vec![half(0, 0.0, true), half(0, 0.0, false)];
        assert_eq!(count(vec![flat], LIMITS), 0);
    }

    /// The two sides of a contact lie in one plane, and one of them is hidden.
    #[test]
    fn clusters_do_not_grow_where_two_leaves_lie_in_one_plane() {
        let [one, other] = [half(0, 0.0, true), half(0, 0.0, false)];
        let apart = |facet: &Facet| {
            let mesh = Mesh::new(&scene(vec![vec![facet.clone()]], vec![]), EXTENT, EXTENT, 0, &[]);
            (mesh.vertices, mesh.patches)
        };
        // As welding leaves them beside a contact: with vertices of their own.
        let mut mesh = Mesh::default();
        for facet in [&one, &other] {
            let (vertices, mut patches) = apart(facet);
            let before = mesh.vertices.len() as u32;
            patches.iter_mut().flat_map(|patch| &mut patch.corners).for_each(|corner| corner.0 += before);
            mesh.vertices.extend(vertices);
            mesh.patches.extend(patches);
        }
        let middles = clusters(&mesh, LIMITS);
        assert_eq!(middles, [Some(PatchId(0)), Some(PatchId(1))]);
    }
}
