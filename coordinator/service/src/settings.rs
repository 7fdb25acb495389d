//! Settings of a service.

use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;

use crate::queue::Places;

/// Limits of requests, of running jobs and of the data folder.
#[derive(Debug, Clone)]
pub struct Limits {
    /// Unfinished jobs per client.
    pub jobs_of_a_client: usize,
    /// Bytes per scene.
    pub upload_bytes: u64,
    /// Concurrent uploads per client.
    pub uploads_of_a_client: usize,
    /// Longest duration of an upload.
    pub upload_time: Duration,
    /// Longest pause within an upload.
    pub upload_silence: Duration,
    /// Vertices per job.
    pub vertices: u64,
    /// Memory of the process of a job, in bytes; half of it is for rows, but no more than [`Self::MOST_ROWS`].
    pub memory: u64,
    /// Bytes per checkpoint.
    pub checkpoint_bytes: u64,
    /// Bytes of kept light per job, for relights.
    pub light_bytes: u64,
    /// Age at which ended jobs are deleted.
    pub keep_age: Duration,
    /// Bytes of the data folder, beyond which the oldest ended jobs are deleted.
    pub keep_bytes: u64,
    /// Free bytes of the disk, below which submissions are refused.
    pub free_bytes: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            jobs_of_a_client: 2000,
            upload_bytes: 1 << 30,
            uploads_of_a_client: 4,
            upload_time: Duration::from_secs(3600),
            upload_silence: Duration::from_secs(60),
            vertices: 2_000_000,
            memory: 4 << 30,
            checkpoint_bytes: 16 << 30,
            light_bytes: 256 << 20,
            keep_age: Duration::from_secs(30 * 24 * 3600),
            keep_bytes: 100 << 30,
            free_bytes: 1 << 30,
        }
    }
}

impl Limits {
    /// Most memory for the rows of a job, in MiB.
    pub const MOST_ROWS: u64 = 2048;

    /// Memory for the rows of a job, in MiB; others are computed again.
    #[must_use]
    pub fn row_cache(&self) -> u64 {
        (self.memory >> 21).min(Self::MOST_ROWS)
    }
}

/// Settings of a service.
#[derive(Debug, Clone)]
pub struct ServiceSettings {
    /// The command that runs a job, as [`crate::run_job`] does: a program and its first arguments.
    pub job_command: Vec<OsString>,
    /// The data folder.
    pub data: PathBuf,
    /// How many jobs run at the same time.
    pub places: Places,
    /// Limits.
    pub limits: Limits,
}
