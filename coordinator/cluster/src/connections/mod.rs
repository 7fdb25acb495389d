//! The workers as one: jobs in, rows out, while workers come and go.
//!
//! | module | contents |
//! |---|---|
//! | `settings` | which workers, and what happens without any |
//! | `cluster` | [`Cluster`]: starts and ends, gives out handles |
//! | `handle` | [`Handle`]: jobs and replicas of one bake or picture |
//! | `hub` | state that handles share: whose job goes next, who needs which replica |
//! | `asynchronous` | the cluster for one caller on the same runtime |
//! | `start` | starts the reactor and dials the workers |
//! | `reactor`, `message` | the task that owns the scheduler, and its messages |
//! | `members`, `backoff` | follows the names, dials again after a loss |
//! | `connect` | dials a worker or starts one in this process, up to both hellos |
//! | `session` | one task per worker: its messages, and the one place where its loss is noticed |
//! | `pulse` | keep-alives: whether the worker is there, and uploads get on |
//! | `distance` | how many jobs a worker holds so that its threads go on while messages travel |
//! | `upload` | sends one replica to one worker |
//! | `passing` | where workers reach each other to pass replicas on, and which uploads take long |
//! | `refusals` | replicas that workers do not take |
//! | `request`, `answer` | jobs of either kind, and their answers, checked |
//! | `waiting` | why workers are absent, and how long they are waited for |
//! | `accounts`, `summary`, `recent` | what each worker did, and the recent rate |
//! | `ledger` | what the threads of all workers did, over time |
//!
//! Workers in this process and elsewhere speak the same protocol through the same code; only the bytes below it go through memory or
//! a socket. No file here needs this one: they name each other.

mod accounts;
mod answer;
mod asynchronous;
mod backoff;
mod cluster;
mod connect;
mod distance;
mod error;
mod handle;
mod hub;
mod ledger;
mod members;
mod message;
mod passing;
mod pulse;
mod reactor;
mod recent;
mod refusals;
mod request;
mod session;
mod settings;
mod start;
mod summary;
mod upload;
mod waiting;

pub use answer::{Answer, AnswerError};
pub use asynchronous::AsyncCluster;
pub use cluster::{Cluster, ClusterStatus};
pub use error::ClusterError;
pub use handle::{Answers, Handle, Jobs};
#[cfg(test)]
pub(crate) use reactor::ReactorObserver;
pub use recent::RecentRate;
pub use settings::{ClusterSettings, Schedule, Workers};
pub use summary::{ClusterCounts, WorkerPart, WorkerSummary};

pub use kernel::picture::FinishedTile;
pub use kernel::row::{FinishedJob, JobId};
