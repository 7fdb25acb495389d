//! The lit scene as `.glb` or `.gltf`, or the lit mesh alone as `.ply`.
//!
//! The output is the input document with refined geometry and light per vertex:
//!
//! - Each lit node gets a mesh of its own, because two nodes of one mesh are lit differently; each side of a `doubleSided`
//!   primitive becomes a primitive. Points and lines stay.
//! - Vertices have `COLOR_0` (irradiance x exposure x the input's `COLOR_0`, clamped to [0, 1], linear), `_IRRADIANCE` (neither
//!   exposed nor clamped), `_IRRADIANCE_NAME` per light group, `_UNSHOT` during a bake, `_OCCLUSION` on request, `_COLOR_0` (the input's `COLOR_0`), and
//!   the input's other attributes, interpolated. Where touching surfaces cover each other, and
//!   inside closed bodies, `COLOR_0` is that of what lies beside. `JOINTS`, `WEIGHTS` and morph targets are dropped.
//! - Materials become `KHR_materials_unlit`: a viewer shows `COLOR_0` x base colour, radiosity x exposure. `COLOR_0` includes
//!   1 - metallicFactor, except where a texture states the metal. Materials that emit more than they reflect stay lit, as an
//!   unlit one shows no emission; extensions of unlit materials move to `extras.halflight.extensions`.
//! - With [`Materials::Keep`], materials and `COLOR_0` are the input's, and light is in `_IRRADIANCE` only.
//! - Image files are embedded, except for a `.gltf` in the input's own folder.
//!
//! Nodes, cameras, lights, textures, images, samplers and meshes keep their indices and buffer views their bytes, so that
//! unknown extensions still refer to the right things. Accessors and buffer views move only if no unknown extension can mean them.
//!
//! | module | what lives there |
//! |---|---|
//! | `attributes` | the input's vertex attributes at new vertices |
//! | `refined` | the vertices of one lit side of one primitive |
//! | `exposure` | automatic exposure |
//! | `extensions` | unknown extensions |
//! | `images` | images beside the input |
//! | `layers` | attribute names of light groups |
//! | `materials` | materials that show the light |
//! | `document` | meshes and primitives of the output |
//! | `lightmap` | instead of these: the input's own meshes and materials, with a lightmap |
//! | `draft` | what both have in common: the input with other meshes |
//! | `pages` | the pages of a lightmap as images |
//! | `ktx2` | the same for graphics hardware |
//! | `ply` | the lit mesh as PLY |
//! | `compress` | the output made small |
//! | `buffer` | the output's buffer: new accessors in, unused old ones out |
//! | `write` | files, all or nothing |

mod attributes;
mod buffer;
mod compress;
mod document;
mod draft;
mod exposure;
mod extensions;
mod images;
mod ktx2;
mod layers;
mod lightmap;
mod materials;
mod pages;
mod ply;
mod refined;
#[cfg(test)]
mod tests;
mod write;

use std::path::{Path, PathBuf};

use bake::LightGroup;
use bake::lit::LitMesh;
use scene::Scene;

use draft::Assembled;
use files::FileError;
pub use lightmap::LightmapPages;
pub use pages::PageFormat;

/// Vertex sharing in the output.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Domain {
    /// Triangles share identical vertices.
    #[default]
    Vertex,
    /// Three vertices per triangle, so that tools that merge or edit vertices keep differences between faces.
    Corner,
}

/// What becomes of the input's materials and of `COLOR_0`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Materials {
    /// They show the light of the bake alone, out of `COLOR_0`.
    #[default]
    Unlit,
    /// They stay, and so does `COLOR_0`; light is in `_IRRADIANCE` only.
    Keep,
}

/// Whether vertices and indices are compressed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Compression {
    /// As those of the input, where that was done by meshoptimizer.
    #[default]
    AsInput,
    /// They are not.
    None,
    /// By meshoptimizer, as EXT_meshopt_compression and KHR_mesh_quantization have it.
    Meshopt,
}

/// How to write the lit scene.
#[derive(Debug, Clone)]
pub struct ExportSettings {
    /// `COLOR_0` per unit of irradiance; `None` maps the 95th percentile of the irradiance on reflecting surfaces to 1.
    pub exposure: Option<f64>,
    /// Unit of the irradiance, such as `W/m^2`: written, not interpreted.
    pub unit: String,
    /// Vertex sharing.
    pub domain: Domain,
    /// What becomes of the input's materials.
    pub materials: Materials,
    /// Whether it is compressed.
    pub compression: Compression,
    /// An object whose members go to `asset.extras.halflight`, beside `exposure` and `unit`. Other values become its member
    /// `settings`; null is left out.
    pub extras: serde_json::Value,
}

impl Default for ExportSettings {
    fn default() -> Self {
        Self {
            exposure: None,
            unit: "W/m^2".into(),
            domain: Domain::default(),
            materials: Materials::default(),
            compression: Compression::default(),
            extras: serde_json::Value::Null,
        }
    }
}

