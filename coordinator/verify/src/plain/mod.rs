//! Scenes as plain triangles, for measuring a bake: an importer independent of the bake's. Both begin with a validated, plain
//! document and the bytes of its buffers ([`document::open`]); geometry, materials and lights are read anew.
//!
//! | module | what it reads |
//! |---|---|
//! | `appearance` | textures, colours of vertices and alpha at a point |
//! | `source` | a document's primitives in file order, their triangles in the world |
//! | `lights` | point, spot, directional and area lights in the world |
//! | `scene` | [`PlainScene`]: triangles, materials and lights of a scene |

mod appearance;
mod lights;
mod scene;
pub(crate) mod source;
#[cfg(test)]
mod tests;

use std::path::PathBuf;

use document::ImportError;

pub use self::appearance::{PlainAppearance, PlainMaterial};
pub use self::lights::{PlainLight, PlainLightKind};
pub use self::scene::{PlainOptions, PlainScene, PlainTriangle};

/// Why a scene cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum PlainError {
    /// The file cannot be read, or is no glTF with such a scene.
    #[error(transparent)]
    File(#[from] ImportError),
    /// Vertex data outside its buffer, or of the wrong type.
    #[error(
        "{path}: {what} of {node} cannot be read: it must lie inside its buffer, as float VEC3 or as indices of existing vertices"
    )]
    Data {
        /// The file.
        path: PathBuf,
        /// The node that shows the mesh.
        node: String,
        /// The attribute's name, or indices.
        what: &'static str,
    },
    /// A position, material or light out of range.
    #[error("{path}: {what} of {place} must be finite{}", if *.signed { "" } else { " and not negative" })]
    Factor {
        /// The file.
        path: PathBuf,
        /// Node or material.
        place: String,
        /// The factor.
        what: &'static str,
        /// Whether it may be negative.
        signed: bool,
    },
    /// No triangle has an area.
    #[error(
        "{0} has no triangles with an area in its scene: add a mesh, and check that its nodes are in the default scene"
    )]
    NoTriangles(PathBuf),
}
