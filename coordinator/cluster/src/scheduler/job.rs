//! State of a job, and the queue of those that wait.

use std::collections::{BTreeMap, BTreeSet};

use kernel::replica::Digest;
use kernel::row::JobId;
use smallvec::SmallVec;

use super::event::WorkerId;
use super::limits::SUSPECT_LOSSES;

/// A job that is not over.
#[derive(Debug)]
pub(super) struct Job {
    /// Place in the order of submission.
    pub(super) order: u64,
    pub(super) kind: Kind,
    pub(super) reloads: usize,
    /// Times that a worker was lost that held it.
    pub(super) losses: usize,
    /// Times that a worker was lost that held nothing else.
    pub(super) losses_alone: usize,
    /// Workers that hold it: none while it waits, two at most.
    pub(super) holders: SmallVec<[WorkerId; 2]>,
}

/// Properties that decide which workers may compute a job. Jobs of one kind differ only in their order.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Kind {
    /// Replicas that it needs.
    pub(super) needs: Vec<Digest>,
    /// Which worker failed on it, each time.
    pub(super) failures: Vec<WorkerId>,
}

impl Job {
    pub(super) fn new(order: u64, needs: Vec<Digest>) -> Self {
        let kind = Kind { needs, failures: vec![] };
        Self { order, kind, reloads: 0, losses: 0, losses_alone: 0, holders: SmallVec::new() }
    }

    /// Enough workers were lost with it that it may be what broke them.
    pub(super) fn is_suspect(&self) -> bool {
        self.losses >= SUSPECT_LOSSES
    }
}

/// Jobs that no worker holds, in the order of submission.
#[derive(Debug, Default)]
pub(super) struct Queue {
    /// By kind: many jobs wait, but of few kinds.
    kinds: BTreeMap<Kind, BTreeSet<(u64, JobId)>>,
    suspects: BTreeSet<(u64, JobId)>,
}

impl Queue {
    pub(super) fn insert(&mut self, id: JobId, job: &Job) {
        let place = (job.order, id);
        if job.is_suspect() {
            self.suspects.insert(place);
        } else if let Some(same) = self.kinds.get_mut(&job.kind) {
            same.insert(place);
        } else {
            self.kinds.insert(job.kind.clone(), BTreeSet::from([place]));
        }
    }

    pub(super) fn remove(&mut self, id: JobId, job: &Job) {
        let place = (job.order, id);
        if job.is_suspect() {
            self.suspects.remove(&place);
        } else if let Some(same) = self.kinds.get_mut(&job.kind) {
            same.remove(&place);
            if same.is_empty() {
                self.kinds.remove(&job.kind);
            }
        }
    }

    /// No job waits, suspects apart.
    pub(super) fn is_empty(&self) -> bool {
        self.kinds.is_empty()
    }

    /// Whether a job of this kind waits, suspects apart.
    pub(super) fn has(&self, kind: &Kind) -> bool {
        self.kinds.contains_key(kind)
    }

    /// Kinds of the jobs that wait, suspects apart.
    pub(super) fn kinds(&self) -> impl Iterator<Item = &Kind> {
        self.kinds.keys()
    }

    /// The first job of each kind, the oldest first; suspects apart.
    pub(super) fn first_of_each_kind(&self) -> Vec<(u64, JobId, &Kind)> {
        let first =
            |(kind, same): (_, &BTreeSet<(u64, JobId)>)| same.first().map(|&(order, job)| (order, job, kind));
        let mut all: Vec<_> = self.kinds.iter().filter_map(first).collect();
        all.sort_unstable_by_key(|first| first.0);
        all
    }

    /// Those that are sent to an empty worker only, the oldest first.
    pub(super) fn suspects(&self) -> impl Iterator<Item = JobId> + '_ {
        self.suspects.iter().map(|(_, job)| *job)
    }

    /// A job of each kind, and all suspects.
    pub(super) fn first_of_each_kind_and_suspects(&self) -> impl Iterator<Item = JobId> + '_ {
        let first = self.kinds.values().filter_map(|same| same.first());
        first.chain(&self.suspects).map(|(_, job)| *job)
    }

    /// All that wait, suspects apart.
    pub(super) fn unsuspected(&self) -> impl Iterator<Item = JobId> + '_ {
        self.kinds.values().flatten().map(|(_, job)| *job)
    }
}
