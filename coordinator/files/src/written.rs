//! Files that appear whole or not at all.

use std::fs;
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
    /// It is a file that is read, or another output.
    #[error("{name} {} is the {other} itself: choose another {name}", path.display())]
    Taken {
        /// What it is, in words.
        name: &'static str,
        /// The file.
        path: PathBuf,
        /// What it is, too.
        other: &'static str,
    },
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
/// When its directory does not exist, there is something that is no regular file, or the operating system refuses.
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
    replace(path).map_err(|error| FileError::Write { path: path.to_owned(), error })
}

/// Opens a file that replaces the one at `path` when it is committed. A link stays: the file that it leads to is replaced.
///
/// # Errors
/// When there is something that is no regular file, such as a device or a link to nothing, or the operating system refuses.
pub fn replace(path: &Path) -> io::Result<AtomicWriteFile> {
    let refused = |why| Err(io::Error::new(io::ErrorKind::InvalidInput, why));
    let is_link = fs::symlink_metadata(path).is_ok_and(|there| there.is_symlink());
    match fs::metadata(path) {
        Ok(there) if !there.is_file() => refused("it exists and is no regular file: name another place"),
        Err(_) if is_link => refused("it is a link that leads nowhere: remove it, or name another place"),
        Ok(_) if is_link => AtomicWriteFile::open(fs::canonicalize(path)?),
        _ => AtomicWriteFile::open(path),
    }
}

/// Checks that no output is a file that is read, or another output, by whatever spelling or link. Each comes with its name in words,
/// those that are read first.
///
/// # Errors
/// When two are the same, of which one is written.
pub fn check_distinct(
    read: &[(&'static str, &Path)],
    written: &[(&'static str, &Path)],
) -> Result<(), FileError> {
    for (index, (name, path)) in written.iter().enumerate() {
        let mut others = read.iter().chain(&written[..index]);
        if let Some((other, _)) = others.find(|(_, other)| is_same(other, path)) {
            return Err(FileError::Taken { name, path: path.to_path_buf(), other });
        }
    }
    Ok(())
}

/// Whether two paths lead to one file, or would where none is yet.
fn is_same(a: &Path, b: &Path) -> bool {
    place(a) == place(b) || identity(a).is_some_and(|own| identity(b) == Some(own))
}

/// A path without links, as far as there is something.
fn place(path: &Path) -> PathBuf {
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    fs::canonicalize(&whole).unwrap_or_else(|_| {
        let folder = whole.parent().and_then(|folder| fs::canonicalize(folder).ok());
        folder.zip(whole.file_name()).map_or_else(|| whole.clone(), |(folder, name)| folder.join(name))
    })
}

/// The disk and the number of a file there: hard links have the same.
#[cfg(unix)]
fn identity(path: &Path) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    fs::metadata(path).ok().map(|file| (file.dev(), file.ino()))
}

/// Other systems do not tell.
#[cfg(not(unix))]
fn identity(_: &Path) -> Option<(u64, u64)> {
    None
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
    let mut out = BufWriter::new(replace(path)?);
    content(&mut out)?;
    out.into_inner()?.commit()
}
