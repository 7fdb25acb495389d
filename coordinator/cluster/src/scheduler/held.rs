//! What is known of a job that a worker holds, and of where workers stand among others.

use std::cmp::{Ordering, Reverse};

use kernel::row::JobId;

use super::event::WorkerId;

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

impl Held {
    /// Whether another worker may take the job over.
    pub(super) fn is_free(&self) -> bool {
        self.wanted && !self.twice
    }

    pub(super) fn candidate(&self, holder: WorkerId) -> Candidate {
        Candidate { order: self.order, job: self.job, holder }
    }
}

/// A job under way that an idle worker may take over. Ordered by submission.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Candidate {
    pub(super) order: u64,
    pub(super) job: JobId,
    pub(super) holder: WorkerId,
}

/// Where a worker stands in the index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Standing {
    pub(super) load: Load,
    pub(super) has_room: bool,
    pub(super) is_idle: bool,
    pub(super) busy: usize,
    /// Threads without a job while a replica is on its way.
    pub(super) loading: usize,
    /// The job that comes to be computed last, by depth in the line.
    pub(super) deepest: Option<(Reverse<usize>, Candidate)>,
}

/// How much a worker has to do: ordered by jobs per thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Load {
    pub(super) under_way: usize,
    pub(super) threads: usize,
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
