//! What a service is told at its start.

use std::path::PathBuf;
use std::time::Duration;

use crate::queue::Places;

/// Limits of what comes in and of what is kept.
#[derive(Debug, Clone)]
pub struct Limits {
    /// Jobs of one client that have not ended.
    pub jobs_of_a_client: usize,
    /// Bytes of one scene.
    pub upload_bytes: u64,
    /// Uploads of one client at the same time.
    pub uploads_of_a_client: usize,
    /// How long an upload may take.
    pub upload_time: Duration,
    /// How long an upload may be silent.
    pub upload_silence: Duration,
    /// Vertices that a job may ask for.
    pub vertices: u64,
    /// Memory for rows of one job, MiB.
    pub row_cache: usize,
    /// Bytes of one checkpoint.
    pub checkpoint_bytes: u64,
    /// Bytes of the light that a job leaves behind, for jobs that light the same scene otherwise.
    pub light_bytes: u64,
    /// Jobs that ended longer ago are forgotten.
    pub keep_age: Duration,
    /// Bytes of all files of the data folder: the oldest jobs that ended are forgotten beyond.
    pub keep_bytes: u64,
    /// Bytes of the disk that are left free: nothing is taken in when there are fewer.
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

/// What a service is told at its start.
#[derive(Debug, Clone)]
pub struct ServiceSettings {
    /// Where it keeps everything.
    pub data: PathBuf,
    /// How many jobs run at once.
    pub places: Places,
    /// Limits.
    pub limits: Limits,
}
