//! Scenes as plain triangles, for what measures the bake: it must not read them with the bake's own import. Only what is
//! compressed, quantized, instanced or posed is made plain by the import first.
//!
//! | module | what it reads |
//! |---|---|
//! | `appearance` | textures, colours of vertices and alpha at a point |
//! | `buffers` | the bytes of every buffer, from the file or next to it |
//! | `source` | a document's primitives in file order, their triangles in the world |
//! | `lights` | point, spot, directional and area lights in the world |
//! | `scene` | [`PlainScene`]: triangles, materials and lights of a scene |

mod appearance;
mod buffers;
mod lights;
mod scene;
pub(crate) mod source;
#[cfg(test)]
mod tests;

use std::io;
use std::path::PathBuf;

use document::ImportProblem;

pub use self::appearance::PlainAppearance;
pub use self::lights::{PlainLight, PlainLightKind};
pub use self::scene::{PlainMaterial, PlainOptions, PlainScene, PlainTriangle};

/// Why a scene cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum PlainError {
    /// The file cannot be read.
    #[error("{path} cannot be read: {error}; check the path and the permissions")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        error: io::Error,
    },
    /// The file is no valid glTF.
    #[error("{path} is not a valid glTF: {error}")]
    Gltf {
        /// The file.
        path: PathBuf,
        /// What the glTF reader says.
        error: gltf::Error,
    },
    /// There is no such scene in the file, or what it compresses cannot be decoded.
    #[error("{path}: {error}")]
    Import {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        error: Box<ImportProblem>,
    },
    /// A buffer is not there, or not whole.
    #[error("{path}: buffer {buffer} cannot be read: {why}; export as .glb, which holds its buffers itself")]
    Buffer {
        /// The file.
        path: PathBuf,
        /// Index of the buffer.
        buffer: usize,
        /// What is wrong with it.
        why: String,
    },
    /// Vertex data lie outside their buffer, or do not have the type that they should.
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
    /// A position, material or light that means nothing.
    #[error("{path}: {what} of {place} must be finite{}", if *.signed { "" } else { " and not negative" })]
    Factor {
        /// The file.
        path: PathBuf,
        /// Node or material.
        place: String,
        /// What is wrong with it.
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
