//! What a service and the process of a job tell each other. Both are the same program: these messages need no versions.

use std::time::Duration;

use bake::{Progress, ThreadTime};
use bytes::Bytes;
use cluster::WorkerPart;
use kernel::messages::{Finished, ReplicaKind, RowJob};
use kernel::row::{FinishedJob, encode_row};
use prost::{Message, Oneof};
use protocol::api::{Outcome, Phase};

/// From the service to the job.
#[derive(Clone, PartialEq, Message)]
pub struct ToJob {
    /// Which of them.
    #[prost(oneof = "Order", tags = "1, 2, 3, 4, 5, 6")]
    pub order: Option<Order>,
}

/// An order, or an answer.
#[derive(Clone, PartialEq, Oneof)]
pub enum Order {
    /// First of all: the job.
    #[prost(message, tag = "1")]
    Begin(Begin),
    /// The workers and the watchers, whenever they change.
    #[prost(message, tag = "2")]
    Surroundings(Surroundings),
    /// Rows of one job of the cluster; the digest is empty.
    #[prost(message, tag = "3")]
    Rows(Finished),
    /// No more rows.
    #[prost(message, tag = "4")]
    NoRows(NoRows),
    /// The answer to [`Word::AskWorkers`].
    #[prost(message, tag = "5")]
    Workers(Workers),
    /// Export the latest preview.
    #[prost(message, tag = "6")]
    ExportPreview(ExportPreview),
}

/// A job and its limits.
#[derive(Clone, PartialEq, Message)]
pub struct Begin {
    /// The data folder.
    #[prost(bytes = "vec", tag = "1")]
    pub data: Vec<u8>,
    /// The job's identifier.
    #[prost(string, tag = "2")]
    pub job: String,
    /// Its record, as it is stored.
    #[prost(bytes = "vec", tag = "3")]
    pub record: Vec<u8>,
    /// Memory for rows, in MiB.
    #[prost(uint64, tag = "4")]
    pub row_cache: u64,
    /// Bytes of kept light.
    #[prost(uint64, tag = "5")]
    pub light_bytes: u64,
    /// Bytes of the checkpoint.
    #[prost(uint64, tag = "6")]
    pub checkpoint_bytes: u64,
    /// Bytes of memory that the job may take.
    #[prost(uint64, tag = "8")]
    pub memory: u64,
    /// As of now.
    #[prost(message, required, tag = "7")]
    pub surroundings: Surroundings,
}

/// What a job must know of the world.
#[derive(Clone, Copy, PartialEq, Eq, Message)]
pub struct Surroundings {
    /// Rows that the workers compute at the same time.
    #[prost(uint64, tag = "1")]
    pub threads: u64,
    /// Whether somebody wants previews.
    #[prost(bool, tag = "2")]
    pub is_watched: bool,
    /// Jobs that keep all of them busy.
    #[prost(uint64, tag = "3")]
    pub jobs_ahead: u64,
    /// What the threads of the workers did so far.
    #[prost(message, required, tag = "4")]
    pub time: Time,
}

/// A [`bake::ThreadTime`], in nanoseconds.
#[derive(Clone, Copy, PartialEq, Eq, Message)]
pub struct Time {
    #[prost(uint64, tag = "1")]
    pub connected: u64,
    #[prost(uint64, tag = "2")]
    pub occupied: u64,
    #[prost(uint64, tag = "3")]
    pub loading: u64,
    #[prost(uint64, tag = "4")]
    pub busy: u64,
}

/// Why rows cannot be had.
#[derive(Clone, PartialEq, Message)]
pub struct NoRows {
    /// The same job would fail again.
    #[prost(bool, tag = "1")]
    pub is_final: bool,
    /// Words for people.
    #[prost(string, tag = "2")]
    pub message: String,
}

/// Work of each worker for a job.
#[derive(Clone, PartialEq, Message)]
pub struct Workers {
    /// In the order of their first answers.
    #[prost(message, repeated, tag = "1")]
    pub parts: Vec<Part>,
}

