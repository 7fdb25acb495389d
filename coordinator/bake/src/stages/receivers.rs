//! Vertices as receivers, and as the lit mesh.

use glam::DVec3;
use kernel::replica::{Receiver, Receivers};

use crate::lit::{LitMesh, LitTriangle, LitVertex};
use crate::mesh::{Mesh, VertexId, surroundings};

/// How far a receiver is moved from its vertex into the surface around it, relative to that surface's width. A vertex on a
/// room's edge lies in the planes of both walls and sees nothing of the other; a hair inside, half of its hemisphere is the
/// other wall, and the form factors of a closed room sum to 1.
pub const INWARD: f64 = 1e-3;

/// The vertices from `first` on as receivers.
pub fn receivers(mesh: &Mesh, first: VertexId) -> Receivers {
    let vertices = &mesh.vertices[first.index()..];
    let receivers = vertices
        .iter()
        .zip(surroundings(mesh, first))
        .map(|(vertex, around)| {
            let in_plane = around.inward - vertex.normal * vertex.normal.dot(around.inward);
            // Facets around a smooth vertex lie under its horizon or rise over it: start above them all.
            let lift = if vertex.smooth { vertex.normal * around.area.sqrt() } else { DVec3::ZERO };
            Receiver {
                position: vertex.position + (in_plane + lift) * INWARD,
                normal: vertex.normal,
                plane: vertex.plane,
            }
        })
        .collect();
    Receivers { first_key: u64::from(first.0), receivers }
}

/// The mesh with its irradiance, in the scene's units.
pub fn lit_mesh(mesh: &Mesh, irradiance: &[DVec3], surfaces: Vec<Vec<LitTriangle>>) -> LitMesh {
    let vertices = mesh
        .vertices
        .iter()
        .zip(irradiance)
        .map(|(vertex, irradiance)| LitVertex {
            position: vertex.position,
            normal: vertex.normal,
            irradiance: *irradiance,
        })
        .collect();
    LitMesh { vertices, surfaces, layers: vec![], unshot: vec![] }
}
