use glam::DVec3;
use kernel::replica::{Receiver, Receivers};

use super::{Mesh, Surroundings, Vertex, VertexId, surroundings};

/// How far a receiver is moved from its vertex into the surface around it, relative to that surface's width. A vertex on a
/// room's edge lies in the planes of both walls and sees nothing of the other; a hair inside, half of its hemisphere is the
/// other wall, and the form factors of a closed room sum to 1.
pub const INWARD: f64 = 1e-3;

/// The vertices from `first` on as receivers, with the surroundings of each.
#[must_use]
pub fn receivers(mesh: &Mesh, first: VertexId) -> (Receivers, Vec<Surroundings>) {
    let surroundings = surroundings(mesh, first);
    let receiver = |(vertex, around): (&Vertex, &Surroundings)| {
        let in_plane = around.inward - vertex.normal * vertex.normal.dot(around.inward);
        // Facets around a smooth vertex lie under its horizon or rise over it: start above them all.
        let lift = if vertex.smooth { vertex.normal * around.area.sqrt() } else { DVec3::ZERO };
        Receiver {
            position: vertex.position + (in_plane + lift) * INWARD,
            normal: vertex.normal,
            plane: vertex.plane,
        }
    };
    let receivers = mesh.vertices[first.index()..].iter().zip(&surroundings).map(receiver).collect();
    (Receivers { first_key: u64::from(first.0), receivers }, surroundings)
}
