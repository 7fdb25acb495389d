//! Absent workers: which may still come, how long they are waited for, and the error when none comes.

use std::collections::BTreeMap;
use std::time::Duration;

use tokio::sync::oneshot;
use tokio::time::Instant;

use super::accounts::Accounts;
use super::connect::is_at;
use super::error::ClusterError;

/// How long the first worker is waited for others that are being dialled, so that the work begins with all that are there: an address
/// that does not answer costs no more than this.
const HEAD_START: Duration = Duration::from_millis(250);

/// Tells the caller that the cluster is ready, or why it is not.
pub(super) type Ready = oneshot::Sender<Result<(), ClusterError>>;

/// State of absent workers.
pub(super) struct Waiting {
    /// Names that were not dialled yet.
    untried: usize,
    /// Names from which a worker may still come.
    hopeful: usize,
    /// Why each place could not be reached.
    failures: BTreeMap<String, ClusterError>,
    /// Told when there is a worker and all names were dialled once, or soon after there is one, or when none can come.
    ready: Option<Ready>,
    /// When the work begins without the names that were not dialled to the end.
    begins: Option<Instant>,
    /// Since when there is no worker.
    alone_since: Option<Instant>,
    /// Whether the loss of all workers was reported.
    failed: bool,
}

impl Waiting {
    /// For workers from this number of names.
    pub(super) fn new(names: usize, ready: Ready) -> Self {
        Self {
            untried: names,
            hopeful: names,
            failures: BTreeMap::new(),
            ready: Some(ready),
            begins: None,
            alone_since: Some(Instant::now()),
            failed: false,
        }
    }

    /// Deadline for a worker, if there is none; `None` without a deadline, or before all names were dialled.
    pub(super) fn ends(&self, grace: Duration) -> Option<Instant> {
        self.alone_since.filter(|_| self.untried == 0).and_then(|since| since.checked_add(grace))
    }

    /// When the work begins, if it waits for nothing but names that do not answer.
    pub(super) fn begins(&self) -> Option<Instant> {
        self.begins.filter(|_| self.ready.is_some())
    }

    /// The head start of the first worker is over.
    pub(super) fn begin(&mut self, has_workers: bool) {
        self.begins = None;
        if has_workers {
            self.tell_ready();
        }
    }

    /// A machine, or a name, could not be reached.
    pub(super) fn not_reached(&mut self, place: String, error: ClusterError) {
        tracing::debug!(place, %error, "not reached");
        self.failures.insert(place, error);
    }

    /// A worker is there.
    pub(super) fn came(&mut self, address: &str) {
        self.failures.remove(address);
        self.alone_since = None;
        self.failed = false;
        self.begins.get_or_insert_with(|| Instant::now() + HEAD_START);
    }

    /// The last worker is gone. False if the loss was reported before.
    pub(super) fn is_alone(&mut self) -> bool {
        if !self.failed {
            self.alone_since = Some(Instant::now());
        }
        !self.failed
    }

    /// Stops waiting: the caller leaves, or this process does the work.
    pub(super) fn stop(&mut self) {
        self.alone_since = None;
    }

    /// This process may work, too.
    pub(super) fn hope_for_one_more(&mut self) {
        self.hopeful += 1;
    }

    /// All machines of a name were dialled once.
    pub(super) fn tried(&mut self, name: &str, accounts: &Accounts) {
        self.untried = self.untried.saturating_sub(1);
        if !accounts.knows(name) {
            for (_, error) in self.failures.iter().filter(|(place, _)| is_at(place, name)) {
                tracing::warn!("{error}; trying again while the work goes on");
            }
        }
    }

    /// No worker can come from one of the names any more.
    pub(super) fn gave_up(&mut self) {
        self.hopeful = self.hopeful.saturating_sub(1);
    }

    /// Tells that the cluster is ready, if it is. True if there is no worker and none can come.
    pub(super) fn is_hopeless(&mut self, has_workers: bool) -> bool {
        if !has_workers {
            return self.hopeful == 0 && self.untried == 0 && self.alone_since.is_some();
        }
        if self.untried == 0 {
            self.tell_ready();
        }
        false
    }

    fn tell_ready(&mut self) {
        if let Some(ready) = self.ready.take() {
            // The caller may have left.
            let _ = ready.send(Ok(()));
        }
    }

    /// No worker came. Returns the error to report, unless it was reported before.
    pub(super) fn fail(&mut self, accounts: &Accounts) -> Option<ClusterError> {
        let error = self.no_worker(accounts);
        let is_news = !std::mem::replace(&mut self.failed, true);
        match self.ready.take() {
            Some(ready) => {
                // The caller may have left.
                let _ = ready.send(Err(error));
                None
            }
            None => is_news.then_some(error),
        }
    }

    /// The error of a cluster without workers.
    fn no_worker(&self, accounts: &Accounts) -> ClusterError {
        match (accounts.is_empty(), self.failures.len(), self.failures.values().next()) {
            (true, 1, Some(only)) => only.clone(),
            _ => {
                // For a lost worker the loss says more than that it does not answer since.
                let unknown = self.failures.iter().filter(|(place, _)| !accounts.knows(place));
                let reasons = accounts.reasons().chain(unknown.map(|(_, error)| error.to_string()));
                ClusterError::AllWorkersLost { reasons: reasons.collect() }
            }
        }
    }
}
