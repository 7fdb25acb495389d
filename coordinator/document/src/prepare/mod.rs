//! Makes a plain document out of one that compresses, quantizes, instances, leaves out or poses its geometry, before the `gltf`
//! crate looks at it: everything downstream, export included, sees valid glTF without these extensions.
//!
//! | module | what it does |
//! |---|---|
//! | `extensions` | reads the extensions' objects, which the crate leaves out |
//! | `storage` | one more buffer for what is decoded, within a limit |
//! | `values` | an accessor's elements as numbers |
//! | `meshopt` | EXT_meshopt_compression, KHR_meshopt_compression: buffer views decoded |
//! | `draco` | KHR_draco_mesh_compression: primitives decoded |
//! | `quantization` | KHR_mesh_quantization: integers become floats |
//! | `instances` | EXT_mesh_gpu_instancing: instances become nodes |
//! | `zeros` | accessors without data get their zeros |
//! | `animations` | their numbers checked |
//! | `pose` | morph targets and skins as the file shows them without animation |
//!
//! Files that need none of it are left as they are.

mod animations;
mod draco;
mod extensions;
mod instances;
mod meshopt;
mod pose;
mod quantization;
mod storage;
mod values;
mod zeros;

use gltf::Document;
use gltf::json::Root;

pub(crate) use self::extensions::Extensions;
use self::storage::Storage;
use super::error::ImportProblem;

/// Extensions that are decoded here and removed.
pub(crate) const UNDONE: [&str; 5] = [
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
    "KHR_draco_mesh_compression",
    "KHR_mesh_quantization",
    "EXT_mesh_gpu_instancing",
];

/// Bytes that the matrices of skins may take in any file, and more for each byte of its buffers.
const LEAST_ROOM: u64 = 64 << 20;
const ROOM_PER_BYTE: u64 = 64;

/// Limits of decoding.
#[derive(Clone, Copy)]
pub(crate) struct Limits {
    /// Bytes that may still be added, out of `max_bytes`.
    pub bytes: u64,
    /// Most bytes of all, for messages.
    pub max_bytes: u64,
    /// Most triangles of a primitive.
    pub max_triangles: usize,
}

/// Decodes and removes the extensions of a document that is not validated yet. Decoded data goes to a new buffer.
pub(crate) fn undo(
    root: &mut Root,
    buffers: &mut Vec<Vec<u8>>,
    extensions: &Extensions,
    limits: Limits,
) -> Result<(), ImportProblem> {
    let mut storage = Storage::new(root, buffers, limits);
    meshopt::decode(&mut storage, extensions)?;
    draco::decode(&mut storage, extensions)?;
    if storage
        .root
        .extensions_used
        .iter()
        .chain(&storage.root.extensions_required)
        .any(|name| name == quantization::NAME)
    {
        quantization::undo(&mut storage)?;
    }
    instances::place(&mut storage, extensions)?;
    zeros::fill(&mut storage)?;
    storage.finish();
    animations::check(root, buffers, limits)?;
    extensions::remove(root);
    root.extensions_used.retain(|name| !UNDONE.contains(&name.as_str()));
    root.extensions_required.retain(|name| !UNDONE.contains(&name.as_str()));
    Ok(())
}

/// Bakes morph targets and skins of the default scene's nodes into meshes of their own.
pub(crate) fn pose(
    document: Document,
    buffers: &mut Vec<Vec<u8>>,
    limits: Limits,
    warnings: &mut Vec<String>,
) -> Result<Document, ImportProblem> {
    let held: u64 = buffers.iter().map(|bytes| bytes.len() as u64).sum();
    let room = limits.bytes.min(LEAST_ROOM + held.saturating_mul(ROOM_PER_BYTE));
    let posed = pose::find(&document, room, warnings)?;
    if posed.is_empty() {
        return Ok(document);
    }
    let mut root = document.into_json();
    let mut storage = Storage::new(&mut root, buffers, limits);
    for node in &posed {
        pose::bake(&mut storage, node)?;
    }
    storage.finish();
    Ok(Document::from_json(root)?)
}
