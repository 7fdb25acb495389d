//! The workers as one: jobs in, rows out, while workers come and go.
//!
//! | module | what lives there |
//! |---|---|
//! | `settings` | who works, and what happens when nobody does |
//! | `network` | names and connections: sockets, or a simulation |
//! | `connect` | dials a worker or starts one in this process, up to both hellos |
//! | `members` | follows the names, dials again after a loss |
//! | `session` | one task for each worker: its messages, and the one place where its loss is noticed |
//! | `request` | what a worker can be asked for: rows, or a tile of a picture |
//! | `answer` | what a worker answered to a job, checked |
//! | `upload` | one replica on its way to one worker |
//! | `reactor`, `message` | the one task that owns the scheduler, and what it is told |
//! | `waiting` | what is known of workers that are not there, and how long they are waited for |
//! | `accounts`, `summary` | what each worker did |
//! | `sharing` | whose job goes next where several bakes share the workers (pure) |
//! | `drivers` | the workers for several drivers at a time |
//! | `recent` | how much is done in a second, lately |
//! | `asynchronous` | the cluster for a driver that runs on the same runtime |
//!
//! A driver submits jobs of one kind and takes the results as they come; a bake is synchronous, and [`Cluster`] has a runtime of its
//! own below it. Workers in this process and elsewhere speak the same protocol through the same code; only the bytes below
//! it go through memory or a socket.

mod accounts;
mod answer;
mod asynchronous;
mod connect;
mod drivers;
mod error;
mod members;
mod message;
pub mod network;
mod reactor;
mod recent;
mod request;
mod session;
mod settings;
mod sharing;
mod summary;
mod upload;
mod waiting;

use std::sync::Arc;
use std::time::Duration;

use bake::{BakeError, RowService};
use kernel::picture::{TileRequest, TileService};
use kernel::replica::{Digest, EncodedReplica};
use kernel::row::RowRequest;
use tokio::runtime::Runtime;

pub use answer::{Answer, AnswerError};
pub use asynchronous::AsyncCluster;
pub use drivers::{ClusterStatus, Driver, SharedCluster};
pub use error::ClusterError;
#[cfg(test)]
pub(crate) use reactor::ReactorObserver;
pub use recent::RecentRate;
pub use settings::{ClusterSettings, Schedule, Workers};
pub use summary::{ClusterCounts, WorkerPart, WorkerSummary};

pub use kernel::picture::FinishedTile;
pub use kernel::row::{FinishedJob, JobId};

/// Threads that move messages, beside those that compute.
const NETWORK_THREADS: usize = 2;

/// How long workers have to answer a goodbye.
const GOODBYE_TIMEOUT: Duration = Duration::from_secs(1);

/// All workers of a bake, for one driver.
pub struct Cluster {
    cluster: AsyncCluster,
    /// Until it is dropped.
    runtime: Option<Runtime>,
}

impl Cluster {
    /// Dials all workers, or starts one, and waits until one has said hello and all others were tried. Those that could not be
    /// reached are tried again while the work goes on.
    ///
    /// # Errors
    /// When an address makes no sense; when no worker was reached until the grace was over, or none of them can be of use
    /// (another release, not a worker); when this process cannot start its threads.
    pub fn start(settings: &ClusterSettings) -> Result<Self, ClusterError> {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(NETWORK_THREADS)
            .thread_name("network")
            .enable_all()
            .build()
            .map_err(|error| ClusterError::Start(error.to_string()))?;
        match runtime.block_on(AsyncCluster::start(settings, Arc::new(network::Sockets))) {
            Ok(cluster) => Ok(Self { cluster, runtime: Some(runtime) }),
            Err(error) => {
                // Does not wait for a name server that does not answer.
                runtime.shutdown_background();
                Err(error)
            }
        }
    }

    /// Makes a replica known: it is loaded to a worker before the first job that needs it.
    pub fn publish(&self, replica: EncodedReplica) {
        self.cluster.publish(replica);
    }

    /// Forgets a replica, here and on the workers. No unfinished job may need it.
    pub fn release(&self, digest: Digest) {
        self.cluster.release(digest);
    }

