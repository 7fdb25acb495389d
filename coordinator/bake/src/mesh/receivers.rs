use foldhash::{HashMap, HashMapExt};
use glam::DVec3;
use kernel::replica::{Receiver, Receivers};

use super::{Mesh, PatchId, Surroundings, Vertex, VertexId, surroundings};

/// How far a receiver is moved from its vertex into the surface around it, relative to that surface's width. A vertex on a
/// room's edge lies in the planes of both walls and sees nothing of the other; a hair inside, half of its hemisphere is the
/// other wall, and the form factors of a closed room sum to 1.
pub const INWARD: f64 = 1e-3;

/// Vertices as receivers.
pub struct VertexReceivers {
    /// The receivers, by rising index of the first vertex of each.
    pub receivers: Receivers,
    /// The surroundings of each receiver.
    pub around: Vec<Surroundings>,
    /// Index of the receiver of each vertex; `None` where each has its own.
    pub of_vertices: Option<Vec<u32>>,
}

/// The vertices from `first` on as receivers. The corners of a flat leaf no longer than `small`, in frame units, share one at its
/// centre, where no other leaf has any of them: light hardly varies over it.
#[must_use]
pub fn receivers(mesh: &Mesh, first: VertexId, small: f64) -> VertexReceivers {
    let surroundings = surroundings(mesh, first);
    let vertices = &mesh.vertices[first.index()..];
    let only_leaf =
        if small > 0.0 { small_lone_leaves(mesh, first, small) } else { vec![None; vertices.len()] };
    let mut all = VertexReceivers {
        receivers: Receivers { first_key: u64::from(first.0), receivers: Vec::with_capacity(vertices.len()) },
        around: Vec::with_capacity(vertices.len()),
        of_vertices: None,
    };
    let mut of_vertices = Vec::with_capacity(vertices.len());
    let mut shared: HashMap<PatchId, u32> = HashMap::new();
    for ((vertex, around), leaf) in vertices.iter().zip(&surroundings).zip(only_leaf) {
        let next = all.around.len() as u32;
        let receiver = leaf.map_or(next, |leaf| *shared.entry(leaf).or_insert(next));
        of_vertices.push(receiver);
        if receiver < next {
            all.around[receiver as usize].area += around.area;
            continue;
        }
        all.around.push(*around);
        let own = receiver_at(vertex, around);
        all.receivers.receivers.push(match leaf {
            Some(leaf) => Receiver { position: mesh.centre(leaf), ..own },
            None => own,
        });
    }
    all.of_vertices = (!shared.is_empty()).then_some(of_vertices);
    all
}

/// The leaf of each vertex from `first` on, where it is no longer than `small` and has all of its corners for itself.
fn small_lone_leaves(mesh: &Mesh, first: VertexId, small: f64) -> Vec<Option<PatchId>> {
    let place = |vertex: &VertexId| vertex.index().checked_sub(first.index());
    let mut leaves_around = vec![0_u32; mesh.vertices.len() - first.index()];
    for (_, patch) in mesh.leaves() {
        patch.corners.iter().filter_map(place).for_each(|index| leaves_around[index] += 1);
    }
    let is_lone = |vertex: &VertexId| {
        place(vertex).is_some_and(|index| leaves_around[index] == 1 && !mesh.vertices[vertex.index()].smooth)
    };
    let mut only_leaf = vec![None; leaves_around.len()];
    for (id, patch) in mesh.leaves() {
        if patch.corners.iter().all(is_lone) && mesh.size(id) <= small {
            patch.corners.iter().filter_map(place).for_each(|index| only_leaf[index] = Some(id));
        }
    }
    only_leaf
}

fn receiver_at(vertex: &Vertex, around: &Surroundings) -> Receiver {
    let in_plane = around.inward - vertex.normal * vertex.normal.dot(around.inward);
    // Facets around a smooth vertex lie under its horizon or rise over it: start above them all.
    let lift = if vertex.smooth { vertex.normal * around.area.sqrt() } else { DVec3::ZERO };
    Receiver {
        position: vertex.position + (in_plane + lift) * INWARD,
        normal: vertex.normal,
        plane: vertex.plane,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{facet, scene};

    const EXTENT: f64 = 1000.0;

    #[test]
    fn corners_of_a_small_leaf_share_a_receiver_where_it_has_them_alone() {
        let floor =
            facet(0, &[[0.0, 0.0, 0.0], [0.0, 0.0, EXTENT], [EXTENT, 0.0, EXTENT], [EXTENT, 0.0, 0.0]]);
        let crumb = facet(1, &[[5.0, 5.0, 5.0], [5.0, 5.0, 8.0], [8.0, 5.0, 8.0]]);
        // Two that have an edge in common, seen as one surface.
        let chip = facet(2, &[[50.0, 5.0, 5.0], [50.0, 5.0, 8.0], [53.0, 5.0, 8.0]]);
        let other = facet(2, &[[50.0, 5.0, 5.0], [53.0, 5.0, 8.0], [53.0, 5.0, 5.0]]);
        let scene = scene(vec![vec![floor], vec![crumb], vec![chip, other]], vec![]);
        let mesh = Mesh::new(&scene, EXTENT, EXTENT, 0, &[]);
        let alone = receivers(&mesh, VertexId(0), 0.0);
        assert_eq!(alone.of_vertices, None);
        assert_eq!(alone.receivers.receivers.len(), mesh.vertices.len());

        let some = receivers(&mesh, VertexId(0), 5.0);
        let of_vertices = some.of_vertices.unwrap();
        let of_surface = |surface: u32| -> Vec<u32> {
            let leaves = mesh.leaves().filter(|(_, patch)| patch.surface == surface);
            leaves.flat_map(|(_, patch)| &patch.corners).map(|vertex| of_vertices[vertex.index()]).collect()
        };
        let distinct = |mut all: Vec<u32>| {
            all.sort_unstable();
            all.dedup();
            all
        };
        assert_eq!(distinct(of_surface(0)).len(), 4);
        let [shared] = distinct(of_surface(1))[..] else { panic!("{:?}", of_surface(1)) };
        let place = some.receivers.receivers[shared as usize].position;
        assert!(place.distance(DVec3::new(6.0, 5.0, 7.0)) < 1e-9, "{place}");
        assert!((some.around[shared as usize].area - 4.5).abs() < 1e-9);
        // Of the other two each has a corner in common with its neighbour.
        assert_eq!(distinct(of_surface(2)).len(), 4);
        let is_of_pair = |vertex: &Vertex| vertex.position.x >= 50.0 && vertex.position.y == 5.0;
        for (index, vertex) in mesh.vertices.iter().enumerate().filter(|(_, vertex)| is_of_pair(vertex)) {
            let place = some.receivers.receivers[of_vertices[index] as usize].position;
            assert!(place.distance(vertex.position) < 0.01, "{place} is not at {}", vertex.position);
        }
        assert_eq!(some.receivers.receivers.len(), 9);
    }
}
