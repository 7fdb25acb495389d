//! Events, actions and policies of the scheduler.

use kernel::replica::Digest;
use kernel::row::JobId;

/// Name of one connection to a worker; a worker that comes back gets another one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct WorkerId(pub u32);

/// When jobs are sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Policy {
    /// As soon as possible: as a rule when another job is finished.
    #[default]
    Finished,
    /// On [`Event::Tick`] only. Slower at any period; kept as a baseline for measurements.
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

/// An event.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Event {
    /// A worker is ready. It holds no replicas as far as is known.
    WorkerConnected {
        /// The worker.
        worker: WorkerId,
        /// Number of jobs that it computes at the same time.
        threads: usize,
    },
    /// A worker is gone. Its jobs go back to their places in the queue.
    WorkerLost {
        /// The worker.
        worker: WorkerId,
        /// True where it said goodbye, or was told to leave: then it does not count against the jobs that it held.
        orderly: bool,
    },
    /// A worker may hold more jobs than before, or fewer: it is far away for the time that jobs take.
    RoomChanged {
        /// The worker.
        worker: WorkerId,
        /// Most jobs that it may hold. What it holds already it keeps, and it may hold two per thread and one more in any case.
        jobs: usize,
    },
    /// There is more to do. Jobs that are known already are left as they are.
    Submitted {
        /// The jobs, most urgent first, each with the replicas that it needs. They come after all that wait already.
        jobs: Vec<(JobId, Vec<Digest>)>,
    },
    /// These jobs are not wanted any more. Those that are over or unknown are ignored.
    Withdrawn {
        /// The jobs.
        jobs: Vec<JobId>,
    },
    /// A worker passes replicas on to others, and takes them from others.
    PassesReplicas {
        /// The worker.
        worker: WorkerId,
    },
    /// A replica was passed on, or not. That it has arrived its new holder tells itself.
    PassEnded {
        /// The worker that was told to pass it on.
        from: WorkerId,
        /// Its destination.
        worker: WorkerId,
        /// The replica.
        digest: Digest,
        /// How it went.
        outcome: PassOutcome,
    },
    /// A replica takes long: more than [`patience`](super::patience) says.
    ReplicaLate {
        /// Its destination.
        worker: WorkerId,
        /// The replica.
        digest: Digest,
    },
    /// A replica has arrived.
    ReplicaLoaded {
        /// The worker that holds it.
        worker: WorkerId,
        /// The replica.
        digest: Digest,
    },
    /// A worker does not take a replica: it is too large for it, say. Jobs that need it go to others.
    ReplicaRefused {
        /// The worker.
        worker: WorkerId,
        /// The replica.
        digest: Digest,
    },
    /// Jobs that no worker takes the replicas of are not to wait for one any longer.
    GaveUpOnRefused,
    /// Jobs that follow need this replica, on all workers: it is loaded while these have nothing to do.
    Announced {
        /// The replica.
        digest: Digest,
    },
    /// No job that is submitted from now on needs this replica.
    Released {
        /// The replica.
        digest: Digest,
    },
    /// A job is done.
    Finished {
        /// Its worker.
        worker: WorkerId,
        /// The job.
        job: JobId,
    },
    /// A worker was told to cancel a job before it had begun it.
    Cancelled {
        /// The worker that answered.
        worker: WorkerId,
        /// The job.
        job: JobId,
    },
    /// A worker does not hold the replicas of a job any more. Does not count as a try.
    ForgotReplica {
        /// The worker that answered.
        worker: WorkerId,
        /// The job.
        job: JobId,
    },
    /// A worker failed while it computed a job: another one may do better.
    Failed {
        /// The worker that failed.
        worker: WorkerId,
        /// The job.
        job: JobId,
    },
    /// A worker says that a job is invalid: so would every other one.
    Refused {
        /// The worker that answered.
        worker: WorkerId,
        /// The job.
        job: JobId,
    },
    /// The end of a period of [`Policy::Periodic`].
    Tick,
}

/// How passing a replica on went.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PassOutcome {
    /// It is there.
    Done,
    /// The worker that was to pass it on does not hold it any more.
    NotHeld,
    /// The other worker cannot be reached, or does not take it.
    Failed,
}

/// An action to carry out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Action {
    /// Load a replica to a worker, also where another one was to pass it on and that took long or failed.
    LoadReplica {
        /// Its destination.
        worker: WorkerId,
        /// The replica.
        digest: Digest,
    },
    /// Have a worker pass a replica on that it holds.
    PassReplica {
        /// The worker.
        from: WorkerId,
        /// Its destination.
        worker: WorkerId,
        /// The replica.
        digest: Digest,
    },
    /// Tell a worker that it may forget a replica.
    ReleaseReplica {
        /// The worker.
        worker: WorkerId,
        /// The replica.
        digest: Digest,
    },
    /// Send a job to a worker, which must answer it exactly once.
    Send {
        /// Its destination.
        worker: WorkerId,
        /// The job.
        job: JobId,
    },
    /// Tell a worker that a job it holds is not wanted any more. It still answers.
    Cancel {
        /// The worker.
        worker: WorkerId,
        /// The job.
        job: JobId,
    },
    /// Hand over the answer that came with the event: it is the first one to this job, and no other will follow.
    Deliver {
        /// The job.
        job: JobId,
    },
    /// Report that a job is given up.
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
    /// It failed [`super::limits::MOST_FAILURES`] times.
    #[error("it failed on {} tries", super::limits::MOST_FAILURES)]
    FailedTooOften,
    /// A worker says that it is invalid.
    #[error("the worker refused it")]
    Refused,
    /// Of the workers that are there, none takes a replica that it needs.
    #[error("no worker takes a replica that it needs")]
    ReplicaRefused,
    /// Workers forgot its replicas [`super::limits::MOST_RELOADS`] times.
    #[error("workers keep forgetting its replicas: give them more room with --replica-bytes")]
    ReplicasForgotten,
    /// Workers were lost [`super::limits::MOST_LOSSES_ALONE`] times while they computed nothing else.
    #[error(
        "{} workers were lost while they computed this job and nothing else: see their logs, or give them more memory",
        super::limits::MOST_LOSSES_ALONE
    )]
    KillsWorkers,
}
