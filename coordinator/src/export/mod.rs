//! The way out: the input scene with refined geometry and light at its vertices, as `.glb` or `.gltf`.
//!
//! Everything of the input document is kept except what the light replaces:
//!
//! - A mesh of a lit node becomes a mesh of that node alone, in the node's coordinates: two nodes of one mesh are lit
//!   differently. Primitives without a lit surface (points, lines) stay in it as they are.
//! - Both sides of a `doubleSided` primitive become a primitive each, with single-sided materials, because their light
//!   differs.
//! - Per vertex there are `COLOR_0` (irradiance x exposure, clamped to [0, 1], linear), `_IRRADIANCE` (the same as it is,
//!   without exposure or clamp) and the input's other attributes, interpolated. `JOINTS`, `WEIGHTS`, morph targets and the
//!   input's `COLOR_0` end here: the light is that of the pose and of the colours that it was computed with.
//! - Materials become `KHR_materials_unlit`, so that a viewer shows `COLOR_0` x base colour and no light of its own. Base
//!   colour stays as it is, so a metal looks brighter by 1 / (1 - metallic) than the light that it reflects diffusely.
//!   Emissive materials stay lit: an unlit one would not show its glow, and `KHR_materials_emissive_strength` may not share
//!   a material with it.
//!
//! Extensions that the `gltf` crate does not know are not written: what they point at may have moved.
//!
//! | module | what lives there |
//! |---|---|
//! | `attributes` | the input's vertex attributes at new vertices |
//! | `refined` | the vertices of one lit side of one primitive |
//! | `exposure` | the brightness that suits the scene |
//! | `materials` | materials that show the light |
//! | `document` | nodes, meshes and primitives of the output |
//! | `buffer` | the output's buffer: new accessors in, unused old ones out |
//! | `write` | files, all or nothing |

mod attributes;
mod buffer;
mod document;
mod exposure;
#[cfg(test)]
pub(crate) mod fixture;
mod materials;
mod refined;
#[cfg(test)]
mod tests;
mod write;

use std::io;
use std::path::{Path, PathBuf};

use crate::lit::LitMesh;
use crate::scene::Scene;

/// How to write the lit scene.
#[derive(Debug, Clone)]
pub struct ExportSettings {
    /// `COLOR_0` per unit of irradiance; `None` chooses one that suits the scene, so that the 95th percentile of the
    /// reflecting surface's irradiance becomes 1.
    pub exposure: Option<f64>,
    /// Unit of the irradiance, such as `W/m^2`: written, not interpreted.
    pub unit: String,
    /// An object whose members go to `asset.extras.halflight` beside `exposure` and `unit`. Anything else becomes its
    /// member `settings`, null nothing.
    pub extras: serde_json::Value,
}

/// What was written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exported {
    /// The exposure used.
    pub exposure: f64,
    /// Vertices of the lit primitives. More than the mesh has where the input's attributes jump.
    pub vertices: usize,
    /// Triangles of the lit primitives.
    pub triangles: usize,
}

/// Why the lit scene cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The output's name does not say which format is meant.
    #[error("output {0} must end in .glb or .gltf")]
    Extension(PathBuf),
    /// The output's directory does not exist.
    #[error("output directory {0} does not exist: create it, or choose another output")]
    NoDirectory(PathBuf),
    /// The output is a directory.
    #[error("output {0} is a directory: name a file in it")]
    IsDirectory(PathBuf),
    /// The output cannot be written.
    #[error("output {path} cannot be written: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        source: io::Error,
    },
    /// An exposure that would make every vertex black, or worse.
    #[error("exposure must be a positive number, not {0}")]
    Exposure(f64),
    /// A value is NaN, infinite, or too large for an f32.
    #[error("{quantity} of {surface} is not a finite number")]
    NotFinite {
        /// The surface's name.
        surface: String,
        /// Position, irradiance or the attribute's name.
        quantity: String,
    },
    /// The node squeezes its mesh flat, so no local coordinates give the refined positions.
    #[error("node of {0} has a scale of zero: give it a small one in place of zero")]
    SingularNode(String),
    /// The lit mesh does not belong to the scene, or the scene not to its document.
    #[error("lit mesh does not fit its scene: {0}")]
    Mismatch(String),
    /// The input's buffers do not hold what its document says.
    #[error("input's {0} lies outside its buffer")]
    Buffer(String),
    /// The format's lengths have 32 bits.
    #[error("output would have {0} bytes, more than the format's 4 GiB: bake with a coarser mesh")]
    TooLarge(usize),
    /// The document cannot be expressed in JSON.
    #[error("output document cannot be encoded: {0}")]
    Json(#[from] serde_json::Error),
}

/// Finds out whether `path` can be written, and leaves nothing behind: to be asked before a long bake.
///
/// # Errors
/// When the extension is neither `.glb` nor `.gltf`, the directory is missing, the path is a directory, or the operating
/// system refuses a file there.
pub fn check_writable(path: &Path) -> Result<(), ExportError> {
    write::check(path)
}

/// Writes the lit scene to `path`: `.glb`, or `.gltf` with its `.bin` beside it.
///
/// An error leaves what was there before untouched.
///
/// # Errors
/// As [`check_writable`]; when a position or an irradiance is not finite; when `lit` does not belong to `scene`.
pub fn export(
    scene: &Scene,
    lit: &LitMesh,
    settings: &ExportSettings,
    path: &Path,
) -> Result<Exported, ExportError> {
    let exposure = match settings.exposure {
        Some(exposure) if exposure.is_finite() && exposure > 0.0 => exposure,
        Some(exposure) => return Err(ExportError::Exposure(exposure)),
        None => exposure::choose(scene, lit)?,
    };
    let mut assembled = document::assemble(scene, lit, exposure)?;
    document::describe(&mut assembled.root, exposure, settings)?;
    write::write(assembled.root, assembled.binary, path)?;
    Ok(Exported { exposure, vertices: assembled.vertices, triangles: assembled.triangles })
}
