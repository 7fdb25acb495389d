//! Files that appear whole or not at all.

use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

pub use atomic_write_file::AtomicWriteFile;

/// Why an output cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// Its directory does not exist.
    #[error("output directory {} does not exist: create it, or choose another output", .0.display())]
    NoDirectory(PathBuf),
    /// It is a directory.
    #[error("output {} is a directory: name a file in it", .0.display())]
    IsDirectory(PathBuf),
    /// The operating system refuses.
    #[error("output {} cannot be written: {error}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        error: io::Error,
    },
}

/// Opens an output that replaces `path` when it is committed.
///
/// # Errors
/// When its directory does not exist, it is a directory, or the operating system refuses.
pub fn open(path: &Path) -> Result<AtomicWriteFile, FileError> {
    let directory = match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    if !directory.is_dir() {
        return Err(FileError::NoDirectory(directory.to_owned()));
    }
    if path.is_dir() {
        return Err(FileError::IsDirectory(path.to_owned()));
    }
    AtomicWriteFile::open(path).map_err(|error| FileError::Write { path: path.to_owned(), error })
}

/// Checks that an output can be written, and leaves nothing behind: for use before long work.
///
/// # Errors
/// As [`open`].
pub fn check(path: &Path) -> Result<(), FileError> {
    open(path)?.discard().map_err(|error| FileError::Write { path: path.to_owned(), error })
}

/// Replaces a file by `bytes`, on the disk when this returns. An error leaves the old file as it was.
///
/// # Errors
/// The operating system's.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    write_with(path, |out| out.write_all(bytes))
}

/// Replaces a file by what `content` writes, as [`write()`] does.
///
/// # Errors
/// The operating system's, and those of `content`.
pub fn write_with(
    path: &Path,
    content: impl FnOnce(&mut (dyn Write + Send)) -> io::Result<()>,
) -> io::Result<()> {
    let mut out = BufWriter::new(AtomicWriteFile::open(path)?);
    content(&mut out)?;
    out.into_inner()?.commit()
}
