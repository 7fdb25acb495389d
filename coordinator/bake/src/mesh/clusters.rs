//! Clusters of vertices in small things, over which light hardly varies.

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::{Mesh, PatchId, Vertex, VertexId};

/// How far the vertices of a cluster may be apart.
#[derive(Debug, Clone, Copy)]
pub struct Alike {
    /// Longest leaf that is small, and width of a cluster, in frame units.
    pub size: f64,
    /// Largest angle between the normals of a cluster's first vertex and of any other, in radians.
    pub turn: f64,
}

/// The middle of a cluster.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Middle {
    /// The leaf that is the nearest to it,
    pub leaf: PatchId,
    /// and a corner of it that is in the cluster.
    pub corner: VertexId,
}

/// The middle of the cluster of each vertex; clusters with the same leaf in their middle are one. None for vertices that have a smooth normal, lie under an edge that hovers, or have a leaf
/// that is not small.
///
/// Clusters grow along leaves, and from leaf to leaf of a surface where their corners touch: what only lies close by may be hidden, as
/// the pages of a book are.
pub fn clusters(mesh: &Mesh, alike: Alike) -> Vec<Option<Middle>> {
    let around = LeavesAround::new(mesh);
    let is_small = small_leaves(mesh, alike.size);
    let is_member = |(index, vertex): (usize, &Vertex)| {
        let mut leaves = around.of(VertexId(index as u32));
        !vertex.smooth && vertex.hovering.is_none() && leaves.all(|leaf| is_small[leaf.index()])
    };
    let mut is_free: Vec<bool> = mesh.vertices.iter().enumerate().map(is_member).collect();
    let touching = Touching::new(mesh, &around, &is_free);
    let mut of_vertices = vec![None; is_free.len()];
    let mut members = vec![];
    for first in 0..is_free.len() {
        if !std::mem::take(&mut is_free[first]) {
            continue;
        }
        let start = mesh.vertices[first];
        let is_alike = |vertex: VertexId| {
            let other = mesh.vertices[vertex.index()];
            other.position.distance(start.position) <= alike.size / 2.0
                && other.normal.dot(start.normal) >= alike.turn.cos()
        };
        members.push(VertexId(first as u32));
        let mut next = 0;
        while let Some(vertex) = members.get(next).copied() {
            let corners = around.of(vertex).flat_map(|leaf| mesh.patch(leaf).corners.iter().copied());
            for near in corners.chain(touching.of(vertex)) {
                if is_free[near.index()] && is_alike(near) {
                    is_free[near.index()] = false;
                    members.push(near);
                }
            }
            next += 1;
        }
        let middle = middle(mesh, &around, &members);
        members.drain(..).for_each(|member| of_vertices[member.index()] = middle);
    }
    of_vertices
}

/// The middle of a cluster.
fn middle(mesh: &Mesh, around: &LeavesAround, members: &[VertexId]) -> Option<Middle> {
    let of_member = |corner: VertexId| around.of(corner).map(move |leaf| Middle { leaf, corner });
    let all = || members.iter().copied().flat_map(of_member);
    let sum: DVec3 = all().map(|middle| mesh.centre(middle.leaf)).sum();
    let mean = sum / all().count() as f64;
    let distance = |middle: &Middle| mesh.centre(middle.leaf).distance_squared(mean);
    all().min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

fn small_leaves(mesh: &Mesh, size: f64) -> Vec<bool> {
    let is_small = |index| {
        let id = PatchId(index as u32);
        mesh.patch(id).first_child.is_none() && mesh.size(id) <= size
    };
    (0..mesh.patches.len()).into_par_iter().with_min_len(1024).map(is_small).collect()
}

/// The leaves around each vertex.
struct LeavesAround {
    /// Offsets into `leaves`: one per vertex, and the end.
    starts: Vec<u32>,
    leaves: Vec<PatchId>,
}

impl LeavesAround {
    fn new(mesh: &Mesh) -> Self {
        let mut starts = vec![0; mesh.vertices.len() + 1];
        let corners = || mesh.leaves().flat_map(|(id, patch)| patch.corners.iter().map(move |at| (id, at)));
        corners().for_each(|(_, corner)| starts[corner.index() + 1] += 1);
        for vertex in 0..mesh.vertices.len() {
            starts[vertex + 1] += starts[vertex];
        }
        let mut next = starts.clone();
        let mut leaves = vec![PatchId(0); starts[mesh.vertices.len()] as usize];
        for (id, corner) in corners() {
            leaves[next[corner.index()] as usize] = id;
            next[corner.index()] += 1;
        }
        Self { starts, leaves }
    }

    fn of(&self, vertex: VertexId) -> impl Iterator<Item = PatchId> + '_ {
        let [start, end] = [0, 1].map(|next| self.starts[vertex.index() + next] as usize);
        self.leaves[start..end].iter().copied()
    }
}

