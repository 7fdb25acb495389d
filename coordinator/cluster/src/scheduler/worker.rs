//! State of a worker.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use kernel::replica::Digest;
use kernel::row::JobId;

use super::event::WorkerId;
use super::held::{Candidate, Held, Load, Standing};
use super::index::Index;

#[derive(Debug, Clone)]
pub(super) struct Worker {
    pub(super) id: WorkerId,
    threads: usize,
    /// Most jobs that it may hold.
    room: usize,
    pub(super) replicas: BTreeMap<Digest, ReplicaState>,
    /// Jobs sent and not yet answered, in the order in which they were sent.
    pub(super) under_way: Vec<Held>,
    /// Where it stands in the index, if it does.
    pub(super) standing: Option<Standing>,
}

/// How far a replica is on a worker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ReplicaState {
    Loading,
    Loaded,
}

/// Jobs that a worker of this many threads holds at least: one computed and one waiting for each thread, and one on its way.
fn least_room(threads: usize) -> usize {
    2 * threads + 1
}

impl Worker {
    pub(super) fn new(id: WorkerId, threads: usize) -> Self {
        let threads = threads.max(1);
        let (replicas, under_way) = (BTreeMap::new(), vec![]);
        Self { id, threads, room: least_room(threads), replicas, under_way, standing: None }
    }

    /// It may hold this many jobs, if that is enough for its threads.
    pub(super) fn set_room(&mut self, jobs: usize) {
        self.room = jobs.max(least_room(self.threads));
    }

    pub(super) fn has_room(&self) -> bool {
        self.under_way.len() < self.room && !self.is_alone()
    }

    /// A thread has nothing to do, nor will have soon: no replica is on its way.
    pub(super) fn is_idle(&self) -> bool {
        self.under_way.len() < self.threads && !self.is_alone() && !self.is_loading()
    }

    fn is_loading(&self) -> bool {
        self.replicas.values().any(|replica| *replica == ReplicaState::Loading)
    }

    fn is_alone(&self) -> bool {
        self.under_way.first().is_some_and(|held| held.alone)
    }

    /// Threads that compute.
    pub(super) fn busy(&self) -> usize {
        self.under_way.len().min(self.threads)
    }

    /// Threads without a job while a replica is on its way.
    fn loading(&self) -> usize {
        if self.is_loading() { self.threads - self.busy() } else { 0 }
    }

    pub(super) fn load(&self) -> Load {
        Load { under_way: self.under_way.len(), threads: self.threads, worker: self.id }
    }

    /// Of the jobs that wait for a thread and that nobody else holds, the first of those that come to be computed last; with their
    /// depth in the line, in jobs per thread.
    pub(super) fn deepest(&self) -> Option<(Reverse<usize>, Candidate)> {
        let mut deepest = None;
        for (place, held) in self.under_way.iter().enumerate().skip(self.threads).rev() {
            let depth = place / self.threads;
            if deepest.is_some_and(|(Reverse(found), _)| depth < found) {
                break;
            }
            if held.is_free() {
                let candidate = (Reverse(depth), held.candidate(self.id));
                deepest = Some(deepest.map_or(candidate, |found| candidate.min(found)));
            }
        }
        deepest
    }

    /// All jobs that wait for a thread and that nobody else holds, the deepest in the line first.
    pub(super) fn line(&self) -> Vec<Candidate> {
        let waiting = self.under_way.iter().enumerate().skip(self.threads).filter(|(_, held)| held.is_free());
        let mut line: Vec<_> =
            waiting.map(|(place, held)| (Reverse(place / self.threads), held.candidate(self.id))).collect();
        line.sort_unstable();
        line.into_iter().map(|(_, candidate)| candidate).collect()
    }

    pub(super) fn holds(&self, replicas: &[Digest]) -> bool {
        replicas.iter().all(|digest| self.replicas.get(digest) == Some(&ReplicaState::Loaded))
    }

    /// Takes its place in the index: it has changed, or is new.
    pub(super) fn place(&mut self, index: &mut Index) {
        let standing = Standing {
            load: self.load(),
            has_room: self.has_room(),
            is_idle: self.is_idle(),
            busy: self.busy(),
            loading: self.loading(),
            deepest: self.deepest(),
        };
        index.place(&mut self.standing, standing);
    }

    /// Takes one more job, `rounds` after the start.
    pub(super) fn take(&mut self, held: Held, rounds: f64, index: &mut Index) {
        index.note(self.id, &held);
        self.under_way.push(held);
        self.begin(rounds, index);
        self.place(index);
    }

    /// Takes a job from those under way; `None` where it is not one of them.
    pub(super) fn take_back(&mut self, job: JobId, rounds: f64, index: &mut Index) -> Option<Held> {
        let place = self.under_way.iter().position(|held| held.job == job)?;
        let held = self.under_way.remove(place);
        index.forget(self.id, &held);
        self.begin(rounds, index);
        self.place(index);
        Some(held)
    }

    /// Jobs are begun in the order in which they were sent.
    fn begin(&mut self, rounds: f64, index: &mut Index) {
        for held in self.under_way.iter_mut().take(self.threads).filter(|held| held.begun.is_none()) {
            index.forget(self.id, held);
            held.begun = Some(rounds);
            index.note(self.id, held);
        }
    }

    /// Changes what is known of a job that the worker holds. Returns whether it holds it.
    pub(super) fn change(&mut self, job: JobId, index: &mut Index, change: impl FnOnce(&mut Held)) -> bool {
        let Some(held) = self.under_way.iter_mut().find(|held| held.job == job) else { return false };
        index.forget(self.id, held);
        change(held);
        index.note(self.id, held);
        self.place(index);
        true
    }

    pub(super) fn sanity_check(&self) {
        assert!(self.under_way.len() <= self.room, "more jobs under way than a worker may hold");
        let alone = self.under_way.iter().any(|held| held.alone);
        assert!(!alone || self.under_way.len() == 1, "a job that must be alone is not");
        for (place, held) in self.under_way.iter().enumerate() {
            assert_eq!(held.begun.is_some(), place < self.threads, "the first jobs are those that are begun");
        }
    }
}
