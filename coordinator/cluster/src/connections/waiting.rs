//! A cluster without workers: who may still come, how long that is waited for, and what is said when nobody does.

use std::collections::BTreeMap;
use std::time::Duration;

use tokio::sync::oneshot;
use tokio::time::Instant;

use super::accounts::Accounts;
use super::connect::is_at;
use super::error::ClusterError;

/// Tells whoever started the cluster that it works, or why it does not.
pub(super) type Ready = oneshot::Sender<Result<(), ClusterError>>;

/// What is known of workers that are not there.
pub(super) struct Waiting {
    /// Names that were not dialled yet.
    untried: usize,
    /// Names from which somebody may still come.
    hopeful: usize,
    /// Why each place that could not be reached could not.
    failures: BTreeMap<String, ClusterError>,
    /// Told when there is a worker and all names were dialled once, or when there is nobody to wait for.
    ready: Option<Ready>,
    /// Since when there is no worker.
    alone_since: Option<Instant>,
    /// Whether it was said already that all workers are lost.
    failed: bool,
}

impl Waiting {
    /// For workers from so many names.
    pub(super) fn new(names: usize, ready: Ready) -> Self {
        Self {
            untried: names,
            hopeful: names,
            failures: BTreeMap::new(),
            ready: Some(ready),
            alone_since: Some(Instant::now()),
            failed: false,
        }
    }

    /// When a worker must be there, if there is none; `None` where that is beyond all times. Whoever was not dialled yet may come.
    pub(super) fn ends(&self, grace: Duration) -> Option<Instant> {
        self.alone_since.filter(|_| self.untried == 0).and_then(|since| since.checked_add(grace))
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
    }

    /// The last worker is gone; false where that makes no difference any more.
    pub(super) fn is_alone(&mut self) -> bool {
        if !self.failed {
            self.alone_since = Some(Instant::now());
        }
        !self.failed
    }

    /// Nobody is waited for: the driver leaves, or this process does the work.
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

    /// Nobody can come from one of the names any more.
    pub(super) fn gave_up(&mut self) {
        self.hopeful = self.hopeful.saturating_sub(1);
    }

    /// Tells that the cluster is ready, if it is. True where there is no worker, and none can come.
    pub(super) fn is_hopeless(&mut self, has_workers: bool) -> bool {
        if !has_workers {
            return self.hopeful == 0 && self.untried == 0 && self.alone_since.is_some();
        }
        if self.untried == 0
            && let Some(ready) = self.ready.take()
        {
            // Whoever started the cluster may have left.
            let _ = ready.send(Ok(()));
        }
        false
    }

    /// Nobody came. The error for the driver, unless it was told already, now or before.
    pub(super) fn fail(&mut self, accounts: &Accounts) -> Option<ClusterError> {
        let error = self.nobody(accounts);
        let is_news = !std::mem::replace(&mut self.failed, true);
        match self.ready.take() {
            Some(ready) => {
                // Whoever started the cluster may have left.
                let _ = ready.send(Err(error));
                None
            }
            None => is_news.then_some(error),
        }
    }

    /// The error of a cluster without workers.
    fn nobody(&self, accounts: &Accounts) -> ClusterError {
        match (accounts.is_empty(), self.failures.len(), self.failures.values().next()) {
            (true, 1, Some(only)) => only.clone(),
            _ => {
                // Of whoever was lost it says more how that was than that it does not answer since.
                let unknown = self.failures.iter().filter(|(place, _)| !accounts.knows(place));
                let reasons = accounts.reasons().chain(unknown.map(|(_, error)| error.to_string()));
                ClusterError::AllWorkersLost { reasons: reasons.collect() }
            }
        }
    }
}
