//! Files and folders of a data folder.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use files::open_regular;
use sha2::{Digest, Sha256};

/// Length and SHA-256 of a file.
///
/// # Errors
/// As [`open_regular`].
pub fn digest(path: &Path) -> io::Result<(u64, [u8; 32])> {
    let mut hasher = Sha256::new();
    let size = io::copy(&mut open_regular(path)?, &mut hasher)?;
    Ok((size, hasher.finalize().into()))
}

/// Removes a file, if it exists.
///
/// # Errors
/// The operating system's.
pub fn remove_file(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Lists the files of a folder.
///
/// # Errors
/// The operating system's.
pub fn files_of(folder: &Path) -> io::Result<Vec<PathBuf>> {
    fs::read_dir(folder)?.map(|entry| entry.map(|entry| entry.path())).collect()
}

/// Syncs the names in a folder to disk.
///
/// # Errors
/// The operating system's.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    File::open(folder)?.sync_all()
}
