use glam::DVec3;
use smallvec::SmallVec;

use super::leaves_at::LeavesAt;
use super::{Mesh, PatchId, Vertex, VertexId, edge};

impl Mesh {
    /// Divides a leaf about its centroid into one quadrilateral per corner. Coarser neighbours are divided first, so
    /// that no edge ever has more than one vertex between its ends. Does nothing to a divided patch.
    pub fn divide(&mut self, id: PatchId) {
        self.divide_within(id, usize::MAX);
    }

    /// The same, as far as the mesh then has no more vertices than this: false where it would have more. Neighbours may be divided
    /// where the patch itself is not.
    pub fn divide_within(&mut self, id: PatchId, most: usize) -> bool {
        if self.leaves_at.is_none() {
            self.leaves_at = Some(LeavesAt::new(self));
        }
        let mut todo = vec![id];
        while let Some(&id) = todo.last() {
            if self.patch(id).first_child.is_some() {
                todo.pop();
                continue;
            }
            let coarser: Vec<PatchId> = self.coarser_neighbours(id);
            if !coarser.is_empty() {
                todo.extend(coarser);
                continue;
            }
            // One in the middle and one on each side, unless a neighbour has it.
            if self.vertices.len() + self.patch(id).corners.len() + 1 > most {
                return false;
            }
            self.divide_one(id);
            todo.pop();
        }
        true
    }

    /// Leaves that have the whole edge of which this patch has one half.
    fn coarser_neighbours(&self, id: PatchId) -> Vec<PatchId> {
        let Some(leaves_at) = &self.leaves_at else { return vec![] };
        let wholes = self.edges(id).filter_map(|(a, b)| self.halves.get(&edge(a, b)));
        wholes.flat_map(|whole| leaves_at.get(*whole)).copied().collect()
    }

    fn divide_one(&mut self, id: PatchId) {
        let patch = self.patch(id).clone();
        let edges: SmallVec<[_; 8]> = self.edges(id).collect();
        if let Some(leaves_at) = &mut self.leaves_at {
            edges.iter().for_each(|(a, b)| leaves_at.remove(edge(*a, *b), id));
        }
        let middles: SmallVec<[VertexId; 8]> = edges.iter().map(|(a, b)| self.midpoint(*a, *b)).collect();
        let centre = self.add_mean_vertex(&patch.corners);
        self.patches[id.index()].first_child = Some(PatchId(self.patches.len() as u32));
        for (i, &corner) in patch.corners.iter().enumerate() {
            let before = middles[(i + middles.len() - 1) % middles.len()];
            let corners = SmallVec::from([corner, middles[i], centre, before]);
            self.add_leaf(patch.surface, patch.facet, corners, Some(id));
        }
    }

    fn midpoint(&mut self, a: VertexId, b: VertexId) -> VertexId {
        let whole = edge(a, b);
        if let Some(&middle) = self.midpoints.get(&whole) {
            return middle;
        }
        let middle = self.add_mean_vertex(&[whole.0, whole.1]);
        self.midpoints.insert(whole, middle);
        for end in [a, b] {
            self.halves.insert(edge(end, middle), whole);
        }
        middle
    }

    /// The vertex in the middle of an edge, if a patch along it is divided.
    #[must_use]
    pub fn middle_of(&self, a: VertexId, b: VertexId) -> Option<VertexId> {
        self.midpoints.get(&edge(a, b)).copied()
    }

    fn add_mean_vertex(&mut self, of: &[VertexId]) -> VertexId {
        let id = VertexId(self.vertices.len() as u32);
        let sources = || of.iter().map(|source| &self.vertices[source.index()]);
        let first = self.vertices[of[0].index()];
        let position = sources().map(|source| source.position).sum::<DVec3>() / of.len() as f64;
        let smooth = sources().any(|source| source.smooth);
        let normal = if smooth {
            sources().map(|source| source.normal).sum::<DVec3>().normalize_or(first.normal)
        } else {
            first.normal
        };
        // None where any has none.
        let hovering = sources().map(|source| source.hovering).reduce(|a, b| Some(a?.min(b?))).flatten();
        self.vertices.push(Vertex { position, normal, plane: first.plane, smooth, hovering });
        id
    }
}

#[cfg(test)]
mod tests {
    use crate::mesh::{Mesh, MeshLimits};
    use crate::test_scenes::{facet, scene};

    /// Towards a corner, so that each division makes coarser neighbours divide.
    #[test]
    fn divisions_stay_within_the_vertices_that_there_may_be() {
        let square = facet(0, &[[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]]);
        let scene = scene(vec![vec![square]], vec![]);
        for most in 4..120 {
            let mut mesh = Mesh::within(MeshLimits::NONE, &scene, 1.0, 2.0, 12, &[]).unwrap();
            loop {
                let from_middle = |id| {
                    let corners = &mesh.patch(id).corners;
                    let sum: glam::DVec3 = corners.iter().map(|corner| mesh.position(*corner)).sum();
                    (sum / corners.len() as f64 - glam::DVec3::new(0.49, 0.49, 0.0)).length()
                };
                let leaves = mesh.leaves().map(|(id, _)| id);
                let nearest = leaves.min_by(|a, b| from_middle(*a).total_cmp(&from_middle(*b))).unwrap();
                if !mesh.divide_within(nearest, most) {
                    break;
                }
            }
            let vertices = mesh.vertices.len();
            assert!(vertices <= most && vertices + 5 > most, "{vertices} of {most} vertices");
        }
    }
}
