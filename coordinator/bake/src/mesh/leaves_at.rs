//! Which leaves lie along an edge.

use foldhash::HashMap;
use rayon::prelude::*;
use smallvec::SmallVec;

use super::{Edge, Mesh, Patch, PatchId, edge};

/// The leaves along each edge, in the order of their ids.
#[derive(Debug, Clone)]
pub struct LeavesAt {
    /// Edges of all leaves when this was made, sorted: most never change.
    edges: Vec<Edge>,
    /// The leaf of each.
    leaves: Vec<PatchId>,
    /// Edges whose leaves have changed since.
    changed: HashMap<Edge, SmallVec<[PatchId; 2]>>,
}

impl LeavesAt {
    /// Finds the leaves of a mesh.
    pub fn new(mesh: &Mesh) -> Self {
        let of_leaf = |(id, _): (PatchId, &Patch)| mesh.edges(id).map(move |(a, b)| (edge(a, b), id));
        let mut all: Vec<(Edge, PatchId)> = mesh.par_leaves().flat_map_iter(of_leaf).collect();
        all.par_sort_unstable();
        let (edges, leaves) = all.into_iter().unzip();
        Self { edges, leaves, changed: HashMap::default() }
    }

    /// The leaves along an edge.
    pub fn get(&self, edge: Edge) -> &[PatchId] {
        self.changed.get(&edge).map_or_else(|| self.before(edge), SmallVec::as_slice)
    }

    /// Adds a leaf, which has a greater id than all others.
    pub fn add(&mut self, edge: Edge, leaf: PatchId) {
        self.change(edge).push(leaf);
    }

    /// Takes a leaf away.
    pub fn remove(&mut self, edge: Edge, leaf: PatchId) {
        self.change(edge).retain(|other| *other != leaf);
    }

    fn before(&self, edge: Edge) -> &[PatchId] {
        let first = self.edges.partition_point(|other| *other < edge);
        let count = self.edges[first..].iter().take_while(|other| **other == edge).count();
        &self.leaves[first..first + count]
    }

    fn change(&mut self, edge: Edge) -> &mut SmallVec<[PatchId; 2]> {
        if !self.changed.contains_key(&edge) {
            self.changed.insert(edge, self.before(edge).into());
        }
        self.changed.entry(edge).or_default()
    }
}
