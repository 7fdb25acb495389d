use std::num::NonZeroUsize;
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;

use kernel::picture::TileRequest;
use kernel::replica::{Digest, EncodedReplica};
use kernel::row::RowRequest;
use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::{CancellationToken, DropGuard};

use super::connect::check_name;
use super::members::Members;
use super::message::Message;
use super::network::Network;
use super::reactor::{self, Reactor, ReactorObserver};
use super::request::Request;
use super::summary::FinishedWork;
use super::{
    ClusterCounts, ClusterError, ClusterSettings, FinishedJob, FinishedTile, WorkerSummary, Workers,
};
use crate::scheduler::JobId;

/// All workers of a driver, as tasks of the runtime that it was started on.
pub struct AsyncCluster {
    messages: mpsc::UnboundedSender<Message>,
    results: mpsc::UnboundedReceiver<reactor::Result>,
    connected: Arc<Connected>,
    /// Once all workers are lost, every call for results says so.
    all_lost: Option<ClusterError>,
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
        let Started { messages, results, connected, is_ready, leaving } =
            Started::new(settings, network, observer)?;
        is_ready.await.map_err(|_| ClusterError::Stopped)??;
        Ok(Self { messages, results, connected, all_lost: None, _leaving: leaving })
    }

    /// As [`super::Cluster::publish`].
    pub fn publish(&self, replica: EncodedReplica) {
        self.tell(Message::Publish(replica));
    }

    /// As [`super::Cluster::release`].
    pub fn release(&self, digest: Digest) {
        self.tell(Message::Release(digest));
    }

    /// As [`super::Cluster::submit`].
    pub fn submit(&self, requests: Vec<(JobId, RowRequest)>) {
        let rows = requests.into_iter().map(|(job, request)| (job, Request::Rows(request)));
        self.tell(Message::Submit(rows.collect()));
    }

    /// As [`super::Cluster::submit_tiles`].
    pub fn submit_tiles(&self, requests: Vec<(JobId, TileRequest)>) {
        let tiles = requests.into_iter().map(|(job, request)| (job, Request::Tile(request)));
        self.tell(Message::Submit(tiles.collect()));
    }

    /// As [`super::Cluster::withdraw`].
    pub async fn withdraw(&mut self) {
        let (done, is_done) = oneshot::channel::<()>();
        self.tell(Message::WithdrawAll(done));
        // Nothing is ever sent: it waits until the other end is dropped.
        let _ = is_done.await;
        while let Ok(result) = self.results.try_recv() {
            // Only what is true from now on is of interest.
            let _ = self.remember(Some(result));
        }
    }

    /// As [`super::Cluster::threads`].
    #[must_use]
    pub fn threads(&self) -> usize {
        self.connected.threads.load(Relaxed)
    }

    /// As [`super::Cluster::next`].
    ///
    /// # Errors
    /// As for [`super::Cluster::next`].
    pub async fn next(&mut self) -> Result<FinishedJob, ClusterError> {
        self.check()?;
        loop {
            let result = self.results.recv().await;
            // Whoever asks for rows waits for rows.
            if let FinishedWork::Rows(rows) = self.remember(result)? {
                return Ok(rows);
            }
        }
    }

    /// The same for a thread that is none of the runtime's.
    pub(super) fn blocking_next(&mut self) -> Result<FinishedJob, ClusterError> {
        self.check()?;
        loop {
            let result = self.results.blocking_recv();
            if let FinishedWork::Rows(rows) = self.remember(result)? {
                return Ok(rows);
            }
        }
    }

    /// As [`super::Cluster::next_tile`], for a thread that is none of the runtime's.
    pub(super) fn blocking_next_tile(&mut self) -> Result<FinishedTile, ClusterError> {
        self.check()?;
        loop {
            let result = self.results.blocking_recv();
            if let FinishedWork::Tile(tile) = self.remember(result)? {
                return Ok(tile);
            }
        }
    }

    /// What each worker, and the cluster as a whole, did up to now.
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

    fn check(&self) -> Result<(), ClusterError> {
        self.all_lost.clone().map_or(Ok(()), Err)
    }

    fn remember(&mut self, result: Option<reactor::Result>) -> Result<FinishedWork, ClusterError> {
        let result = result.unwrap_or(Err(ClusterError::Stopped));
        if let Err(error @ ClusterError::AllWorkersLost { .. }) = &result {
            self.all_lost = Some(error.clone());
        }
        result.map(|delivery| delivery.work)
    }

    fn tell(&self, message: Message) {
        // Where the reactor is gone, the next call for results says so.
        let _ = self.messages.send(message);
    }
}

/// The workers that are connected now.
#[derive(Debug, Default)]
pub(super) struct Connected {
    /// How many they are.
    pub(super) workers: AtomicUsize,
    /// How many jobs they compute at the same time.
    pub(super) threads: AtomicUsize,
}

/// The reactor's task, as whoever started it sees it.
pub(super) struct Started {
    /// What it is to do.
    pub(super) messages: mpsc::UnboundedSender<Message>,
    /// What came of it.
    pub(super) results: mpsc::UnboundedReceiver<reactor::Result>,
    /// Whom it has.
    pub(super) connected: Arc<Connected>,
    /// Told once there is a worker and all others were tried, or why there is none.
    pub(super) is_ready: oneshot::Receiver<Result<(), ClusterError>>,
    /// Ends the embedded worker, and all dialling.
    pub(super) leaving: DropGuard,
}

impl Started {
    /// Starts it on the runtime of the caller.
    ///
    /// # Errors
    /// When there is nobody to dial or to start, or an address makes no sense.
    pub(super) fn new(
        settings: &ClusterSettings,
        network: Arc<dyn Network>,
        observer: impl ReactorObserver,
    ) -> Result<Self, ClusterError> {
        let (messages, inbox) = mpsc::unbounded_channel();
        let (sender, results) = mpsc::unbounded_channel();
        let (ready, is_ready) = oneshot::channel();
        let leaving = CancellationToken::new();
        let guard = leaving.clone().drop_guard();
        let members = Members::new(network, settings, messages.clone(), leaving.clone());
        let names = match &settings.workers {
            Workers::Embedded { threads } => {
                members.embed(NonZeroUsize::new(*threads).ok_or(ClusterError::NoWorkers)?);
                1
            }
            Workers::Remote(names) if names.is_empty() => return Err(ClusterError::NoWorkers),
            Workers::Remote(names) => {
                names.iter().try_for_each(|name| check_name(name))?;
                names.iter().for_each(|name| members.follow(name.clone()));
                names.len()
            }
        };
        let connected = Arc::default();
        let seen = Arc::clone(&connected);
        let reactor = Reactor::new(observer, settings.clone(), members, names, sender, seen, ready);
        tokio::spawn(reactor.run(inbox, leaving));
        Ok(Self { messages, results, connected, is_ready, leaving: guard })
    }
}