/// Work of one worker: a [`cluster::WorkerPart`].
#[derive(Clone, PartialEq, Message)]
pub struct Part {
    #[prost(string, tag = "1")]
    pub name: String,
    #[prost(string, tag = "2")]
    pub address: String,
    #[prost(uint64, tag = "3")]
    pub threads: u64,
    #[prost(uint64, tag = "4")]
    pub jobs: u64,
    #[prost(uint64, tag = "5")]
    pub rows: u64,
    #[prost(uint64, tag = "6")]
    pub rays: u64,
    #[prost(uint64, tag = "7")]
    pub busy_nanoseconds: u64,
    #[prost(uint64, tag = "8")]
    pub bytes_received: u64,
}

/// A file to write.
#[derive(Clone, PartialEq, Message)]
pub struct ExportPreview {
    /// Its path.
    #[prost(bytes = "vec", tag = "1")]
    pub path: Vec<u8>,
}

/// From a job to its service.
#[derive(Clone, PartialEq, Message)]
pub struct FromJob {
    /// Which of them.
    #[prost(oneof = "Word", tags = "1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12")]
    pub word: Option<Word>,
}

/// What a job says.
#[derive(Clone, PartialEq, Oneof)]
pub enum Word {
    /// See [`bake::RowService::publish`].
    #[prost(message, tag = "1")]
    Publish(Replica),
    /// See [`bake::RowService::release`]: a digest.
    #[prost(bytes = "bytes", tag = "2")]
    Release(Bytes),
    /// See [`bake::RowService::submit`].
    #[prost(message, tag = "3")]
    Submit(Submit),
    /// See [`bake::RowService::withdraw`].
    #[prost(bool, tag = "4")]
    Withdraw(bool),
    /// What did each worker do?
    #[prost(bool, tag = "5")]
    AskWorkers(bool),
    /// It enters a phase outside the bake.
    #[prost(enumeration = "Phase", tag = "6")]
    Enter(i32),
    /// Progress of the bake.
    #[prost(message, tag = "7")]
    Progress(BakeProgress),
    /// There is a preview of this number.
    #[prost(uint64, tag = "8")]
    Preview(u64),
    /// The answer to [`Order::ExportPreview`].
    #[prost(message, tag = "9")]
    Exported(Exported),
    /// The end: the lit file is written.
    #[prost(message, tag = "10")]
    Done(Outcome),
    /// The end: why it cannot be baked.
    #[prost(string, tag = "11")]
    Failed(String),
    /// The end for now: why it must be tried again.
    #[prost(string, tag = "12")]
    Later(String),
}

/// A [`kernel::replica::EncodedReplica`].
#[derive(Clone, PartialEq, Message)]
pub struct Replica {
    #[prost(bytes = "bytes", tag = "1")]
    pub digest: Bytes,
    #[prost(enumeration = "ReplicaKind", tag = "2")]
    pub kind: i32,
    #[prost(bytes = "bytes", tag = "3")]
    pub bytes: Bytes,
}

/// Rows to compute, the urgent first.
#[derive(Clone, PartialEq, Message)]
pub struct Submit {
    #[prost(message, repeated, tag = "1")]
    pub jobs: Vec<RowJob>,
}

/// A [`bake::Progress`], with the phase of the API.
#[derive(Clone, Copy, PartialEq, Message)]
pub struct BakeProgress {
    #[prost(enumeration = "Phase", tag = "1")]
    pub phase: i32,
    #[prost(double, tag = "2")]
    pub unshot: f64,
    #[prost(double, optional, tag = "3")]
    pub error: Option<f64>,
    #[prost(uint64, tag = "4")]
    pub rows: u64,
    #[prost(uint64, tag = "5")]
    pub rows_needed: u64,
    #[prost(uint64, tag = "6")]
    pub rays: u64,
    #[prost(uint64, tag = "7")]
    pub vertices: u64,
    /// How its wall time divides.
    #[prost(message, optional, tag = "8")]
    pub time: Option<TimeParts>,
}

/// A [`bake::TimeParts`].
#[derive(Clone, Copy, PartialEq, Message)]
pub struct TimeParts {
    #[prost(double, tag = "1")]
    pub rows: f64,
    #[prost(double, tag = "2")]
    pub other_rows: f64,
    #[prost(double, tag = "3")]
    pub network: f64,
    #[prost(double, tag = "4")]
    pub waiting: f64,
    #[prost(double, tag = "5")]
    pub own: f64,
}

