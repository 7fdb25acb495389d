//! How replicas spread: from the coordinator to a few workers at a time, and on from those that hold one.
//!
//! A worker that needs a replica gets it from the coordinator while that has few uploads under way, or from a worker that holds it
//! and has few under way itself; else it waits until one of them is free. So a tree grows, in the order in which uploads end, and no
//! worker's place in it is fixed: where a source is lost or slow, the coordinator takes its place at once. Workers that do not pass
//! replicas on, and those that could not be reached by another one, get all from the coordinator, and wait for nobody.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use kernel::replica::Digest;

use super::event::{Action, PassOutcome, WorkerId};

/// Uploads of the coordinator under way, of those that others could take over.
const UPLOADS: usize = 8;

/// Times that a worker passes a replica on at the same time.
const PASSES: usize = 2;

/// Failures in a row of a worker to pass anything on before it is not asked again.
const MOST_FAILURES: u32 = 3;

/// Failures of all workers, while none has succeeded, before no worker is asked again: they cannot reach each other.
const MOST_FAILURES_OF_ALL: u32 = 4;

/// Bytes per second below which an upload is slow.
const SLOW: u64 = 10_000_000;

/// How long an upload of so many bytes may take before it counts as slow: one from another worker is then made by the coordinator, and
/// one of the coordinator holds no other up.
#[must_use]
pub fn patience(bytes: u64) -> Duration {
    Duration::from_secs(1) + Duration::from_millis(bytes * 1000 / SLOW)
}

/// Where a replica that is under way comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Source {
    /// The coordinator; `counts` among its [`UPLOADS`].
    Coordinator { counts: bool },
    /// A worker that holds it.
    Worker(WorkerId),
}

/// The state of all uploads.
#[derive(Debug)]
pub(super) struct Spread {
    most_uploads: usize,
    /// Workers that pass replicas on, and take them from each other; with their failures in a row to pass one on.
    peers: BTreeMap<WorkerId, u32>,
    /// Uploads under way, by replica and destination.
    under_way: BTreeMap<(Digest, WorkerId), Source>,
    /// Workers that wait for a source of each replica, in order.
    waiting: BTreeMap<Digest, VecDeque<WorkerId>>,
    /// Workers that can pass each replica on: each as often as it can do so now.
    offers: BTreeMap<Digest, VecDeque<WorkerId>>,
    /// Uploads of the coordinator that count.
    uploads: usize,
    passed: u64,
    failures: u32,
}

impl Default for Spread {
    fn default() -> Self {
        Self {
            most_uploads: UPLOADS,
            peers: BTreeMap::new(),
            under_way: BTreeMap::new(),
            waiting: BTreeMap::new(),
            offers: BTreeMap::new(),
            uploads: 0,
            passed: 0,
            failures: 0,
        }
    }
}

impl Spread {
    /// The coordinator has this many uploads under way at most, of those that workers could take over.
    pub(super) fn upload_at_most(&mut self, uploads: usize) {
        self.most_uploads = uploads.max(1);
    }

    /// A worker passes replicas on, and takes them from others.
    pub(super) fn join(&mut self, worker: WorkerId) {
        self.peers.insert(worker, 0);
    }

    /// Replicas passed on so far.
    pub(super) fn passed(&self) -> u64 {
        self.passed
    }

    /// A worker needs a replica.
    pub(super) fn ask(&mut self, worker: WorkerId, digest: Digest, actions: &mut Vec<Action>) {
        if self.peers.contains_key(&worker) {
            self.waiting.entry(digest).or_default().push_back(worker);
            self.share_out(digest, actions);
        } else {
            self.upload(worker, digest, actions);
        }
    }

    /// A replica has arrived.
    pub(super) fn loaded(&mut self, worker: WorkerId, digest: Digest, actions: &mut Vec<Action>) {
        match self.under_way.remove(&(digest, worker)) {
            Some(Source::Worker(_)) => self.passed += 1,
            Some(Source::Coordinator { counts }) => self.uploads -= usize::from(counts),
            // It was on its way before the replica was released and needed again.
            None => self.stop_waiting(worker, digest),
        }
        if self.peers.get(&worker).is_some_and(|failures| *failures < MOST_FAILURES) {
            self.offers.entry(digest).or_default().extend([worker; PASSES]);
        }
        self.share_out_all(actions);
    }

    /// A worker, which still `holds` a replica or has lost it meanwhile, has passed it on or not.
    pub(super) fn pass_ended(
        &mut self,
        ([from, to], holds): ([WorkerId; 2], bool),
        digest: Digest,
        outcome: PassOutcome,
        actions: &mut Vec<Action>,
    ) {
        let is_under_way = self.under_way.get(&(digest, to)) == Some(&Source::Worker(from));
        match outcome {
            // The other worker tells itself that it has it.
            PassOutcome::Done => _ = self.peers.get_mut(&from).map(|failures| *failures = 0),
            PassOutcome::NotHeld => {
                self.forget(from, digest);
                if is_under_way {
                    self.upload(to, digest, actions);
                }
                return;
            }
            PassOutcome::Failed if is_under_way => self.fail(from, to, digest, actions),
            // It was given up before.
            PassOutcome::Failed => {}
        }
        if holds
            && self.peers.get(&from).is_some_and(|failures| *failures < MOST_FAILURES)
            && let Some(offers) = self.offers.get_mut(&digest)
        {
            offers.push_back(from);
        }
        self.share_out_all(actions);
    }

    /// An upload takes long.
    pub(super) fn late(&mut self, worker: WorkerId, digest: Digest, actions: &mut Vec<Action>) {
        match self.under_way.get_mut(&(digest, worker)) {
            Some(Source::Worker(from)) => {
                let from = *from;
                self.fail(from, worker, digest, actions);
            }
            Some(Source::Coordinator { counts }) => {
                self.uploads -= usize::from(std::mem::take(counts));
                self.share_out_all(actions);
            }
            None => {}
        }
    }

