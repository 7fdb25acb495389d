//! The bytes of every buffer: binary chunk, data URI, or a file next to the glTF.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

use base64::Engine;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use gltf::{Document, buffer};
use percent_encoding::percent_decode_str;

use super::error::ImportProblem;

/// Writers differ in whether they pad; both decode to one thing.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Longest part of a URI that a message repeats.
const SHOWN_URI: usize = 80;

/// Reads a whole file, or says that it is longer than `limit`. Never allocates for more than that.
pub(super) fn read_file(path: &Path, limit: u64) -> io::Result<Option<Vec<u8>>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    Ok((bytes.len() as u64 <= limit).then_some(bytes))
}

/// Resolves every buffer of the document, each cut to the length that it announces.
///
/// `folder` is where relative references start; without one, references to files are refused. `budget` is the number of
/// bytes that external files may have together, out of `limit`.
pub(super) fn resolve(
    document: &Document,
    mut blob: Option<Vec<u8>>,
    folder: Option<&Path>,
    mut budget: u64,
    limit: u64,
) -> Result<Vec<Vec<u8>>, ImportProblem> {
    let mut buffers = Vec::new();
    for buffer in document.buffers() {
        let mut bytes = match buffer.source() {
            // Only the first buffer may stand for the binary chunk.
            buffer::Source::Bin => (buffer.index() == 0)
                .then(|| blob.take())
                .flatten()
                .ok_or(ImportProblem::BufferMissing { buffer: buffer.index() })?,
            buffer::Source::Uri(uri) => match uri.strip_prefix("data:") {
                Some(data) => decode_data_uri(data, buffer.index())?,
                None => {
                    let bytes = read_external(uri, folder, buffer.index(), budget)?
                        .ok_or(ImportProblem::TooLarge { limit })?;
                    budget -= bytes.len() as u64;
                    bytes
                }
            },
        };
        if bytes.len() < buffer.length() {
            let (declared, actual) = (buffer.length() as u64, bytes.len() as u64);
            return Err(ImportProblem::BufferTooShort { buffer: buffer.index(), declared, actual });
        }
        bytes.truncate(buffer.length());
        buffers.push(bytes);
    }
    Ok(buffers)
}

fn decode_data_uri(data: &str, buffer: usize) -> Result<Vec<u8>, ImportProblem> {
    let refused = |why| refuse(&format!("data:{data}"), buffer, why);
    let (_, encoded) =
        data.split_once(";base64,").ok_or_else(|| refused("only base64 data URIs are read"))?;
    BASE64.decode(encoded).map_err(|_| refused("its base64 is damaged"))
}

/// Reads a file by its relative reference; `None` if it is larger than `budget`.
fn read_external(
    uri: &str,
    folder: Option<&Path>,
    buffer: usize,
    budget: u64,
) -> Result<Option<Vec<u8>>, ImportProblem> {
    let Some(folder) = folder else {
        return Err(refuse(uri, buffer, "a scene that did not come from a file may not refer to files"));
    };
    let path = folder.join(relative_path(uri).map_err(|why| refuse(uri, buffer, why))?);
    read_file(&path, budget).map_err(|error| ImportProblem::ExternalFile { buffer, uri: shorten(uri), error })
}

/// The path that a relative reference names, never outside the folder of the glTF.
fn relative_path(uri: &str) -> Result<PathBuf, &'static str> {
    let decoded = percent_decode_str(uri).decode_utf8().map_err(|_| "it is not UTF-8")?;
    if uri.split('/').next().is_some_and(|start| start.contains(':')) {
        return Err("only files next to the glTF are read, no other scheme");
    }
    // A backslash separates folders on one system and belongs to the name on another.
    if decoded.contains(['\\', '\0']) {
        return Err("it contains a backslash or a zero byte");
    }
    let path = PathBuf::from(decoded.as_ref());
    let inside = path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    if inside { Ok(path) } else { Err("it leads outside the folder of the glTF") }
}

fn refuse(uri: &str, buffer: usize, why: &'static str) -> ImportProblem {
    ImportProblem::RefusedUri { buffer, uri: shorten(uri), why }
}

fn shorten(uri: &str) -> String {
    match uri.char_indices().nth(SHOWN_URI) {
        Some((end, _)) => format!("{}...", &uri[..end]),
        None => uri.to_owned(),
    }
}
