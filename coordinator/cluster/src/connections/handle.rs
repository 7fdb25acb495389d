//! One caller's part of the cluster.

use std::sync::Arc;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use bake::{BakeError, RowService, ThreadTime};
use kernel::picture::{FinishedTile, TileRequest, TileService};
use kernel::replica::{Digest, EncodedReplica};
use kernel::row::{FinishedJob, JobId, RowRequest};

use super::error::ClusterError;
use super::hub::{Hub, Outcome};
use super::request::Request;
use super::summary::{FinishedWork, WorkerPart};
use crate::scheduler::HandleId;

/// Access to the workers of a cluster for one caller, with jobs and replicas of its own, which are forgotten when it is dropped. It is
/// a [`RowService`] or a [`TileService`], but not both at a time.
///
/// Replicas are counted: the cluster forgets one that was released as often as it was published, by all handles. A replica is loaded
/// to a worker before the first job that needs it.
pub struct Handle {
    jobs: Jobs,
    answers: Answers,
}

/// The half of a handle that asks; dropping it forgets its jobs and replicas.
pub struct Jobs {
    id: HandleId,
    hub: Arc<Hub>,
}

/// The half of a handle that is answered.
pub struct Answers {
    results: mpsc::Receiver<Outcome>,
}

impl Handle {
    pub(super) fn new(hub: Arc<Hub>, priority: i32) -> Self {
        let (sender, results) = mpsc::channel();
        Self { jobs: Jobs { id: hub.join(priority, sender), hub }, answers: Answers { results } }
    }

    /// Splits it, for a caller that asks and waits in different threads.
    #[must_use]
    pub fn split(self) -> (Jobs, Answers) {
        (self.jobs, self.answers)
    }

    /// Work of each worker for this handle, in the order of their first answers.
    #[must_use]
    pub fn workers(&self) -> Vec<WorkerPart> {
        self.jobs.workers()
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
            if let FinishedWork::Rows(rows) =
                self.answers.results.recv().unwrap_or(Err(ClusterError::Stopped))?
            {
                return Ok(rows);
            }
        }
    }

    /// As [`Self::next`]; `None` without a result within `patience`.
    ///
    /// # Errors
    /// As for [`Self::next`].
    pub fn next_within(&mut self, patience: Duration) -> Result<Option<FinishedJob>, ClusterError> {
        self.answers.next_within(patience)
    }
}

impl Jobs {
    /// As [`RowService::publish`].
    pub fn publish(&self, replica: EncodedReplica) {
        self.hub.publish(self.id, replica);
    }

    /// As [`RowService::release`].
    pub fn release(&self, digest: Digest) {
        self.hub.release(self.id, digest);
    }

    /// As [`RowService::submit`].
    pub fn submit(&self, requests: Vec<(JobId, RowRequest)>) {
        self.ask(requests.into_iter().map(|(job, request)| (job, Request::Rows(request))));
    }

    fn ask(&self, requests: impl Iterator<Item = (JobId, Request)>) {
        self.hub.submit(self.id, requests);
    }

    /// Forgets all jobs. Answers that came before may still be waiting.
    pub fn withdraw(&self) {
        self.hub.withdraw(self.id);
    }

    /// As [`Handle::workers`].
    #[must_use]
    pub fn workers(&self) -> Vec<WorkerPart> {
        self.hub.workers(self.id)
    }
}

impl Answers {
    /// As [`Handle::next_within`].
    ///
    /// # Errors
    /// As for [`Handle::next`].
    pub fn next_within(&mut self, patience: Duration) -> Result<Option<FinishedJob>, ClusterError> {
        match self.results.recv_timeout(patience) {
            Ok(Ok(FinishedWork::Rows(rows))) => Ok(Some(rows)),
            Ok(Ok(FinishedWork::Tile(_))) | Err(RecvTimeoutError::Timeout) => Ok(None),
            Ok(Err(error)) => Err(error),
            Err(RecvTimeoutError::Disconnected) => Err(ClusterError::Stopped),
        }
    }
}

impl RowService for Handle {
    fn publish(&mut self, replica: EncodedReplica) {
        self.jobs.publish(replica);
    }

    fn release(&mut self, digest: Digest) {
        self.jobs.release(digest);
    }

    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>) {
        self.jobs.submit(requests);
    }

    fn withdraw(&mut self) {
        self.jobs.withdraw();
        // Results are sent while the state is locked: none follows.
        while self.answers.results.try_recv().is_ok() {}
    }

    fn threads(&self) -> usize {
        self.jobs.hub.connected()[1]
    }

    fn jobs_ahead(&self) -> usize {
        self.jobs.hub.jobs_ahead()
    }

    fn thread_time(&self) -> ThreadTime {
        self.jobs.hub.thread_time()
    }

    fn next(&mut self, patience: Duration) -> Result<Option<FinishedJob>, BakeError> {
        self.next_within(patience).map_err(|error| BakeError::Rows(Box::new(error)))
    }
}

impl TileService for Handle {
    type Error = ClusterError;

    fn publish(&mut self, replica: EncodedReplica) {
        self.jobs.publish(replica);
    }

    fn release(&mut self, digest: Digest) {
        self.jobs.release(digest);
    }

    fn submit(&mut self, requests: Vec<(JobId, TileRequest)>) {
        self.jobs.ask(requests.into_iter().map(|(job, request)| (job, Request::Tile(request))));
    }

    fn next(&mut self) -> Result<FinishedTile, ClusterError> {
        loop {
            if let FinishedWork::Tile(tile) =
                self.answers.results.recv().unwrap_or(Err(ClusterError::Stopped))?
            {
                return Ok(tile);
            }
        }
    }
}

impl Drop for Jobs {
    fn drop(&mut self) {
        self.hub.leave(self.id);
    }
}
