//! glTF files as plain documents: parsed, validated, decompressed, with their buffers and images.
//!
//! In: the bytes of a `.glb` or `.gltf`, and its folder. Out: a [`PlainDocument`] without anything that is compressed, quantized,
//! instanced or posed. It must not know what light does with a file: the bake's import and the independent importer of the
//! verification both read through it, and share nothing above it. Begin reading at [`read`].
//!
//! | module | what lives there |
//! |---|---|
//! | [`parse`] | bytes to a validated document |
//! | [`scene_choice`] | which of its scenes is meant |
//! | [`buffers`] | its buffers, from the file or next to it |
//! | `prepare` | compressed, quantized, instanced or posed geometry made plain |
//! | [`placement`], [`nodes`] | where its nodes stand |
//! | [`accessors`] | checks of vertex data before they are read |
//! | [`images`], [`texture`] | its images decoded, and looked up |
//! | [`error`] | why a file cannot be read |
//!
//! Files are not trusted: whatever the bytes, the answer is a document or an [`ImportProblem`].

pub mod accessors;
pub mod buffers;
pub mod error;
pub mod images;
pub mod nodes;
pub mod parse;
pub mod placement;
mod prepare;
pub mod scene_choice;
pub mod texture;

use std::path::Path;

use gltf::Document;
use serde::Serialize;

pub use error::{ImportError, ImportProblem};
use parse::Parsed;
use prepare::{Extensions, Limits};

/// How the numbers of a file's lights are meant.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LightUnit {
    /// As their extensions say: candela for point and spot lights, lux for directional ones, cd/m^2 for area lights. They are taken as they are: in
    /// whatever unit they are meant, irradiance comes out in the one that belongs to it.
    #[default]
    Candela,
    /// Radiant watts for point and spot lights, as some exporters write them: over 4 pi they are an intensity in W/sr, that of a
    /// spot light too, whose cone only cuts it off. Directional and area lights are taken as W/m^2 and W/(m^2 sr), as they are.
    Watt,
}

/// Which part of a file is meant, and limits for files that are not trusted or too large for the machine.
#[derive(Debug, Clone)]
pub struct ReadOptions {
    /// Name or index of the scene [default: the file's default scene, or its first].
    pub scene: Option<String>,
    /// Most bytes of the file and its external buffers together [default: 4 GiB].
    pub max_bytes: u64,
    /// Most triangles in the scene, counted once for every node that shows them [default: 50 million].
    pub max_triangles: usize,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self { scene: None, max_bytes: 4 << 30, max_triangles: 50_000_000 }
    }
}

/// A validated document without anything that is compressed, quantized, instanced or posed.
pub struct PlainDocument {
    /// The document.
    pub document: Document,
    /// The bytes of its buffers.
    pub buffers: Vec<Vec<u8>>,
    /// Extensions that the file requires and the validation does not know: taken out of the document.
    pub required: Vec<String>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// Reads a document from the bytes of its file. External buffers are read from `folder` or below; without a folder, references to
/// files are refused.
///
/// # Errors
/// When the bytes are not a glTF 2.0 file that can be read within the limits.
pub fn read(
    bytes: &[u8],
    folder: Option<&Path>,
    options: &ReadOptions,
) -> Result<PlainDocument, ImportProblem> {
    let Parsed { mut root, json, blob } = parse::parse(bytes)?;
    let extensions = Extensions::read(&root, &json, blob.is_some())?;
    let budget = options.max_bytes - bytes.len() as u64;
    let needed = |buffer: usize| !extensions.is_fallback(buffer);
    let mut buffers = buffers::resolve(&root, needed, blob, folder, budget, options.max_bytes)?;
    let held: u64 = buffers.iter().map(|bytes| bytes.len() as u64).sum();
    let limits = Limits {
        bytes: options.max_bytes.saturating_sub(held),
        max_bytes: options.max_bytes,
        max_triangles: options.max_triangles,
    };
    prepare::undo(&mut root, &mut buffers, &extensions, limits)?;
    let required =
        root.extensions_required.iter().filter(|name| *name == parse::EXT_LIGHTS_AREA).cloned().collect();
    let document = parse::validate(root, options.scene.as_deref())?;
    let mut warnings = Vec::new();
    let document = prepare::pose(document, &mut buffers, limits, &mut warnings)?;
    Ok(PlainDocument { document, buffers, required, warnings })
}

/// The document in `bytes` and its buffers, if it has anything that must be made plain first. `None` if it is plain, or is no
/// glTF.
///
/// # Errors
/// As [`read`].
pub fn made_plain(
    bytes: &[u8],
    folder: Option<&Path>,
    options: &ReadOptions,
) -> Result<Option<PlainDocument>, ImportProblem> {
    let is_plain = parse::parse(bytes).map_or(true, |parsed| prepare::is_plain(&parsed.root));
    if is_plain || bytes.len() as u64 > options.max_bytes {
        return Ok(None);
    }
    read(bytes, folder, options).map(Some)
}
