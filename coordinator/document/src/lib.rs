//! glTF files as plain documents: parsed, validated, decompressed, with their buffers and images.
//!
//! In: the bytes of a `.glb` or `.gltf`, and its folder. Out: a [`PlainDocument`] without anything that is compressed, quantized,
//! instanced or posed. It must not know what light does with a file: the bake's import and the independent importer of the
//! verification both read through it, and share nothing above it. Begin reading at [`open`].
//!
//! | module | what lives there |
//! |---|---|
//! | `parse`, `nesting` | bytes to a validated document |
//! | `scene_choice` | one of its scenes chosen |
//! | `buffers` | its buffers, from the file or next to it |
//! | `beside` | files next to it |
//! | `prepare` | compressed, quantized, instanced or posed geometry made plain |
//! | [`placement`], [`nodes`] | world transforms of its nodes |
//! | [`accessors`] | vertex data checked before it is read |
//! | [`images`], [`texture`] | its images decoded and sampled |
//! | `lightmap` | the lightmaps of its materials |
//! | `glass` | transmitting materials as ones of alpha |
//! | [`sky`] | skies as images, of their own files or within it |
//! | [`labels`] | names of its parts in messages |
//! | `warnings` | what the user should know, each once |
//! | `error`, `faults` | why a file cannot be read |
//!
//! Files are not trusted: whatever the bytes, the answer is a document or an [`ImportProblem`].

pub mod accessors;
mod beside;
mod buffers;
mod error;
mod faults;
mod glass;
pub mod images;
pub mod labels;
mod lightmap;
mod nesting;
pub mod nodes;
mod parse;
pub mod placement;
mod prepare;
mod scene_choice;
pub mod sky;
pub mod texture;
mod warnings;

use std::path::Path;

use gltf::Document;
use serde::Serialize;

pub use beside::{Folder, files_beside, files_beside_file};
pub use buffers::read_uri;
pub use error::{ImportError, ImportProblem};
pub use glass::{Glass, LEAST_OF_GLASS};
pub use lightmap::{LightmapLink, MOZ_LIGHTMAP};
use parse::Parsed;
pub use parse::{EXT_LIGHTS_AREA, is_understood, require_again, warn_ignored_extensions};
use prepare::{Extensions, Limits};
pub use warnings::{first as first_warnings, joined as joined_warnings};

/// Unit of a file's light intensities.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LightUnit {
    /// Candela for point and spot lights, lux for directional ones, cd/m^2 for area lights, as their extensions say. The numbers are
    /// taken as they are.
    #[default]
    Candela,
    /// Radiant watts for point and spot lights, as some exporters write them: divided by 4 pi they are W/sr, for a spot light too,
    /// whose cone only masks it. Directional lights are W/m^2, area lights W/(m^2 sr).
    Watt,
    /// Candela and lux that are watts times 683 lm/W, beside emission in W/(m^2 sr), as Blender's exporter writes them in its mode
    /// Standard: point, spot and directional lights are divided by that, area lights taken as they are.
    Blender,
    /// W/sr and W/m^2, as Blender's exporter writes them in its mode Unitless. The numbers are taken as they are.
    BlenderUnitless,
}

impl LightUnit {
    /// Lumens that Blender's exporter takes a watt for.
    pub const LUMENS_PER_WATT: f64 = 683.0;
}

/// Which scene of a file to read, and limits of size.
#[derive(Debug, Clone)]
pub struct ReadOptions {
    /// Name or index of the scene [default: the file's default scene, or its first].
    pub scene: Option<String>,
    /// Most bytes of the file and the files it refers to, together [default: 4 GiB].
    pub max_bytes: u64,
    /// Most triangles in the scene; a mesh counts once per node [default: 50 million].
    pub max_triangles: usize,
    /// Whether files outside the folder of the file are read too: by `..`, absolute paths or links [default: no].
    pub outside_files: bool,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self { scene: None, max_bytes: 4 << 30, max_triangles: 50_000_000, outside_files: false }
    }
}

/// A validated document without anything that is compressed, quantized, instanced or posed.
pub struct PlainDocument {
    /// The document.
    pub document: Document,
    /// The bytes of its buffers.
    pub buffers: Vec<Vec<u8>>,
    /// Folder of the file, where relative references start; `None` for bytes that did not come from a file.
    pub folder: Option<Folder>,
    /// Whether the file was compressed by meshoptimizer.
    pub is_meshopt: bool,
    /// Extensions that the file requires and the validation does not know: taken out of the document.
    pub required: Vec<String>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// Most bytes of the file and what is beside it.
    max_bytes: u64,
    /// Bytes of those that images beside the file may have.
    bytes_left: u64,
}

/// Reads a .glb or .gltf file. Files that it refers to are regular ones in its folder or below, unless
/// [`ReadOptions::outside_files`] allows others.
///
/// # Errors
/// When the file cannot be read, or as [`read`].
pub fn open(path: &Path, options: &ReadOptions) -> Result<PlainDocument, ImportError> {
    let limit = options.max_bytes;
    let bytes = beside::read_file(path, limit).map_err(ImportProblem::Unreadable);
    bytes
        .and_then(|bytes| bytes.ok_or(ImportProblem::TooLarge { limit }))
        .and_then(|bytes| read(&bytes, Some(Folder::of(path, options.outside_files)), options))
        .map_err(|problem| ImportError::new(&path.display().to_string(), problem))
}

/// Reads a document from the bytes of its file. Without a folder, references to files are refused.
///
/// # Errors
/// When the bytes are not a glTF 2.0 file that can be read within the limits.
pub fn read(
    bytes: &[u8],
    folder: Option<Folder>,
    options: &ReadOptions,
) -> Result<PlainDocument, ImportProblem> {
    let max_bytes = options.max_bytes;
    let too_large = ImportProblem::TooLarge { limit: max_bytes };
    let budget = max_bytes.checked_sub(bytes.len() as u64).ok_or(too_large)?;
    let Parsed { mut root, json, blob } = parse::parse(bytes)?;
    let extensions = Extensions::read(&root, &json, blob.is_some())?;
    let needed = |buffer: usize| !extensions.is_fallback(buffer);
    let mut buffers = buffers::resolve(&root, needed, blob, folder.as_ref(), budget, max_bytes)?;
    let held: u64 = buffers.iter().map(|bytes| bytes.len() as u64).sum();
    let limits =
        Limits { bytes: max_bytes.saturating_sub(held), max_bytes, max_triangles: options.max_triangles };
    prepare::undo(&mut root, &mut buffers, &extensions, limits)?;
    let required =
        root.extensions_required.iter().filter(|name| parse::may_be_required(name)).cloned().collect();
    let document = parse::validate(root, options.scene.as_deref())?;
    texture::check_transforms(&document)?;
    let mut warnings = Vec::new();
    let document = prepare::pose(document, &mut buffers, limits, &mut warnings)?;
    let bytes_left = budget.saturating_sub(buffers::bytes_beside(document.as_json(), &buffers));
    let is_meshopt = !extensions.views.is_empty();
    Ok(PlainDocument { document, buffers, folder, is_meshopt, required, warnings, max_bytes, bytes_left })
}
