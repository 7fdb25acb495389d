//! Messages to the reactor.

use std::sync::Arc;
use std::sync::atomic::AtomicU64;

use kernel::replica::{Digest, EncodedReplica};
use protocol::worker::WorkerHello;
use tokio::sync::{mpsc, oneshot};

use super::connect::Peer;
use super::error::ClusterError;
use super::request::Request;
use super::session::{Command, News};
use super::summary::{ClusterCounts, WorkerSummary};
use crate::scheduler::{JobId, WorkerId};

/// A message to the reactor.
pub(super) enum Message {
    /// A replica that jobs may need from now on.
    Publish(EncodedReplica),
    /// A replica that no job needs any more.
    Release(Digest),
    /// More jobs.
    Submit(Vec<(JobId, Request)>),
    /// Jobs that are not wanted any more.
    Withdraw(Vec<JobId>),
    /// Report what each worker did.
    Summarise(oneshot::Sender<(Vec<WorkerSummary>, ClusterCounts)>),
    /// Say goodbye to all workers; the sender is dropped when all have answered.
    Shutdown(oneshot::Sender<()>),
    /// A worker said hello.
    Joined(Joined),
    /// From a session.
    News(WorkerId, News),
    /// A machine, or a name, could not be reached.
    Failed {
        /// The machine or the name.
        place: String,
        /// Why.
        error: ClusterError,
    },
    /// All machines behind a name were dialled once.
    Tried {
        /// The name.
        name: String,
    },
    /// No worker can come from one of the addresses any more.
    GaveUp,
}

/// A worker that said hello.
pub(super) struct Joined {
    pub worker: WorkerId,
    pub address: String,
    pub hello: WorkerHello,
    /// Where other workers reach it, if replicas may be passed on to it, and by it.
    pub peer: Option<Peer>,
    pub commands: mpsc::UnboundedSender<Command>,
    /// Counted by its session.
    pub bytes_sent: Arc<AtomicU64>,
}
