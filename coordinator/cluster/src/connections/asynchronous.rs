//! The cluster without handles, for one caller that runs on the same runtime.

use std::sync::Arc;

use kernel::replica::{Digest, EncodedReplica};
use kernel::row::{FinishedJob, JobId, RowRequest};
use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::DropGuard;

use super::error::ClusterError;
use super::message::Message;
use super::reactor::{self, ReactorObserver};
use super::request::Request;
use super::settings::ClusterSettings;
use super::start::Started;
use super::summary::{ClusterCounts, FinishedWork, WorkerSummary};
use protocol::network::Network;

/// All workers, as tasks of the runtime that it was started on, over any [`Network`].
pub struct AsyncCluster {
    messages: mpsc::UnboundedSender<Message>,
    results: mpsc::UnboundedReceiver<reactor::Result>,
    /// Ends the embedded worker, and all dialling.
    _leaving: DropGuard,
}

impl AsyncCluster {
    /// As [`super::Cluster::start`], on this network.
    ///
    /// # Errors
    /// As for [`super::Cluster::start`].
    pub async fn start(settings: &ClusterSettings, network: Arc<dyn Network>) -> Result<Self, ClusterError> {
        Self::start_observed(settings, network, ()).await
    }

    /// As [`Self::start`], observed.
    pub(crate) async fn start_observed(
        settings: &ClusterSettings,
        network: Arc<dyn Network>,
        observer: impl ReactorObserver,
    ) -> Result<Self, ClusterError> {
        let Started { messages, results, is_ready, leaving, .. } = Started::new(settings, network, observer)?;
        is_ready.await.map_err(|_| ClusterError::Stopped)??;
        Ok(Self { messages, results, _leaving: leaving })
    }

    /// Makes a replica known: it is loaded to a worker before the first job that needs it.
    pub fn publish(&self, replica: EncodedReplica) {
        self.tell(Message::Publish(replica));
    }

    /// Forgets a replica, here and on the workers. No unfinished job may need it.
    pub fn release(&self, digest: Digest) {
        self.tell(Message::Release(digest));
    }

    /// Requests rows, the most urgent first, after all that wait already. No job id may be used twice.
    pub fn submit(&self, requests: Vec<(JobId, RowRequest)>) {
        let rows = requests.into_iter().map(|(job, request)| (job, Request::Rows(request)));
        self.tell(Message::Submit(rows.collect()));
    }

    /// As [`super::Handle::next`].
    ///
    /// # Errors
    /// As for [`super::Handle::next`].
    pub async fn next(&mut self) -> Result<FinishedJob, ClusterError> {
        loop {
            let result = self.results.recv().await.unwrap_or(Err(ClusterError::Stopped));
            if let FinishedWork::Rows(rows) = result?.work {
                return Ok(rows);
            }
        }
    }

    /// Summaries of all workers, and counts over them.
    pub async fn summarise(&self) -> (Vec<WorkerSummary>, ClusterCounts) {
        let (reply, summaries) = oneshot::channel();
        self.tell(Message::Summarise(reply));
        // Nothing comes where the reactor is gone.
        summaries.await.unwrap_or_default()
    }

    /// Says goodbye to all workers, and waits until they have answered.
    pub async fn leave(&self) {
        let (done, all_gone) = oneshot::channel::<()>();
        self.tell(Message::Shutdown(done));
        // Nothing is ever sent: it waits until the other end is dropped.
        let _ = all_gone.await;
    }

    fn tell(&self, message: Message) {
        // Where the reactor is gone, the next call for results says so.
        let _ = self.messages.send(message);
    }
}
