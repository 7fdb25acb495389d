//! Files that one process has for itself.

use std::fs::{File, TryLockError};
use std::io;
use std::ops::Deref;

/// A file that this process has locked. Unlocked when dropped: closing it alone would leave it locked while a process that was forked
/// meanwhile has not begun its own program.
#[derive(Debug)]
pub struct LockedFile(File);

impl LockedFile {
    /// Locks a file; `None` where another holder has it.
    ///
    /// # Errors
    /// Where files cannot be locked, and where this is no regular one: reading from a pipe would wait without end.
    pub fn of(file: File) -> io::Result<Option<Self>> {
        super::regular::check_regular(&file.metadata()?)?;
        match file.try_lock() {
            Ok(()) => Ok(Some(Self(file))),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(error)) => Err(error),
        }
    }
}

impl Deref for LockedFile {
    type Target = File;

    fn deref(&self) -> &File {
        &self.0
    }
}

impl Drop for LockedFile {
    fn drop(&mut self) {
        // What cannot be unlocked is unlocked when the process ends.
        let _ = self.0.unlock();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A second descriptor of the same open file is what a forked process has.
    #[test]
    fn a_dropped_lock_is_free_even_where_a_descriptor_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lock");
        File::create(&path).unwrap();
        let lock = || LockedFile::of(File::open(&path).unwrap()).unwrap();
        let held = lock().unwrap();
        let inherited = held.try_clone().unwrap();
        assert!(lock().is_none());
        drop(held);
        assert!(lock().is_some());
        drop(inherited);
    }

    #[cfg(unix)]
    #[test]
    fn pipes_are_refused_before_anybody_waits() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        assert_eq!(crate::read_regular(&path).unwrap_err().kind(), io::ErrorKind::InvalidInput);
        let both_ways = File::options().read(true).write(true).open(&path).unwrap();
        assert_eq!(LockedFile::of(both_ways).unwrap_err().kind(), io::ErrorKind::InvalidInput);
    }
}
