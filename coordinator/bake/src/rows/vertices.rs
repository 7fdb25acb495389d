//! The vertices as sets of receivers: those of the shooting mesh, then those of each round of refinement.

use crate::mesh::VertexId;
use crate::solver::cache::SetId;

/// Receivers of the shooting mesh: they are added before all others.
pub const COARSE: SetId = SetId(0);

/// Which set of receivers, and which of its receivers, each vertex has.
#[derive(Default)]
pub struct VertexSets {
    sets: Vec<SetId>,
    coarse_count: usize,
    /// Index of the receiver of each vertex of the shooting mesh; `None` where each has its own. All later ones have.
    of_coarse: Option<Vec<u32>>,
}

impl VertexSets {
    /// The vertices of a shooting mesh, given their number and the index of the receiver of each.
    pub fn new(count: usize, of_vertices: Option<Vec<u32>>) -> Self {
        Self { sets: vec![COARSE], coarse_count: count, of_coarse: of_vertices }
    }

    /// Adds vertices, each with a receiver of its own.
    pub fn push(&mut self, set: SetId) {
        self.sets.push(set);
    }

    /// The sets, in the order of the vertices.
    pub fn sets(&self) -> impl Iterator<Item = SetId> + '_ {
        self.sets.iter().copied()
    }

    /// Number of vertices of the shooting mesh.
    pub fn coarse_count(&self) -> usize {
        self.coarse_count
    }

    /// Whether these corners of a leaf share a receiver.
    pub fn is_one(&self, corners: &[VertexId]) -> bool {
        let Some(receivers) = &self.of_coarse else { return false };
        let receiver = |vertex: &VertexId| receivers.get(vertex.index());
        corners
            .windows(2)
            .all(|pair| receiver(&pair[0]).is_some() && receiver(&pair[0]) == receiver(&pair[1]))
    }

    /// The value of each vertex of the shooting mesh, from that of each of its receivers.
    pub fn of_coarse<T: Copy>(&self, values: Vec<T>) -> Vec<T> {
        match &self.of_coarse {
            Some(receivers) => receivers.iter().map(|receiver| values[*receiver as usize]).collect(),
            None => values,
        }
    }

    /// The value of each vertex, from those of the receivers, set by set.
    pub fn join<T: Copy>(&self, by_set: impl IntoIterator<Item = Vec<T>>) -> Vec<T> {
        let mut by_set = by_set.into_iter();
        let mut all = self.of_coarse(by_set.next().unwrap_or_default());
        by_set.for_each(|values| all.extend(values));
        all
    }
}
