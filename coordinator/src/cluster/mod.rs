//! The workers as one: jobs in, rows out.
//!
//! | module | what lives there |
//! |---|---|
//! | `connect` | dials a worker or starts one in this process, up to both hellos |
//! | `session` | one task for each worker: its messages, and the one place where its loss is noticed |
//! | `upload` | one replica on its way to one worker |
//! | `reactor` | the one task that owns the scheduler |
//!
//! A driver is synchronous: it submits jobs and takes the results as they come. Workers in this process and elsewhere speak
//! the same protocol through the same code; only the bytes below it go through memory or a socket.

mod connect;
mod error;
mod reactor;
mod session;
mod upload;

use std::num::NonZeroUsize;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use shared::protocol::RowStatistics;
use shared::replica::{Digest, EncodedReplica};
use shared::row::{Row, RowRequest};
use tokio::runtime::Runtime;
use tokio_util::sync::CancellationToken;

pub use error::ClusterError;
use reactor::{Message, Reactor};

pub use crate::scheduler::JobId;

/// Threads that move messages, beside those that compute.
const NETWORK_THREADS: usize = 2;

/// How long workers have to answer a goodbye.
const GOODBYE_TIMEOUT: Duration = Duration::from_secs(1);

/// Who works.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Workers {
    /// A worker in this process.
    Embedded {
        /// How many jobs it computes at the same time.
        threads: usize,
    },
    /// Worker processes, each `host:port`. A name that resolves to several machines stands for all of them.
    Remote(Vec<String>),
}

/// The answer to a job.
#[derive(Debug, Clone, PartialEq)]
pub struct FinishedJob {
    /// The job.
    pub job: JobId,
    /// One row for each shooter of the request, each with a factor for each receiver of its range.
    pub rows: Vec<Row>,
    /// What each of them cost.
    pub statistics: Vec<RowStatistics>,
}

/// What a worker did.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WorkerSummary {
    /// The name that it gave itself.
    pub name: String,
    /// Where it is.
    pub address: String,
    /// How many jobs it computes at the same time.
    pub threads: usize,
    /// Jobs finished.
    pub jobs: u64,
    /// Rows in them.
    pub rows: u64,
    /// Rays cast for them.
    pub rays: u64,
    /// Time computed, summed over its threads.
    pub busy: Duration,
    /// Length of the encoded rows, in bytes.
    pub bytes_received: u64,
    /// Why it is lost, where it is.
    pub lost: Option<String>,
}

impl WorkerSummary {
    fn new(name: String, address: String, threads: usize) -> Self {
        Self {
            name,
            address,
            threads,
            jobs: 0,
            rows: 0,
            rays: 0,
            busy: Duration::ZERO,
            bytes_received: 0,
            lost: None,
        }
    }
}

/// All workers of a bake, for one driver.
pub struct Cluster {
    messages: tokio::sync::mpsc::UnboundedSender<Message>,
    results: mpsc::Receiver<Result<FinishedJob, ClusterError>>,
    /// Once all workers are lost, every call for results says so.
    all_lost: Option<ClusterError>,
    /// Ends the embedded worker.
    shutdown: CancellationToken,
    /// Until it is dropped.
    runtime: Option<Runtime>,
}

impl Cluster {
    /// Connects to all workers, or starts one, and waits for their hellos.
    ///
    /// # Errors
    /// When a worker cannot be reached, does not answer within some seconds, or is of another release; when this process
    /// cannot start its threads.
    pub fn start(workers: &Workers) -> Result<Self, ClusterError> {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(NETWORK_THREADS)
            .thread_name("network")
            .enable_all()
            .build()
            .map_err(|error| ClusterError::Start(error.to_string()))?;
        let shutdown = CancellationToken::new();
        let (sender, results) = mpsc::channel();
        let connecting = async {
            let mut connections = vec![];
            match workers {
                Workers::Embedded { threads } => {
                    let threads = NonZeroUsize::new(*threads).ok_or(ClusterError::NoWorkers)?;
                    connections.push(connect::embed(threads, shutdown.clone()).await?);
                }
                Workers::Remote(addresses) => {
                    for address in addresses {
                        connections.extend(connect::dial(address).await?);
                    }
                }
            }
            if connections.is_empty() {
                return Err(ClusterError::NoWorkers);
            }
            Ok(Reactor::start(connections, sender))
        };
        match runtime.block_on(connecting) {
            Ok(messages) => Ok(Self { messages, results, all_lost: None, shutdown, runtime: Some(runtime) }),
            Err(error) => {
                // Does not wait for a name server that does not answer.
                runtime.shutdown_background();
                Err(error)
            }
        }
    }

    /// Makes a replica known: it is loaded to a worker before the first job that needs it.
    pub fn publish(&self, replica: EncodedReplica) {
        self.tell(Message::Publish(replica));
    }

    /// Forgets a replica, here and on the workers. No unfinished job may need it.
    pub fn release(&self, digest: Digest) {
        self.tell(Message::Release(digest));
    }

    /// Asks for rows, the most urgent ones first; they come after all that wait already. No job id may be used twice.
    pub fn submit(&self, requests: Vec<(JobId, RowRequest)>) {
        self.tell(Message::Submit(requests));
    }

    /// Waits for the next result, in any order. For use while a job is under way: otherwise there is nothing to wait for,
    /// and it waits for ever.
    ///
    /// # Errors
    /// When all workers are lost (from then on always), when a job failed wherever it was tried, or needs a replica that
    /// is not published.
    #[expect(
        clippy::should_implement_trait,
        reason = "jobs may be submitted between two results, and never end by themselves"
    )]
    pub fn next(&mut self) -> Result<FinishedJob, ClusterError> {
        self.check()?;
        let result = self.results.recv().map_err(|_| ClusterError::Stopped)?;
        self.remember(result)
    }

    /// Like [`Self::next`], but for at most so long: `None` then.
    ///
    /// # Errors
    /// As for [`Self::next`].
    pub fn next_timeout(&mut self, timeout: Duration) -> Result<Option<FinishedJob>, ClusterError> {
        self.check()?;
        match self.results.recv_timeout(timeout) {
            Ok(result) => self.remember(result).map(Some),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(ClusterError::Stopped),
        }
    }

    /// What each worker did up to now, lost ones included, in the order in which they were connected.
    #[must_use]
    pub fn workers(&self) -> Vec<WorkerSummary> {
        let (reply, summaries) = mpsc::channel();
        self.tell(Message::Summarise(reply));
        // Nothing comes where the reactor is gone.
        summaries.recv().unwrap_or_default()
    }

    /// Says goodbye to all workers and leaves, within about a second. Dropping the cluster does the same.
    pub fn shutdown(self) {}

    fn check(&self) -> Result<(), ClusterError> {
        self.all_lost.clone().map_or(Ok(()), Err)
    }

    fn remember(&mut self, result: Result<FinishedJob, ClusterError>) -> Result<FinishedJob, ClusterError> {
        if let Err(error @ ClusterError::AllWorkersLost { .. }) = &result {
            self.all_lost = Some(error.clone());
        }
        result
    }

    fn tell(&self, message: Message) {
        // Where the reactor is gone, the next call for results says so.
        let _ = self.messages.send(message);
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        let (done, all_gone) = mpsc::channel::<()>();
        self.tell(Message::Shutdown(done));
        // Nothing is ever sent: it waits until the other end is dropped.
        let _ = all_gone.recv_timeout(GOODBYE_TIMEOUT);
        self.shutdown.cancel();
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}