/// An exported preview.
#[derive(Clone, PartialEq, Message)]
pub struct Exported {
    /// Its path.
    #[prost(bytes = "vec", tag = "1")]
    pub path: Vec<u8>,
    /// Its number.
    #[prost(uint64, tag = "2")]
    pub number: u64,
    /// Why it cannot be written, if so.
    #[prost(string, tag = "3")]
    pub failure: String,
}

impl From<&Progress> for BakeProgress {
    fn from(progress: &Progress) -> Self {
        Self {
            phase: api_phase(progress.phase).into(),
            unshot: progress.unshot,
            error: progress.error,
            rows: progress.rows,
            rows_needed: progress.rows_needed,
            rays: progress.rays,
            vertices: progress.vertices as u64,
            time: Some(progress.time.into()),
        }
    }
}

impl BakeProgress {
    /// As the bake reported it; `None` outside of a bake.
    pub fn of_bake(&self) -> Option<Progress> {
        let phase = bake::Phase::ALL.into_iter().find(|phase| api_phase(*phase) == self.phase())?;
        Some(Progress {
            phase,
            unshot: self.unshot,
            error: self.error,
            rows: self.rows,
            rows_needed: self.rows_needed,
            rays: self.rays,
            vertices: self.vertices as usize,
            time: self.time.unwrap_or_default().into(),
        })
    }
}

impl From<bake::TimeParts> for TimeParts {
    fn from(bake::TimeParts { rows, other_rows, network, waiting, own }: bake::TimeParts) -> Self {
        Self { rows, other_rows, network, waiting, own }
    }
}

impl From<TimeParts> for bake::TimeParts {
    fn from(TimeParts { rows, other_rows, network, waiting, own }: TimeParts) -> Self {
        Self { rows, other_rows, network, waiting, own }
    }
}

impl From<ThreadTime> for Time {
    fn from(ThreadTime { connected, occupied, loading, busy }: ThreadTime) -> Self {
        // Of 256 threads in two years.
        let [connected, occupied, loading, busy] = [connected, occupied, loading, busy]
            .map(|time| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
        Self { connected, occupied, loading, busy }
    }
}

impl From<Time> for ThreadTime {
    fn from(Time { connected, occupied, loading, busy }: Time) -> Self {
        let [connected, occupied, loading, busy] =
            [connected, occupied, loading, busy].map(Duration::from_nanos);
        Self { connected, occupied, loading, busy }
    }
}

fn api_phase(phase: bake::Phase) -> Phase {
    match phase {
        bake::Phase::Light => Phase::Light,
        bake::Phase::Shoot => Phase::Shoot,
        bake::Phase::Refine => Phase::Refine,
        bake::Phase::Measure => Phase::Measure,
        bake::Phase::FinalSolve => Phase::FinalSolve,
        bake::Phase::Groups => Phase::Groups,
        bake::Phase::Lightmap => Phase::Lightmap,
        bake::Phase::Probes => Phase::Probes,
        bake::Phase::ExportMesh => Phase::ExportMesh,
    }
}

impl From<FinishedJob> for Order {
    fn from(FinishedJob { job, rows, statistics }: FinishedJob) -> Self {
        let rows = rows.iter().map(encode_row).collect();
        Self::Rows(Finished { job_id: job.0, rows, statistics, ..Finished::default() })
    }
}

impl From<WorkerPart> for Part {
    fn from(part: WorkerPart) -> Self {
        Self {
            name: part.name,
            address: part.address,
            threads: part.threads as u64,
            jobs: part.jobs,
            rows: part.rows,
            rays: part.rays,
            busy_nanoseconds: part.busy.as_nanos() as u64,
            bytes_received: part.bytes_received,
        }
    }
}

impl From<Part> for WorkerPart {
    fn from(part: Part) -> Self {
        Self {
            name: part.name,
            address: part.address,
            threads: part.threads as usize,
            jobs: part.jobs,
            rows: part.rows,
            rays: part.rays,
            busy: Duration::from_nanos(part.busy_nanoseconds),
            bytes_received: part.bytes_received,
        }
    }
}
