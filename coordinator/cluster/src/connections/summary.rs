//! Results of jobs, and summaries of what each worker did.

use std::time::Duration;

use kernel::picture::FinishedTile;
use kernel::row::{FinishedJob, JobId};

/// The answer to a job of either kind.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum FinishedWork {
    /// Rows of form factors.
    Rows(FinishedJob),
    /// A tile of a picture.
    Tile(FinishedTile),
}

impl FinishedWork {
    /// The job.
    pub(super) fn job(&self) -> JobId {
        match self {
            Self::Rows(rows) => rows.job,
            Self::Tile(tile) => tile.job,
        }
    }

    /// The same under another id.
    pub(super) fn named(self, job: JobId) -> Self {
        match self {
            Self::Rows(rows) => Self::Rows(FinishedJob { job, ..rows }),
            Self::Tile(tile) => Self::Tile(FinishedTile { job, ..tile }),
        }
    }

    /// Rows in it.
    pub(super) fn rows(&self) -> u64 {
        match self {
            Self::Rows(rows) => rows.statistics.len() as u64,
            Self::Tile(_) => 0,
        }
    }

    /// Rays cast for it.
    pub(super) fn rays(&self) -> u64 {
        match self {
            Self::Rows(rows) => rows.statistics.iter().map(|row| row.rays).sum(),
            Self::Tile(tile) => tile.rays,
        }
    }

    /// Computing time of one thread.
    pub(super) fn busy(&self) -> Duration {
        Duration::from_nanos(match self {
            Self::Rows(rows) => rows.statistics.iter().map(|row| row.busy_nanoseconds).sum(),
            Self::Tile(tile) => tile.busy_nanoseconds,
        })
    }
}

/// Work of the worker at one address whose results were used.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct WorkerPart {
    /// Its name, by its own account.
    pub name: String,
    /// Its address.
    pub address: String,
    /// Number of jobs that it computes at the same time.
    pub threads: usize,
    /// Jobs that it answered first.
    pub jobs: u64,
    /// Rows in its jobs.
    pub rows: u64,
    /// Rays cast for them.
    pub rays: u64,
    /// Computing time, summed over its threads.
    pub busy: Duration,
    /// Length of the encoded rows, in bytes.
    pub bytes_received: u64,
}

impl WorkerPart {
    /// Adds a job that it answered first.
    pub(super) fn add(&mut self, work: &FinishedWork, bytes: u64) {
        self.jobs += 1;
        self.rows += work.rows();
        self.rays += work.rays();
        self.busy += work.busy();
        self.bytes_received += bytes;
    }
}

/// All work of the worker at one address.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WorkerSummary {
    /// Work whose results were used; time computed and bytes received include answers that came
    /// late or to withdrawn jobs.
    pub part: WorkerPart,
    /// Number of times that it connected: once, if it was never lost.
    pub connections: u64,
    /// Time that it was connected.
    pub connected: Duration,
    /// Jobs that another worker had answered before.
    pub late: u64,
    /// Length of the replicas and jobs sent, in bytes.
    pub bytes_sent: u64,
    /// Why it is lost, where it is.
    pub lost: Option<String>,
}

impl WorkerSummary {
    pub(super) fn new(name: String, address: String, threads: usize) -> Self {
        Self {
            part: WorkerPart { name, address, threads, ..WorkerPart::default() },
            connections: 0,
            connected: Duration::ZERO,
            late: 0,
            bytes_sent: 0,
            lost: None,
        }
    }
}

/// First answer to a job.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Delivery {
    /// The rows or the tile.
    pub(super) work: FinishedWork,
    /// Name, address and threads of the worker.
    pub(super) by: (String, String, usize),
    /// Length of its answer in bytes.
    pub(super) bytes: u64,
}

impl Delivery {
    /// Adds it to the account of its worker.
    pub(super) fn add_to(&self, parts: &mut Vec<WorkerPart>) {
        let (name, address, threads) = &self.by;
        let known = parts.iter().position(|part| part.address == *address);
        let index = known.unwrap_or_else(|| {
            parts.push(WorkerPart { address: address.clone(), ..WorkerPart::default() });
            parts.len() - 1
        });
        let part = &mut parts[index];
        (part.name, part.threads) = (name.clone(), *threads);
        part.add(&self.work, self.bytes);
    }
}

/// Counts over all workers of a cluster.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ClusterCounts {
    /// Jobs sent a second time, to an idle worker.
    pub duplicates: u64,
    /// Answers that came late or twice.
    pub ignored_answers: u64,
    /// Times that a worker was lost without a goodbye.
    pub lost_workers: u64,
    /// Replicas that workers passed on to each other.
    pub passed_replicas: u64,
}
