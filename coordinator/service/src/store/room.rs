use std::fs;
use std::io;
use std::path::Path;
use std::time::{Duration, SystemTime};

use super::{Store, files_of};
use crate::job::{JobId, Record};

/// Disk usage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Room {
    /// Bytes of all files of the data folder, without those that were set aside.
    pub taken: u64,
    /// Free bytes of its disk.
    pub free: u64,
}

impl Store {
    /// Measures the disk usage.
    ///
    /// # Errors
    /// The operating system's.
    pub fn room(&self) -> io::Result<Room> {
        let mut taken = 0;
        for folder in super::FOLDERS {
            taken += files_of(&self.root.join(folder))?.iter().map(|path| size(path)).sum::<u64>();
        }
        Ok(Room { taken, free: self.free()? })
    }

    /// Returns the free bytes of the disk.
    ///
    /// # Errors
    /// The operating system's.
    pub fn free(&self) -> io::Result<u64> {
        let disk = rustix::fs::statvfs(&self.root)?;
        Ok(disk.f_bavail.saturating_mul(disk.f_frsize))
    }

    /// Returns the bytes that the rows of a job may take where so many may run at the same time: of what the disk has, each gets one part,
    /// and one is left. Their lit files must find room, or they would wait for ever for what their own rows take.
    #[must_use]
    pub fn room_for_rows(&self, job: JobId, jobs: usize) -> u64 {
        let parts = (jobs as u64).saturating_add(1);
        self.free().map_or(u64::MAX, |free| free.saturating_add(size(&self.checkpoint(job))) / parts)
    }

    /// Returns the bytes that deleting this job frees, without its scene, if no other job uses its light.
    #[must_use]
    pub fn size_of(&self, record: &Record) -> u64 {
        let own =
            [self.record(record.id), self.result(record), self.checkpoint(record.id), self.light(record.id)];
        own.iter().map(|path| size(path)).sum()
    }
}

/// Returns the size of a file, 0 if it is gone.
fn size(path: &Path) -> u64 {
    fs::metadata(path).map_or(0, |file| file.len())
}

/// Selects the jobs to delete: those that ended longer ago than `keep_age`, then the oldest until enough bytes are freed. `ended`
/// lists jobs with the time at which they ended and their size. Pure.
#[must_use]
pub fn expired(
    mut ended: Vec<(JobId, SystemTime, u64)>,
    now: SystemTime,
    keep_age: Duration,
    mut too_many_bytes: u64,
) -> Vec<JobId> {
    ended.sort_by_key(|(_, time, _)| *time);
    let mut gone = vec![];
    for (job, time, bytes) in ended {
        let age = now.duration_since(time).unwrap_or_default();
        if age <= keep_age && too_many_bytes == 0 {
            continue;
        }
        too_many_bytes = too_many_bytes.saturating_sub(bytes);
        gone.push(job);
    }
    gone
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_go_first_and_no_more_than_must() {
        let now = SystemTime::UNIX_EPOCH + Duration::from_secs(1000);
        let at = |second| SystemTime::UNIX_EPOCH + Duration::from_secs(second);
        let ended = || vec![(JobId(3), at(900), 10), (JobId(1), at(100), 10), (JobId(2), at(800), 10)];
        let gone = |age, bytes| expired(ended(), now, Duration::from_secs(age), bytes);
        assert_eq!(gone(2000, 0), []);
        assert_eq!(gone(500, 0), [JobId(1)]);
        assert_eq!(gone(2000, 11), [JobId(1), JobId(2)]);
        assert_eq!(gone(500, 11), [JobId(1), JobId(2)]);
        assert_eq!(gone(0, 0), [JobId(1), JobId(2), JobId(3)]);
        // A time in the future counts as age 0.
        assert_eq!(expired(vec![(JobId(1), at(2000), 1)], now, Duration::ZERO, 0), []);
    }
}
