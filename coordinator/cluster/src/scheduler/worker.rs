//! State of a worker.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use kernel::replica::Digest;
use kernel::row::JobId;

use super::event::WorkerId;

#[derive(Debug)]
pub(super) struct Worker {
    threads: usize,
    pub(super) replicas: BTreeMap<Digest, ReplicaState>,
    /// Jobs sent and not yet answered, in the order in which they were sent.
    pub(super) under_way: Vec<Held>,
}

/// How far a replica is on a worker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ReplicaState {
    Loading,
    Loaded,
}

/// A job that a worker holds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Held {
    pub(super) job: JobId,
    /// Place of the job in the order of submission.
    pub(super) order: u64,
    /// The job is to be the only one of this worker, from when it is sent to when it is answered.
    pub(super) alone: bool,
    /// Another worker held it when it was sent.
    pub(super) copy: bool,
    /// Another worker holds it too.
    pub(super) twice: bool,
    /// False once the job is over: the answer is then dropped.
    pub(super) wanted: bool,
    /// The job was withdrawn: its answer is dropped, and is no duplicate.
    pub(super) withdrawn: bool,
    /// When it came to be computed, in rounds (see [`super::duplicates`]); `None` while it waits for a thread.
    pub(super) begun: Option<f64>,
}

impl Worker {
    pub(super) fn new(threads: usize) -> Self {
        Self { threads: threads.max(1), replicas: BTreeMap::new(), under_way: vec![] }
    }

    pub(super) fn threads(&self) -> usize {
        self.threads
    }

    /// One job computed and one waiting for each thread, and one on its way.
    fn room(&self) -> usize {
        2 * self.threads + 1
    }

    pub(super) fn has_room(&self) -> bool {
        self.under_way.len() < self.room() && !self.is_alone()
    }

    /// A thread has nothing to do, nor will have soon: no replica is on its way.
    pub(super) fn is_idle(&self) -> bool {
        self.under_way.len() < self.threads
            && !self.is_alone()
            && self.replicas.values().all(|replica| *replica == ReplicaState::Loaded)
    }

    fn is_alone(&self) -> bool {
        self.under_way.first().is_some_and(|held| held.alone)
    }

    /// Threads that compute.
    pub(super) fn busy(&self) -> usize {
        self.under_way.len().min(self.threads)
    }

    pub(super) fn load(&self, worker: WorkerId) -> Load {
        Load { under_way: self.under_way.len(), threads: self.threads, worker }
    }

    pub(super) fn holds(&self, replicas: &[Digest]) -> bool {
        replicas.iter().all(|digest| self.replicas.get(digest) == Some(&ReplicaState::Loaded))
    }

    /// Takes one more job, `rounds` after the start.
    pub(super) fn take(&mut self, held: Held, rounds: f64) {
        self.under_way.push(held);
        self.begin(rounds);
    }

    /// Takes a job from those under way; `None` where it is not one of them.
    pub(super) fn take_back(&mut self, job: JobId, rounds: f64) -> Option<Held> {
        let place = self.under_way.iter().position(|held| held.job == job)?;
        let held = self.under_way.remove(place);
        self.begin(rounds);
        Some(held)
    }

    /// Jobs are begun in the order in which they were sent.
    fn begin(&mut self, rounds: f64) {
        for held in self.under_way.iter_mut().take(self.threads) {
            held.begun.get_or_insert(rounds);
        }
    }

    pub(super) fn held_mut(&mut self, job: JobId) -> Option<&mut Held> {
        self.under_way.iter_mut().find(|held| held.job == job)
    }

    pub(super) fn sanity_check(&self) {
        assert!(self.under_way.len() <= self.room(), "more jobs under way than a worker may hold");
        let alone = self.under_way.iter().any(|held| held.alone);
        assert!(!alone || self.under_way.len() == 1, "a job that must be alone is not");
        for (place, held) in self.under_way.iter().enumerate() {
            assert_eq!(held.begun.is_some(), place < self.threads, "the first jobs are those that are begun");
        }
    }
}

/// How much a worker has to do: ordered by jobs per thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Load {
    under_way: usize,
    threads: usize,
    pub(super) worker: WorkerId,
}

impl Ord for Load {
    fn cmp(&self, other: &Self) -> Ordering {
        let per_thread = (self.under_way * other.threads).cmp(&(other.under_way * self.threads));
        per_thread.then(self.worker.cmp(&other.worker))
    }
}

impl PartialOrd for Load {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