    /// Asks for rows, the most urgent ones first; they come after all that wait already. No job id may be used twice.
    pub fn submit(&self, requests: Vec<(JobId, RowRequest)>) {
        self.cluster.submit(requests);
    }

    /// Asks for tiles of pictures, likewise.
    pub fn submit_tiles(&self, requests: Vec<(JobId, TileRequest)>) {
        self.cluster.submit_tiles(requests);
    }

    /// Forgets all jobs that have no answer yet: none of them is answered any more. What workers compute already they end.
    pub fn withdraw(&mut self) {
        if let Some(runtime) = &self.runtime {
            runtime.block_on(self.cluster.withdraw());
        }
    }

    /// How many jobs the workers that are connected now compute at the same time.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.cluster.threads()
    }

    /// Waits for the next result, in any order. For use while a job is under way: otherwise there is nothing to wait for,
    /// and it waits for ever.
    ///
    /// # Errors
    /// When all workers are lost and none came back (from then on always), when a job failed wherever it was tried, or needs
    /// a replica that is not published.
    #[expect(
        clippy::should_implement_trait,
        reason = "jobs may be submitted between two results, and never end by themselves"
    )]
    pub fn next(&mut self) -> Result<FinishedJob, ClusterError> {
        self.cluster.blocking_next()
    }

    /// As [`Self::next`]; `None` where there is no result within so long.
    ///
    /// # Errors
    /// As for [`Self::next`].
    pub fn next_within(&mut self, patience: Duration) -> Result<Option<FinishedJob>, ClusterError> {
        let Some(runtime) = &self.runtime else { return Err(ClusterError::Stopped) };
        let next = async { tokio::time::timeout(patience, self.cluster.next()).await };
        runtime.block_on(next).map_or(Ok(None), |result| result.map(Some))
    }

    /// As [`Self::next`], for a driver that asks for tiles.
    ///
    /// # Errors
    /// As for [`Self::next`].
    pub fn next_tile(&mut self) -> Result<FinishedTile, ClusterError> {
        self.cluster.blocking_next_tile()
    }

    /// What each worker did up to now, lost ones included, in the order in which they were first connected.
    #[must_use]
    pub fn workers(&self) -> Vec<WorkerSummary> {
        self.summarise().0
    }

    /// What the cluster did up to now.
    #[must_use]
    pub fn counts(&self) -> ClusterCounts {
        self.summarise().1
    }

    fn summarise(&self) -> (Vec<WorkerSummary>, ClusterCounts) {
        match &self.runtime {
            Some(runtime) => runtime.block_on(self.cluster.summarise()),
            None => Default::default(),
        }
    }

    /// Says goodbye to all workers and leaves, within about a second. Dropping the cluster does the same.
    pub fn shutdown(self) {}
}

impl Drop for Cluster {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            // Those that do not answer in time are left.
            let _ =
                runtime.block_on(async { tokio::time::timeout(GOODBYE_TIMEOUT, self.cluster.leave()).await });
            runtime.shutdown_background();
        }
    }
}

impl RowService for Cluster {
    fn publish(&mut self, replica: EncodedReplica) {
        Cluster::publish(self, replica);
    }

    fn release(&mut self, digest: Digest) {
        Cluster::release(self, digest);
    }

    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>) {
        Cluster::submit(self, requests);
    }

    fn withdraw(&mut self) {
        Cluster::withdraw(self);
    }

    fn threads(&self) -> usize {
        Cluster::threads(self)
    }

    fn next(&mut self, patience: Duration) -> Result<Option<FinishedJob>, BakeError> {
        self.next_within(patience).map_err(|error| BakeError::Rows(Box::new(error)))
    }
}

impl TileService for Cluster {
    type Error = ClusterError;

    fn publish(&mut self, replica: EncodedReplica) {
        Cluster::publish(self, replica);
    }

    fn release(&mut self, digest: Digest) {
        Cluster::release(self, digest);
    }

    fn submit(&mut self, requests: Vec<(JobId, TileRequest)>) {
        self.submit_tiles(requests);
    }

    fn next(&mut self) -> Result<FinishedTile, ClusterError> {
        self.next_tile()
    }
}
