use std::cmp::Ordering;
use std::collections::BTreeMap;

use shared::replica::Digest;

use super::JobId;

/// What the scheduler knows of a worker.
#[derive(Debug)]
pub(super) struct Worker {
    threads: usize,
    pub(super) replicas: BTreeMap<Digest, ReplicaState>,
    /// Jobs sent and not yet answered, in the order in which they were sent.
    pub(super) under_way: Vec<JobId>,
}

/// How far a replica is on a worker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ReplicaState {
    Loading,
    Loaded,
}

impl Worker {
    pub(super) fn new(threads: usize) -> Self {
        Self { threads: threads.max(1), replicas: BTreeMap::new(), under_way: vec![] }
    }

    /// One job computed and one waiting for each thread, and one on its way.
    fn room(&self) -> usize {
        2 * self.threads + 1
    }

    pub(super) fn has_room(&self) -> bool {
        self.under_way.len() < self.room()
    }

    /// Order by jobs per thread.
    pub(super) fn compare_load(&self, other: &Self) -> Ordering {
        (self.under_way.len() * other.threads).cmp(&(other.under_way.len() * self.threads))
    }

    pub(super) fn holds(&self, replicas: &[Digest]) -> bool {
        replicas.iter().all(|digest| self.replicas.get(digest) == Some(&ReplicaState::Loaded))
    }

    /// Takes a job from those under way; false where it is not one of them.
    pub(super) fn take_back(&mut self, job: JobId) -> bool {
        let place = self.under_way.iter().position(|held| *held == job);
        place.map(|place| self.under_way.remove(place)).is_some()
    }

    pub(super) fn sanity_check(&self) {
        assert!(self.under_way.len() <= self.room(), "more jobs under way than a worker may hold");
    }
}
