//! The way out: the input scene with refined geometry and light at its vertices, as `.glb` or `.gltf`, or the lit mesh alone as
//! `.ply`.
//!
//! Everything of the input document is kept except what the light replaces:
//!
//! - A mesh of a lit node becomes a mesh of that node alone, in the node's coordinates: two nodes of one mesh are lit
//!   differently. Primitives without a lit surface (points, lines) stay in it as they are.
//! - Both sides of a `doubleSided` primitive become a primitive each, with single-sided materials, because their light
//!   differs.
//! - Per vertex there are `COLOR_0` (irradiance x exposure x the input's `COLOR_0`, clamped to [0, 1], linear, with its alpha),
//!   `_IRRADIANCE` (irradiance as it is, without exposure or clamp), `_IRRADIANCE_NAME` for the part of each light group,
//!   `_UNSHOT` (radiosity still to be shot) while the bake is under way,
//!   `_COLOR_0` (the input's `COLOR_0`) and the input's other attributes, interpolated. `JOINTS`, `WEIGHTS` and morph targets
//!   end here: the light is that of the pose that it was computed with.
//! - Materials become `KHR_materials_unlit`, so that a viewer shows `COLOR_0` x base colour, which is radiosity x exposure, and
//!   no light of its own. `COLOR_0` of a metal also holds the factor 1 - metallicFactor. Where a texture says what is metal it
//!   does not: base colour is shown whole, as no value at vertices follows a texture.
//! - Emissive materials stay lit where they emit more than they reflect: an unlit one would not show its glow, and
//!   `KHR_materials_emissive_strength` may not share a material with it. What glows less than it reflects becomes unlit.
//!
//! - Files that images name go into the output's buffer as they are, for the output may lie elsewhere; not for a `.gltf` in
//!   the input's own folder.
//!
//! What stays keeps its place: nodes, cameras, lights, textures, images, samplers and meshes their index, buffer views their
//! bytes. The first lit mesh of a mesh takes its place, and the lit counterpart of a material that of the material. So what
//! extensions name that nobody here knows is still there. Accessors and buffer views may move when others go, but not below
//! an index that an unknown extension might mean. Extensions of an unlit material, which may have none, are kept in its
//! `extras.halflight.extensions`.
//!
//! | module | what lives there |
//! |---|---|
//! | `attributes` | the input's vertex attributes at new vertices |
//! | `refined` | the vertices of one lit side of one primitive |
//! | `exposure` | the brightness that suits the scene |
//! | `extensions` | extensions that nothing here knows |
//! | `images` | images beside the input |
//! | `layers` | names of the attributes that hold parts of the light |
//! | `materials` | materials that show the light |
//! | `document` | nodes, meshes and primitives of the output |
//! | `ply` | the lit mesh as PLY |
//! | `buffer` | the output's buffer: new accessors in, unused old ones out |
//! | `write` | files, all or nothing |

mod attributes;
mod buffer;
mod document;
mod exposure;
mod extensions;
mod images;
mod layers;
mod materials;
mod ply;
mod refined;
#[cfg(test)]
mod tests;
mod write;

use std::path::{Path, PathBuf};

use bake::LightGroup;
use bake::lit::LitMesh;
use scene::Scene;

use crate::files::FileError;

/// Which vertices the triangles of the output share.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Domain {
    /// Those whose attributes are all the same: few vertices, and light without a crease where it is smooth.
    #[default]
    Vertex,
    /// None: every corner of a triangle is a vertex of its own, so that tools that merge or edit vertices keep what differs
    /// from face to face.
    Corner,
}

/// How to write the lit scene.
#[derive(Debug, Clone)]
pub struct ExportSettings {
    /// `COLOR_0` per unit of irradiance; `None` chooses one that suits the scene, so that the 95th percentile of the
    /// reflecting surface's irradiance becomes 1.
    pub exposure: Option<f64>,
    /// Unit of the irradiance, such as `W/m^2`: written, not interpreted.
    pub unit: String,
    /// Which vertices triangles share.
    pub domain: Domain,
    /// An object whose members go to `asset.extras.halflight` beside `exposure` and `unit`. Anything else becomes its
    /// member `settings`, null nothing.
    pub extras: serde_json::Value,
}

impl Default for ExportSettings {
    fn default() -> Self {
        Self {
            exposure: None,
            unit: "W/m^2".into(),
            domain: Domain::default(),
            extras: serde_json::Value::Null,
        }
    }
}

/// What was written.
#[derive(Debug, Clone, PartialEq)]
pub struct Exported {
    /// The exposure used.
    pub exposure: f64,
    /// Vertices of the lit primitives. More than the mesh has where the input's attributes jump.
    pub vertices: usize,
    /// Triangles of the lit primitives.
    pub triangles: usize,
    /// What of the input the output lacks, in words for the user.
    pub warnings: Vec<String>,
}

/// Why the lit scene cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The output's name does not say which format is meant.
    #[error("output {0} must end in .glb, .gltf or .ply")]
    Extension(PathBuf),
    /// The output cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
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
    /// Two groups of lights whose attributes would have one name.
    #[error("groups {one} and {other} would both become the attribute {attribute}: rename one")]
    SameGroup {
        /// A group.
        one: String,
        /// Another one.
        other: String,
        /// The attribute.
        attribute: String,
    },
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
/// When the extension is neither `.glb` nor `.gltf` nor `.ply`, the directory is missing, the path is a directory, or the operating
/// system refuses a file there.
pub fn check_writable(path: &Path) -> Result<(), ExportError> {
    write::check(path)
}

/// Finds out whether each group of lights would have an attribute of its own: to be asked before a long bake.
///
/// # Errors
/// When two would have the same, for their names differ only in what an attribute's name cannot say.
pub fn check_group_names(groups: &[LightGroup]) -> Result<(), ExportError> {
    layers::check(&groups.iter().map(|group| group.name.as_str()).collect::<Vec<_>>())
}

/// Writes the lit scene to `path`: `.glb`, `.gltf` with its `.bin` beside it, or `.ply`, which has the lit mesh only.
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
    if write::format(path)? == write::Format::Ply {
        let (file, exported) = ply::encode(scene, lit, exposure, settings)?;
        write::write_files(vec![file], path)?;
        return Ok(exported);
    }
    let mut assembled = document::assemble(scene, lit, exposure, settings.domain, path)?;
    document::describe(&mut assembled.root, lit, exposure, settings)?;
    write::write(assembled.root, assembled.binary, path)?;
    Ok(Exported {
        exposure,
        vertices: assembled.vertices,
        triangles: assembled.triangles,
        warnings: assembled.warnings,
    })
}
