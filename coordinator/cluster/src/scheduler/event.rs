//! What the scheduler is told, and what it wants done.

use kernel::replica::Digest;
use kernel::row::JobId;

/// Name of one connection to a worker; a worker that comes back gets another one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct WorkerId(pub u32);

/// When jobs are sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Policy {
    /// At once, whatever made it possible: as a rule the FINISHED of another job.
    #[default]
    Finished,
    /// On [`Event::Tick`] only. Slower at any period; kept to measure against.
    Periodic,
}

impl Policy {
    /// Whether jobs are sent after this event.
    pub(super) fn decides_on(self, event: &Event) -> bool {
        match self {
            Self::Finished => true,
            Self::Periodic => *event == Event::Tick,
        }
    }

    /// Whether jobs may wait although a worker has room for them.
    pub(super) fn waits(self) -> bool {
        match self {
            Self::Finished => false,
            Self::Periodic => true,
        }
    }
}

/// What happened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Event {
    /// A worker is ready. It holds no replicas as far as is known.
    WorkerConnected {
        /// The worker.
        worker: WorkerId,
        /// How many jobs it computes at the same time.
        threads: usize,
    },
    /// A worker is gone. Its jobs go back to their places in the queue.
    WorkerLost {
        /// The worker.
        worker: WorkerId,
        /// True where it said goodbye, or was told to leave: then it does not count against the jobs that it held.
        orderly: bool,
    },
    /// There is more to do. Jobs that are known already are left as they are.
    Submitted {
        /// The jobs, most urgent first, each with the replicas that it needs. They come after all that wait already.
        jobs: Vec<(JobId, Vec<Digest>)>,
    },
    /// Nobody waits for these jobs any more. Those that are over, or unknown, do no harm.
    Withdrawn {
        /// The jobs.
        jobs: Vec<JobId>,
    },
    /// A replica has arrived.
    ReplicaLoaded {
        /// Where.
        worker: WorkerId,
        /// The replica.
        digest: Digest,
    },
    /// No job that is submitted from now on needs this replica.
    Released {
        /// The replica.
        digest: Digest,
    },
    /// FINISHED: a job is done.
    Finished {
        /// Who did it.
        worker: WorkerId,
        /// The job.
        job: JobId,
    },
    /// A worker had not begun a job when it heard that it is not wanted any more.
    Cancelled {
        /// Who answered so.
        worker: WorkerId,
        /// The job.
        job: JobId,
    },
    /// A worker does not hold the replicas of a job any more. Does not count as a try.
    ForgotReplica {
        /// Who answered so.
        worker: WorkerId,
        /// The job.
        job: JobId,
    },
    /// A worker failed in the middle of a job: another one may do better.
    Failed {
        /// Who failed.
        worker: WorkerId,
        /// The job.
        job: JobId,
    },
    /// A worker says that a job makes no sense: so would every other one.
    Refused {
        /// Who answered so.
        worker: WorkerId,
        /// The job.
        job: JobId,
    },
    /// A period is over: see [`Policy::Periodic`].
    Tick,
}

/// What is to be done.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Action {
    /// Load a replica to a worker.
    LoadReplica {
        /// Where to.
        worker: WorkerId,
        /// The replica.
        digest: Digest,
    },
    /// Tell a worker that it may forget a replica.
    ReleaseReplica {
        /// Whom.
        worker: WorkerId,
        /// The replica.
        digest: Digest,
    },
    /// Send a job to a worker, which must answer it once, whatever comes after.
    Send {
        /// Where to.
        worker: WorkerId,
        /// The job.
        job: JobId,
    },
    /// Tell a worker that a job it holds is not wanted any more. It answers all the same.
    Cancel {
        /// Whom.
        worker: WorkerId,
        /// The job.
        job: JobId,
    },
    /// Hand over the answer that came with the event: it is the first one to this job, and no other will follow.
    Deliver {
        /// The job.
        job: JobId,
    },
    /// Report that a job cannot be done.
    Abandon {
        /// The job.
        job: JobId,
        /// Why.
        why: Abandonment,
    },
}

/// Why a job is given up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Abandonment {
    /// It failed on [`super::MOST_FAILURES`] tries.
    #[error("it failed on {} tries", super::MOST_FAILURES)]
    FailedTooOften,
    /// A worker says that it makes no sense.
    #[error("the worker refused it")]
    Refused,
    /// Workers forgot its replicas [`super::MOST_RELOADS`] times.
    #[error("workers keep forgetting its replicas: give them more room with --replica-bytes")]
    ReplicasForgotten,
    /// Workers were lost [`super::MOST_LOSSES_ALONE`] times while they computed nothing else.
    #[error(
        "{} workers were lost while they computed this job and nothing else: see their logs, or give them more memory",
        super::MOST_LOSSES_ALONE
    )]
    KillsWorkers,
}
