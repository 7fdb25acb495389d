//! Room kept for changes of jobs: a full disk may refuse new jobs, but not that one is cancelled or has ended.

use std::fs::{self, OpenOptions};
use std::io::{self, Write};

use super::{Store, record};
use crate::job::Record;
use crate::refusal::is_full;
use crate::sync::lock;

/// Name of the file that holds the room.
pub(super) const RESERVE: &str = "reserve";

/// Bytes of the file.
const BYTES: u64 = 128 << 10;

/// Bytes of it that a change takes: a record, and what a file system needs to write it.
const SHARE: u64 = 16 << 10;

impl Store {
    /// Writes the changed record of a job, synced to disk; on a full disk, in the room kept for it.
    ///
    /// # Errors
    /// The operating system's; the record is then unchanged.
    pub fn change(&self, record: &Record) -> io::Result<()> {
        match self.write(record) {
            Err(error) if is_full(&error) => {
                let _spending = lock(&self.lacks_room);
                if self.spend().is_err() {
                    return Err(error);
                }
                tracing::warn!("the disk is full: a change of a job takes room that was kept for it");
                files::write(&self.record(record.id), &record::encode(record))
            }
            written => written,
        }
    }

    /// Gives a share of the room back to the disk. The rest stays: running jobs would fill it.
    fn spend(&self) -> io::Result<()> {
        let file = OpenOptions::new().write(true).open(self.root.join(RESERVE))?;
        file.set_len(file.metadata()?.len().saturating_sub(SHARE))
    }

    /// Makes room for changes of jobs, unless there is some. Returns whether there is all of it: where the disk is full there is not,
    /// and new jobs must not take what was kept.
    pub fn reserve(&self) -> bool {
        let mut lacks_room = lock(&self.lacks_room);
        let path = self.root.join(RESERVE);
        if fs::metadata(&path).is_ok_and(|there| there.len() == BYTES) {
            return true;
        }
        let make = || {
            let mut file = OpenOptions::new().append(true).create(true).open(&path)?;
            let before = file.metadata()?.len();
            // Not zeros, for which some file systems take no room.
            let byte = |at: u64| (at as u32).wrapping_mul(2_654_435_761).to_le_bytes()[3];
            let bytes: Vec<u8> = (before..BYTES).map(byte).collect();
            file.write_all(&bytes).and_then(|()| file.sync_all()).or_else(|error| {
                file.set_len(before)?;
                Err(error)
            })
        };
        let made = make();
        if let Err(error) = &made
            && !*lacks_room
        {
            // Once: every submission asks.
            tracing::warn!(%error, "too little room is kept for changes of jobs: free some on the disk of --data");
        }
        *lacks_room = made.is_err();
        made.is_ok()
    }
}
