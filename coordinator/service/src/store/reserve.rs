//! Room kept for changes of jobs: a full disk may refuse new jobs, but not that one is cancelled or has ended.

use std::fs::{self, OpenOptions};
use std::io::{self, Write};

use super::{Store, files, record, remove_file};
use crate::job::Record;
use crate::refusal::is_full;

/// Name of the file that holds the room.
pub(super) const RESERVE: &str = "reserve";

/// Bytes of the file: some records, and what a file system needs to write them.
const BYTES: usize = 1 << 20;

impl Store {
    /// Writes the changed record of a job, synced to disk; on a full disk, in the room kept for it.
    ///
    /// # Errors
    /// The operating system's; the record is then unchanged.
    pub fn change(&self, record: &Record) -> io::Result<()> {
        match self.write(record) {
            Err(error) if is_full(&error) => {
                remove_file(&self.root.join(RESERVE))?;
                tracing::warn!("the disk is full: the room kept for changes of jobs is in use");
                files::write(&self.record(record.id), &record::encode(record))
            }
            written => written,
        }
    }

    /// Makes room for changes of jobs, unless there is some. Without success where the disk is full: the next call tries again.
    pub fn reserve(&self) {
        let path = self.root.join(RESERVE);
        if fs::metadata(&path).is_ok_and(|there| there.len() == BYTES as u64) {
            return;
        }
        let make = || {
            let mut file = OpenOptions::new().write(true).create(true).truncate(true).open(&path)?;
            // Not zeros, for which some file systems take no room.
            let bytes: Vec<u8> =
                (0..BYTES as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
            file.write_all(&bytes).and_then(|()| file.sync_all())
        };
        if let Err(error) = make() {
            let _ = remove_file(&path);
            tracing::warn!(%error, "no room can be kept for changes of jobs: free some on the disk of --data");
        }
    }
}
