//! Settings of a service.

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
    /// Memory for the rows of one job, in MiB.
    pub row_cache: usize,
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
            row_cache: 2048,
            checkpoint_bytes: 16 << 30,
            light_bytes: 256 << 20,
            keep_age: Duration::from_secs(30 * 24 * 3600),
            keep_bytes: 100 << 30,
            free_bytes: 1 << 30,
        }
    }
}

/// Settings of a service.
#[derive(Debug, Clone)]
pub struct ServiceSettings {
    /// The data folder.
    pub data: PathBuf,
    /// How many jobs run at the same time.
    pub places: Places,
    /// Limits.
    pub limits: Limits,
}
