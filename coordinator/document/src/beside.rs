//! Files beside a document: its buffers and images, read from its folder only unless more is allowed.

use std::borrow::Cow;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

use gltf::json::Root;
use percent_encoding::percent_decode_str;
use serde::Deserialize;

/// Why documents from memory may not refer to files.
const WITHOUT_FOLDER: &str = "a scene that did not come from a file may not refer to files";

/// Why a reference is refused that leads to another place.
const OUTSIDE: &str = "it leads outside the folder of the glTF, which --outside-files allows";

/// Bytes of a GLB before its JSON: the header, then length and type of the chunk.
const BEFORE_JSON: usize = 20;

/// The folder of a document.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Folder {
    path: PathBuf,
    reads_outside: bool,
}

/// Why a file beside a document is not read.
#[derive(Debug)]
pub(crate) enum Unread {
    /// For safety.
    Refused(&'static str),
    /// The operating system's error.
    Failed(io::Error),
}

impl From<&'static str> for Unread {
    fn from(why: &'static str) -> Self {
        Self::Refused(why)
    }
}

impl From<io::Error> for Unread {
    fn from(error: io::Error) -> Self {
        Self::Failed(error)
    }
}

impl Folder {
    /// The folder of a document's file. `reads_outside`: whether files elsewhere are read too, by `..`, absolute paths or links.
    #[must_use]
    pub fn of(file: &Path, reads_outside: bool) -> Self {
        Self { path: file.parent().unwrap_or(Path::new("")).to_owned(), reads_outside }
    }

    /// The folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Reads a regular file by its relative reference; `None` if it is longer than `limit` bytes. Links are resolved before it is
    /// asked whether the file lies in the folder: a FIFO would never end, a device has no end.
    pub(crate) fn read(&self, uri: &str, limit: u64) -> Result<Option<Vec<u8>>, Unread> {
        let relative = relative_path(uri)?;
        if !self.reads_outside && !stays_inside(&relative) {
            return Err(OUTSIDE.into());
        }
        let file = fs::canonicalize(self.path.join(relative))?;
        if !self.reads_outside && !file.starts_with(whole(&self.path)?) {
            return Err(OUTSIDE.into());
        }
        if !fs::metadata(&file)?.is_file() {
            return Err("it is no regular file".into());
        }
        Ok(read_file(&file, limit)?)
    }
}

/// A folder without links; the empty path is the folder of the process.
fn whole(folder: &Path) -> io::Result<PathBuf> {
    fs::canonicalize(if folder == Path::new("") { Path::new(".") } else { folder })
}

/// Reads a whole file; `None` if it is longer than `limit` bytes, which it never allocates.
pub(crate) fn read_file(path: &Path, limit: u64) -> io::Result<Option<Vec<u8>>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    Ok((bytes.len() as u64 <= limit).then_some(bytes))
}

/// Reads what the URI of a buffer or an image names: a file of at most `limit` bytes; `None` if it is longer.
pub(crate) fn read(uri: &str, folder: Option<&Folder>, limit: u64) -> Result<Option<Vec<u8>>, Unread> {
    folder.ok_or(Unread::Refused(WITHOUT_FOLDER))?.read(uri, limit)
}

/// Files that a document in this folder has its buffers and images in.
#[must_use]
pub fn files_beside(root: &Root, folder: &Path) -> Vec<PathBuf> {
    let buffers = root.buffers.iter().map(|buffer| &buffer.uri);
    let uris = buffers.chain(root.images.iter().map(|image| &image.uri)).flatten();
    places(uris.map(String::as_str), folder)
}

/// The same of a file that is not read otherwise; none where it is no glTF.
#[must_use]
pub fn files_beside_file(path: &Path) -> Vec<PathBuf> {
    let Some(json) = json_of(path) else { return vec![] };
    let Ok(Uris { buffers, images }) = serde_json::from_slice(&json) else { return vec![] };
    let uris = buffers.iter().chain(&images).filter_map(|part| part.uri.as_deref());
    places(uris, path.parent().unwrap_or(Path::new("")))
}

/// The parts of a document that may name files.
#[derive(Deserialize)]
#[serde(default)]
#[derive(Default)]
struct Uris<'a> {
    #[serde(borrow)]
    buffers: Vec<Part<'a>>,
    #[serde(borrow)]
    images: Vec<Part<'a>>,
}

#[derive(Deserialize)]
struct Part<'a> {
    #[serde(borrow)]
    uri: Option<Cow<'a, str>>,
}

/// The JSON of a regular file; nothing else is opened, since what is read from a FIFO is gone.
fn json_of(path: &Path) -> Option<Vec<u8>> {
    if !fs::metadata(path).ok()?.is_file() {
        return None;
    }
    let mut file = File::open(path).ok()?;
    let mut bytes = Vec::new();
    file.by_ref().take(BEFORE_JSON as u64).read_to_end(&mut bytes).ok()?;
    if !bytes.starts_with(b"glTF") {
        // Other files may be as large as they like: they are no scenes.
        let is_json = bytes.iter().find(|byte| !byte.is_ascii_whitespace()) == Some(&b'{');
        let most = crate::ReadOptions::default().max_bytes;
        file.take(if is_json { most } else { 0 }).read_to_end(&mut bytes).ok()?;
        return is_json.then_some(bytes);
    }
    let length = u32::from_le_bytes(*bytes.get(12..)?.first_chunk()?);
    bytes.clear();
    file.take(u64::from(length)).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

fn places<'a>(uris: impl Iterator<Item = &'a str>, folder: &Path) -> Vec<PathBuf> {
    let beside = uris.filter(|uri| !uri.starts_with("data:"));
    beside.filter_map(|uri| Some(folder.join(relative_path(uri).ok()?))).collect()
}

/// The path that a reference names.
fn relative_path(uri: &str) -> Result<PathBuf, &'static str> {
    let decoded = percent_decode_str(uri).decode_utf8().map_err(|_| "it is not UTF-8")?;
    if uri.split('/').next().is_some_and(|start| start.contains(':')) {
        return Err("only files next to the glTF are read, no other scheme");
    }
    // A backslash separates folders on one system and belongs to the name on another.
    if decoded.contains(['\\', '\0']) {
        return Err("it contains a backslash or a zero byte");
    }
    Ok(PathBuf::from(decoded.as_ref()))
}

/// Whether a path names a place in its folder or below, links aside.
fn stays_inside(path: &Path) -> bool {
    path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
}
