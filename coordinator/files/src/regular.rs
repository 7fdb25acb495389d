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
    check(&fs::metadata(path)?)?;
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

pub(crate) fn check(metadata: &Metadata) -> io::Result<()> {
    let refused = || io::Error::new(io::ErrorKind::InvalidInput, "it is no regular file");
    metadata.is_file().then_some(()).ok_or_else(refused)
}

#[cfg(all(test, unix))]
mod tests {
    use std::process::Command;

    use super::*;
    use crate::LockedFile;

    #[test]
    fn pipes_are_refused_before_anybody_waits() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pipe");
        assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
        assert_eq!(read_regular(&path).unwrap_err().kind(), io::ErrorKind::InvalidInput);
        let both_ways = File::options().read(true).write(true).open(&path).unwrap();
        assert_eq!(LockedFile::of(both_ways).unwrap_err().kind(), io::ErrorKind::InvalidInput);
    }
}