/// Vertices at one place that each is compared with, before and after it: thousands may meet in the middle of a disc.
const MOST_BESIDE: usize = 16;

/// A surface, and the bits of a place on it.
type Place = (u32, [u64; 3]);

/// Vertices at one place of one surface: facets at a crease have separate ones.
struct Touching {
    by_place: Vec<(Place, VertexId)>,
    /// Index into `by_place` of each vertex, where it is there.
    at: Vec<Option<u32>>,
}

impl Touching {
    /// Those of some vertices.
    fn new(mesh: &Mesh, around: &LeavesAround, is_member: &[bool]) -> Self {
        let place = |vertex: usize| {
            let id = VertexId(vertex as u32);
            let leaf = around.of(id).next().filter(|_| is_member[vertex])?;
            Some(((mesh.patch(leaf).surface, mesh.position(id).to_array().map(f64::to_bits)), id))
        };
        let mut by_place: Vec<_> = (0..is_member.len()).into_par_iter().filter_map(place).collect();
        by_place.par_sort_unstable();
        let mut at = vec![None; is_member.len()];
        for (index, (_, vertex)) in by_place.iter().enumerate() {
            at[vertex.index()] = Some(index as u32);
        }
        Self { by_place, at }
    }

    /// The vertices next to a vertex in the order of its place.
    fn of(&self, vertex: VertexId) -> impl Iterator<Item = VertexId> + '_ {
        let at = self.at[vertex.index()].map_or(0..0, |at| self.range(at as usize));
        self.by_place[at].iter().map(|(_, vertex)| *vertex)
    }

    fn range(&self, index: usize) -> Range<usize> {
        let is_same = |(place, _): &&(Place, VertexId)| *place == self.by_place[index].0;
        let before = self.by_place[..index].iter().rev().take(MOST_BESIDE).take_while(is_same).count();
        let after = self.by_place[index..].iter().take(MOST_BESIDE).take_while(is_same).count();
        index - before..index + after
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{facet, scene};
    use scene::Facet;

    const EXTENT: f64 = 1000.0;
    const ALIKE: Alike = Alike { size: 4.0, turn: 0.3 };

    /// Half of a roof whose ridge is 1 long, on its left or its right.
    fn half(plane: u32, slope: f64, is_left: bool) -> Facet {
        let eaves = [if is_left { -slope.cos() } else { slope.cos() }, -slope.sin(), 0.5];
        let ridge = if is_left { [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]] } else { [[0.0; 3], [0.0, 0.0, 1.0]] };
        facet(plane, &[ridge[0], ridge[1], eaves])
    }

    /// Leaves in the middle of clusters.
    fn middles(surfaces: Vec<Vec<Facet>>) -> Vec<PatchId> {
        let mesh = Mesh::new(&scene(surfaces, vec![]), EXTENT, EXTENT, 0, &[]);
        let mut all: Vec<PatchId> =
            clusters(&mesh, ALIKE).iter().flatten().map(|middle| middle.leaf).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    #[test]
    fn halves_of_a_flat_roof_are_one_cluster_and_those_of_a_steep_one_two() {
        let roof = |slope| vec![half(0, slope, true), half(1, slope, false)];
        assert!(roof(0.1).iter().all(|half| half.normal.y > 0.9));
        assert_eq!(middles(vec![roof(0.1)]).len(), 1);
        assert_eq!(middles(vec![roof(0.2)]).len(), 2, "the halves are .4 apart");
    }

    #[test]
    fn what_only_lies_close_by_is_a_cluster_of_its_own() {
        let [one, other] = [half(0, 0.1, true), half(1, 0.1, false)];
        assert_eq!(middles(vec![vec![one.clone()], vec![other]]).len(), 2, "of another surface");
        let page = facet(2, &[[0.0, 0.1, 1.0], [0.0, 0.1, 0.0], [-1.0, 0.0, 0.5]]);
        assert_eq!(middles(vec![vec![one, page]]).len(), 2, "one lies under the other");
    }

    #[test]
    fn large_leaves_have_none() {
        let large = facet(0, &[[0.0; 3], [0.0, 0.0, 5.0], [5.0, 0.0, 0.0]]);
        assert_eq!(middles(vec![vec![large]]), []);
    }
}
