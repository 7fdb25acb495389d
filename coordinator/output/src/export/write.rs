//! Files, all or nothing.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use gltf::Glb;
use gltf::binary::Header;
use gltf::json::Root;
use percent_encoding::{AsciiSet, CONTROLS, utf8_percent_encode};

use super::ExportError;
use files::FileError;

/// Characters of a file name that a relative URI must escape.
const NOT_IN_URI: &AsciiSet = &CONTROLS
    .add(b' ')
    .add(b'"')
    .add(b'#')
    .add(b'%')
    .add(b':')
    .add(b'<')
    .add(b'>')
    .add(b'?')
    .add(b'[')
    .add(b'\\')
    .add(b']')
    .add(b'^')
    .add(b'`')
    .add(b'{')
    .add(b'|')
    .add(b'}');

/// Formats of the output.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    Glb,
    Gltf,
    Ply,
}

/// Finds out whether the output can be written.
pub(super) fn check(path: &Path) -> Result<(), ExportError> {
    files(path)?.iter().try_for_each(|path| Ok(files::check(path)?))
}

/// Writes the document and its buffer as a `.gltf` where the extension says so, else as a `.glb`.
pub(super) fn write(mut root: Root, binary: Vec<u8>, path: &Path) -> Result<(), ExportError> {
    let contents = match format(path)? {
        Format::Glb | Format::Ply => vec![glb(&root, binary, path)?],
        Format::Gltf => {
            if let Some(buffer) = root.buffers.first_mut() {
                let name = binary_path(path);
                let name = name.file_name().unwrap_or_default().to_string_lossy();
                buffer.uri = Some(utf8_percent_encode(&name, NOT_IN_URI).to_string());
            }
            vec![root.to_vec_pretty()?, binary]
        }
    };
    write_files(contents, path)
}

/// Writes the files of an output, the document first.
pub(super) fn write_files(contents: Vec<Vec<u8>>, path: &Path) -> Result<(), ExportError> {
    // All contents are on the disk before the first file takes its name; the document is the last to do so.
    let written = files(path)?
        .into_iter()
        .zip(contents)
        .map(|(path, bytes)| {
            let mut file = files::open(&path)?;
            match file.write_all(&bytes).and_then(|()| file.as_file().sync_all()) {
                Ok(()) => Ok((file, path)),
                Err(error) => Err(FileError::Write { path, error }.into()),
            }
        })
        .collect::<Result<Vec<_>, ExportError>>()?;
    for (file, path) in written.into_iter().rev() {
        file.commit().map_err(|error| FileError::Write { path, error })?;
    }
    Ok(())
}

/// The files of an output, the document first.
pub(super) fn files(path: &Path) -> Result<Vec<PathBuf>, ExportError> {
    Ok(match format(path)? {
        Format::Glb | Format::Ply => vec![path.to_owned()],
        Format::Gltf => vec![path.to_owned(), binary_path(path)],
    })
}

/// The format of the path's extension.
pub(super) fn format(path: &Path) -> Result<Format, ExportError> {
    let extension = path.extension().map(|extension| extension.to_ascii_lowercase());
    match extension.as_ref().and_then(|extension| extension.to_str()) {
        Some("glb") => Ok(Format::Glb),
        Some("gltf") => Ok(Format::Gltf),
        Some("ply") => Ok(Format::Ply),
        _ => Err(ExportError::Extension(path.to_owned())),
    }
}

/// Where the buffer of a `.gltf` goes.
fn binary_path(path: &Path) -> PathBuf {
    path.with_extension("bin")
}

/// The document as a binary glTF.
fn glb(root: &Root, binary: Vec<u8>, path: &Path) -> Result<Vec<u8>, ExportError> {
    let json = root.to_vec()?;
    // Headers and padding take less than 64 bytes.
    let length = json.len() + binary.len() + 64;
    if length > u32::MAX as usize {
        return Err(ExportError::TooLarge(length));
    }
    let bin = (!binary.is_empty()).then_some(binary.into());
    // The length is computed on writing.
    let glb = Glb { header: Header { magic: *b"glTF", version: 2, length: 0 }, json: json.into(), bin };
    glb.to_vec()
        .map_err(|error| FileError::Write { path: path.to_owned(), error: io::Error::other(error) }.into())
}
