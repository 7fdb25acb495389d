//! The bytes of every buffer: binary chunk, data URI, or a file next to the glTF.

use base64::Engine;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use gltf::json::Root;

use super::beside::{self, Folder, Unread};
use super::error::ImportProblem;

/// Padding is optional, because writers differ.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Characters of a URI that a message shows.
const SHOWN_URI: usize = 80;

/// Reads the buffers that are needed, each cut to its declared length; the others stay empty.
///
/// Relative references start at `folder`; without one, references to files are refused. External files together may have
/// `budget` bytes; `limit` is the number that messages state.
pub(crate) fn resolve(
    root: &Root,
    needed: impl Fn(usize) -> bool,
    mut blob: Option<Vec<u8>>,
    folder: Option<&Folder>,
    mut budget: u64,
    limit: u64,
) -> Result<Vec<Vec<u8>>, ImportProblem> {
    let mut buffers = Vec::new();
    for (index, buffer) in root.buffers.iter().enumerate() {
        if !needed(index) {
            buffers.push(Vec::new());
            continue;
        }
        let mut bytes = match &buffer.uri {
            // Only the first buffer may stand for the binary chunk.
            None => (index == 0)
                .then(|| blob.take())
                .flatten()
                .ok_or(ImportProblem::BufferMissing { buffer: index })?,
            Some(uri) => match uri.strip_prefix("data:") {
                Some(data) => decode_data_uri(data, index)?,
                None => {
                    let bytes = read_external(uri, folder, index, budget)?
                        .ok_or(ImportProblem::TooLarge { limit })?;
                    budget -= bytes.len() as u64;
                    bytes
                }
            },
        };
        let (declared, actual) = (buffer.byte_length.0, bytes.len() as u64);
        if actual < declared {
            return Err(ImportProblem::BufferTooShort { buffer: index, declared, actual });
        }
        bytes.truncate(declared as usize);
        buffers.push(bytes);
    }
    Ok(buffers)
}

/// Bytes of the buffers that were read from files beside the document.
pub(crate) fn bytes_beside(root: &Root, buffers: &[Vec<u8>]) -> u64 {
    let is_beside = |uri: &Option<String>| uri.as_ref().is_some_and(|uri| !uri.starts_with("data:"));
    let beside = root.buffers.iter().zip(buffers).filter(|(own, _)| is_beside(&own.uri));
    beside.map(|(_, bytes)| bytes.len() as u64).sum()
}

fn decode_data_uri(data: &str, buffer: usize) -> Result<Vec<u8>, ImportProblem> {
    let refused = |why| refuse(&format!("data:{data}"), buffer, why);
    data_uri_bytes(data).map_err(refused)
}

/// The bytes of a data URI, given without its scheme.
fn data_uri_bytes(data: &str) -> Result<Vec<u8>, &'static str> {
    let (_, encoded) = data.split_once(";base64,").ok_or("only base64 data URIs are read")?;
    BASE64.decode(encoded).map_err(|_| "its base64 is damaged")
}

/// Reads a file by its relative reference; `None` if it is larger than `budget`.
fn read_external(
    uri: &str,
    folder: Option<&Folder>,
    buffer: usize,
    budget: u64,
) -> Result<Option<Vec<u8>>, ImportProblem> {
    beside::read(uri, folder, budget).map_err(|unread| match unread {
        Unread::Refused(why) => refuse(uri, buffer, why),
        Unread::Failed(error) => ImportProblem::ExternalFile { buffer, uri: shorten(uri), error },
    })
}

/// Reads what the URI of an image stands for: a data URI, or a file of at most `limit` bytes.
///
/// # Errors
/// A reason, when the URI is damaged or refused, or the file cannot be read.
pub fn read_uri(uri: &str, folder: Option<&Folder>, limit: u64) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        return data_uri_bytes(data).map_err(str::to_owned);
    }
    let why = match beside::read(uri, folder, limit) {
        Ok(Some(bytes)) => return Ok(bytes),
        Ok(None) => format!("it has more than {limit} bytes"),
        Err(Unread::Refused(why)) => why.to_owned(),
        Err(Unread::Failed(error)) => error.to_string(),
    };
    Err(format!("{}: {why}", shorten(uri)))
}

fn refuse(uri: &str, buffer: usize, why: &'static str) -> ImportProblem {
    ImportProblem::RefusedUri { buffer, uri: shorten(uri), why }
}

/// A URI as messages show it.
fn shorten(uri: &str) -> String {
    match uri.char_indices().nth(SHOWN_URI) {
        Some((end, _)) => format!("{}...", &uri[..end]),
        None => uri.to_owned(),
    }
}