    /// A worker is lost: what it passed on comes from the coordinator.
    pub(super) fn lose(&mut self, worker: WorkerId, actions: &mut Vec<Action>) {
        self.peers.remove(&worker);
        for places in self.waiting.values_mut().chain(self.offers.values_mut()) {
            places.retain(|waiting| *waiting != worker);
        }
        let mut orphans = vec![];
        for ((digest, to), source) in std::mem::take(&mut self.under_way) {
            match source {
                Source::Coordinator { counts } if to == worker => self.uploads -= usize::from(counts),
                Source::Worker(_) if to == worker => {}
                Source::Worker(from) if from == worker => orphans.push((digest, to)),
                _ => _ = self.under_way.insert((digest, to), source),
            }
        }
        orphans.into_iter().for_each(|(digest, to)| self.upload(to, digest, actions));
        self.share_out_all(actions);
    }

    /// A worker does not hold a replica any more, or does not need it.
    pub(super) fn forget(&mut self, worker: WorkerId, digest: Digest) {
        if let Some(offers) = self.offers.get_mut(&digest) {
            offers.retain(|offering| *offering != worker);
        }
    }

    /// A replica is not on its way to a worker any more: it does not take it.
    pub(super) fn refuse(&mut self, worker: WorkerId, digest: Digest, actions: &mut Vec<Action>) {
        self.stop_waiting(worker, digest);
        self.forget(worker, digest);
        if let Some(Source::Coordinator { counts }) = self.under_way.remove(&(digest, worker)) {
            self.uploads -= usize::from(counts);
        }
        self.share_out_all(actions);
    }

    /// A replica is not needed any more. Returns the workers that waited for it: to them it was never sent.
    pub(super) fn release(&mut self, digest: Digest, actions: &mut Vec<Action>) -> VecDeque<WorkerId> {
        let waited = self.waiting.remove(&digest).unwrap_or_default();
        self.offers.remove(&digest);
        let uploads = &mut self.uploads;
        self.under_way.retain(|(of, _), source| {
            if *of == digest
                && let Source::Coordinator { counts: true } = source
            {
                *uploads -= 1;
            }
            *of != digest
        });
        self.share_out_all(actions);
        waited
    }

    fn stop_waiting(&mut self, worker: WorkerId, digest: Digest) {
        if let Some(waiting) = self.waiting.get_mut(&digest) {
            waiting.retain(|waits| *waits != worker);
        }
    }

    /// A worker could not be given a replica by another one: it gets this and all later ones from the coordinator.
    fn fail(&mut self, from: WorkerId, to: WorkerId, digest: Digest, actions: &mut Vec<Action>) {
        self.failures += 1;
        self.peers.remove(&to);
        for offers in self.offers.values_mut() {
            offers.retain(|offering| *offering != to);
        }
        if let Some(failures) = self.peers.get_mut(&from) {
            *failures += 1;
        }
        self.upload(to, digest, actions);
    }

    /// The coordinator sends a replica, however much it does already.
    fn upload(&mut self, worker: WorkerId, digest: Digest, actions: &mut Vec<Action>) {
        self.under_way.insert((digest, worker), Source::Coordinator { counts: false });
        actions.push(Action::LoadReplica { worker, digest });
    }

    fn share_out_all(&mut self, actions: &mut Vec<Action>) {
        let waited_for: Vec<Digest> = self.waiting.keys().copied().collect();
        waited_for.into_iter().for_each(|digest| self.share_out(digest, actions));
    }

    /// Finds sources for those that wait for a replica.
    fn share_out(&mut self, digest: Digest, actions: &mut Vec<Action>) {
        let in_vain = self.passed == 0 && self.failures >= MOST_FAILURES_OF_ALL;
        let Some(waiting) = self.waiting.get_mut(&digest) else { return };
        while let Some(&worker) = waiting.front() {
            let offers = self.offers.get_mut(&digest).filter(|_| !in_vain);
            if let Some(from) = offers.and_then(VecDeque::pop_front) {
                self.under_way.insert((digest, worker), Source::Worker(from));
                actions.push(Action::PassReplica { from, worker, digest });
            } else if in_vain || self.uploads < self.most_uploads {
                self.uploads += usize::from(!in_vain);
                self.under_way.insert((digest, worker), Source::Coordinator { counts: !in_vain });
                actions.push(Action::LoadReplica { worker, digest });
            } else {
                return;
            }
            waiting.pop_front();
        }
        self.waiting.remove(&digest);
    }

    /// Checks that each of these replicas that are to be loaded is, and that nobody waits in vain.
    ///
    /// # Panics
    /// When it is not so.
    pub(super) fn sanity_check(&self, loading: &BTreeSet<(Digest, WorkerId)>) {
        let waiting =
            self.waiting.iter().flat_map(|(digest, all)| all.iter().map(|worker| (*digest, *worker)));
        let known: BTreeSet<_> = self.under_way.keys().copied().chain(waiting).collect();
        assert_eq!(known, *loading, "what is to be loaded is under way or waits, and nothing else");
        let count = self.under_way.values().filter(|source| **source == Source::Coordinator { counts: true });
        assert_eq!(count.count(), self.uploads, "uploads are counted");
        for (digest, waiting) in &self.waiting {
            let offers = self.offers.get(digest).is_some_and(|offers| !offers.is_empty());
            let is_free = offers || self.uploads < self.most_uploads;
            assert!(waiting.is_empty() || !is_free, "a worker waits for {digest} beside a free source");
        }
    }
}
