//! One caller's part of the cluster.

use std::sync::Arc;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use bake::{BakeError, RowService};
use kernel::picture::{FinishedTile, TileRequest, TileService};
use kernel::replica::{Digest, EncodedReplica};
use kernel::row::{FinishedJob, JobId, RowRequest};

use super::error::ClusterError;
use super::hub::{Hub, Outcome};
use super::request::Request;
use super::summary::{FinishedWork, WorkerPart};
use crate::scheduler::HandleId;

/// Access to the workers of a cluster for one caller, with jobs and replicas of its own, which are forgotten when it is dropped. A
/// handle submits jobs of one kind, rows or tiles, and takes their results in any order.
pub struct Handle {
    id: HandleId,
    hub: Arc<Hub>,
    results: mpsc::Receiver<Outcome>,
}

impl Handle {
    pub(super) fn new(hub: Arc<Hub>, priority: i32) -> Self {
        let (sender, results) = mpsc::channel();
        Self { id: hub.join(priority, sender), hub, results }
    }

    /// Makes a replica known: it is loaded to a worker before the first job that needs it. Counted: the cluster forgets a replica that
    /// was released as often as it was published, by all handles.
    pub fn publish(&self, replica: EncodedReplica) {
        self.hub.publish(self.id, replica);
    }

    /// Takes back one [`Self::publish`]. No unfinished job may need the replica after the last one.
    pub fn release(&self, digest: Digest) {
        self.hub.release(self.id, digest);
    }

    /// Requests rows, the most urgent first, after all that wait already. No job id may be used twice.
    pub fn submit(&self, requests: Vec<(JobId, RowRequest)>) {
        self.hub.submit(self.id, requests.into_iter().map(|(job, request)| (job, Request::Rows(request))));
    }

    /// Requests tiles of pictures, likewise.
    pub fn submit_tiles(&self, requests: Vec<(JobId, TileRequest)>) {
        self.hub.submit(self.id, requests.into_iter().map(|(job, request)| (job, Request::Tile(request))));
    }

    /// Withdraws all jobs without an answer: none of them is answered any more. Workers finish those that they have begun.
    pub fn withdraw(&mut self) {
        self.hub.withdraw(self.id);
        // Results are sent while the state is locked: none follows.
        while self.results.try_recv().is_ok() {}
    }

    /// Number of jobs that the connected workers compute at the same time.
    #[must_use]
    pub fn threads(&self) -> usize {
        let [_, threads] = self.hub.connected();
        threads
    }

    /// Work of each worker for this handle, in the order of their first answers.
    #[must_use]
    pub fn workers(&self) -> Vec<WorkerPart> {
        self.hub.workers(self.id)
    }

    /// Waits for the next rows, in any order. Without a job under way it waits for ever.
    ///
    /// # Errors
    /// When all workers are lost and none came back in time, when a job failed on every try, or needs a replica that is not published.
    #[expect(
        clippy::should_implement_trait,
        reason = "jobs may be submitted between two results, and never end by themselves"
    )]
    pub fn next(&mut self) -> Result<FinishedJob, ClusterError> {
        loop {
            if let FinishedWork::Rows(rows) = self.results.recv().unwrap_or(Err(ClusterError::Stopped))? {
                return Ok(rows);
            }
        }
    }

    /// As [`Self::next`]; `None` without a result within `patience`.
    ///
    /// # Errors
    /// As for [`Self::next`].
    pub fn next_within(&mut self, patience: Duration) -> Result<Option<FinishedJob>, ClusterError> {
        match self.results.recv_timeout(patience) {
            Ok(Ok(FinishedWork::Rows(rows))) => Ok(Some(rows)),
            Ok(Ok(FinishedWork::Tile(_))) | Err(RecvTimeoutError::Timeout) => Ok(None),
            Ok(Err(error)) => Err(error),
            Err(RecvTimeoutError::Disconnected) => Err(ClusterError::Stopped),
        }
    }

    /// As [`Self::next`], for tiles.
    ///
    /// # Errors
    /// As for [`Self::next`].
    pub fn next_tile(&mut self) -> Result<FinishedTile, ClusterError> {
        loop {
            if let FinishedWork::Tile(tile) = self.results.recv().unwrap_or(Err(ClusterError::Stopped))? {
                return Ok(tile);
            }
        }
    }
}

impl RowService for Handle {
    fn publish(&mut self, replica: EncodedReplica) {
        Handle::publish(self, replica);
    }

    fn release(&mut self, digest: Digest) {
        Handle::release(self, digest);
    }

    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>) {
        Handle::submit(self, requests);
    }

    fn withdraw(&mut self) {
        Handle::withdraw(self);
    }

    fn threads(&self) -> usize {
        Handle::threads(self)
    }

    fn next(&mut self, patience: Duration) -> Result<Option<FinishedJob>, BakeError> {
        self.next_within(patience).map_err(|error| BakeError::Rows(Box::new(error)))
    }
}

impl TileService for Handle {
    type Error = ClusterError;

    fn publish(&mut self, replica: EncodedReplica) {
        Handle::publish(self, replica);
    }

    fn release(&mut self, digest: Digest) {
        Handle::release(self, digest);
    }

    fn submit(&mut self, requests: Vec<(JobId, TileRequest)>) {
        self.submit_tiles(requests);
    }

    fn next(&mut self) -> Result<FinishedTile, ClusterError> {
        self.next_tile()
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        self.hub.leave(self.id);
    }
}
