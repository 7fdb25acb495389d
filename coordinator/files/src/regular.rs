//! Files whose reading ends: a pipe in the place of a file would be waited for without end.

use std::fs::{self, File, Metadata};
use std::io::{self, Read};
use std::path::Path;

/// Opens a regular file.
///
/// # Errors
/// The operating system's, and where there is something else.
pub fn open_regular(path: &Path) -> io::Result<File> {
    // Before it is opened: opening a pipe waits, too.
    check_regular(&fs::metadata(path)?)?;
    File::open(path)
}

/// Reads a regular file.
///
/// # Errors
/// As [`open_regular`].
pub fn read_regular(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = vec![];
    open_regular(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Whether there is something that is no regular file.
#[must_use]
pub fn is_irregular(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|there| !there.is_file())
}

pub(crate) fn check_regular(metadata: &Metadata) -> io::Result<()> {
    let refused = || io::Error::new(io::ErrorKind::InvalidInput, "it is no regular file");
    metadata.is_file().then_some(()).ok_or_else(refused)
}