/// Summary of a written file.
#[derive(Debug, Clone, PartialEq)]
pub struct Exported {
    /// The exposure used.
    pub exposure: f64,
    /// Vertices of the lit primitives; more than the mesh has where the input's attributes are discontinuous.
    pub vertices: usize,
    /// Triangles of the lit primitives.
    pub triangles: usize,
    /// What light at vertices costs where several nodes show one mesh.
    pub unshared: Option<Unshared>,
    /// Warnings on parts of the input that the output lacks.
    pub warnings: Vec<String>,
}

/// Meshes of the input that several nodes show, each of which has vertices of its own in the output.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Unshared {
    /// Number of these meshes.
    pub meshes: usize,
    /// Nodes that show them.
    pub nodes: usize,
    /// Vertices that all these nodes have.
    pub vertices: usize,
}

/// Why the lit scene cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The output's name has no known ending.
    #[error("output {0} must end in .glb, .gltf or .ply")]
    Extension(PathBuf),
    /// The output cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// An exposure that is not positive and finite.
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
    /// A lightmap is written to glTF only.
    #[error("output {0} cannot have a lightmap: write .glb or .gltf")]
    NoLightmap(PathBuf),
    /// An image cannot be encoded.
    #[error("a page of the lightmap cannot be encoded: {0}")]
    Image(String),
    /// Vertices or indices cannot be compressed.
    #[error("vertices cannot be compressed: {0}")]
    Compression(String),
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

/// The files that [`export`] writes.
///
/// # Errors
/// When the extension is neither `.glb` nor `.gltf` nor `.ply`.
pub fn files_of(path: &Path) -> Result<Vec<PathBuf>, ExportError> {
    write::files(path)
}

/// Checks, before a long bake, that each light group has an attribute name of its own.
///
/// # Errors
/// When two names differ only in characters that attribute names cannot have.
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
    let exposure = exposure_of(scene, lit, settings)?;
    if write::format(path)? == write::Format::Ply {
        let (file, exported) = ply::encode(scene, lit, exposure, settings)?;
        write::write_files(vec![file], path)?;
        return Ok(exported);
    }
    let mut assembled = document::assemble(scene, lit, exposure, settings, path)?;
    document::describe(&mut assembled.root, lit, exposure, settings)?;
    write_assembled(scene, assembled, exposure, settings, path)
}

/// Checks, before a long bake, that a lightmap of this number of pages can be written with an output. Returns the files of its pages
/// beside it.
///
/// # Errors
/// When the output is a `.ply`, or a file cannot be written.
pub fn check_lightmap(path: &Path, pages: u32, format: PageFormat) -> Result<Vec<PathBuf>, ExportError> {
    check_holds_lightmap(path)?;
    let beside = lightmap::files(path, pages, format);
    beside.iter().try_for_each(|path| files::check(path))?;
    Ok(beside)
}

/// Writes the scene with a lightmap to `path`, a `.glb` or `.gltf`: the input's own meshes and materials, which the lightmap is added
/// to. `lit` tells the exposure.
///
/// # Errors
/// As [`export`], and when the output is a `.ply`.
pub fn export_lightmap(
    scene: &Scene,
    lit: &LitMesh,
    pages: &LightmapPages,
    settings: &ExportSettings,
    path: &Path,
) -> Result<Exported, ExportError> {
    let exposure = exposure_of(scene, lit, settings)?;
    check_holds_lightmap(path)?;
    let (mut assembled, extras) = lightmap::assemble(scene, pages, path)?;
    let mut all = match &settings.extras {
        serde_json::Value::Object(members) => members.clone(),
        _ => serde_json::Map::new(),
    };
    all.insert("lightmap".into(), extras);
    let settings = ExportSettings { extras: all.into(), ..settings.clone() };
    document::describe(&mut assembled.root, &LitMesh::default(), exposure, &settings)?;
    for (path, bytes) in lightmap::contents(pages, path)? {
        files::write(&path, &bytes).map_err(|error| FileError::Write { path, error })?;
    }
    write_assembled(scene, assembled, exposure, &settings, path)
}

/// Refuses an output that cannot have a lightmap.
fn check_holds_lightmap(path: &Path) -> Result<(), ExportError> {
    match write::format(path)? {
        write::Format::Ply => Err(ExportError::NoLightmap(path.to_owned())),
        _ => Ok(()),
    }
}

fn write_assembled(
    scene: &Scene,
    assembled: Assembled,
    exposure: f64,
    settings: &ExportSettings,
    path: &Path,
) -> Result<Exported, ExportError> {
    let Assembled { mut root, mut binary, vertices, triangles, unshared, warnings } = assembled;
    let is_compressed = match settings.compression {
        Compression::AsInput => scene.source.is_meshopt,
        Compression::None => false,
        Compression::Meshopt => true,
    };
    if is_compressed {
        binary = compress::compress(&mut root, binary, extensions::pinned(&scene.source.root)?)?;
    }
    write::write(root, binary, path)?;
    Ok(Exported { exposure, vertices, triangles, unshared, warnings })
}

/// The exposure that is asked for, or one that suits the light.
fn exposure_of(scene: &Scene, lit: &LitMesh, settings: &ExportSettings) -> Result<f64, ExportError> {
    match settings.exposure {
        Some(exposure) if exposure.is_finite() && exposure > 0.0 => Ok(exposure),
        Some(exposure) => Err(ExportError::Exposure(exposure)),
        None => exposure::choose(scene, lit),
    }
}
