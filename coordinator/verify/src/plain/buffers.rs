//! The bytes of a document's buffers.

use std::fs;
use std::path::{Component, Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gltf::Gltf;
use gltf::buffer::Source;
use percent_encoding::percent_decode_str;

use super::PlainError;

/// Reads every buffer of a document that stands at `path`. Files are read from its folder or below, never from elsewhere.
pub(super) fn read(path: &Path, gltf: &mut Gltf) -> Result<Vec<Vec<u8>>, PlainError> {
    let mut blob = gltf.blob.take();
    let folder = path.parent().unwrap_or(Path::new(""));
    let buffers = gltf.buffers().map(|buffer| {
        let bytes = match buffer.source() {
            Source::Bin => blob.take().ok_or_else(|| "the file has no binary chunk for it".to_owned()),
            Source::Uri(uri) => from_uri(uri, folder),
        };
        let whole = bytes.and_then(|bytes| match bytes.len() < buffer.length() {
            true => Err(format!("it has {} bytes of {}", bytes.len(), buffer.length())),
            false => Ok(bytes),
        });
        whole.map_err(|why| PlainError::Buffer { path: path.to_owned(), buffer: buffer.index(), why })
    });
    buffers.collect()
}

/// The bytes that a URI means: data, or a file in this folder or below.
pub(super) fn from_uri(uri: &str, folder: &Path) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (_, encoded) = data.split_once(";base64,").ok_or("only base64 data URIs are read")?;
        return STANDARD.decode(encoded).map_err(|_| "its base64 is damaged".to_owned());
    }
    let decoded = percent_decode_str(uri).decode_utf8().map_err(|_| "its name is not UTF-8")?;
    let name = PathBuf::from(decoded.as_ref());
    if !name.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
        return Err(format!("{} is not next to the glTF or below", name.display()));
    }
    fs::read(folder.join(&name)).map_err(|error| format!("{}: {error}", name.display()))
}
