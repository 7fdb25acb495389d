//! Which workers, and what happens without any.

use std::num::NonZeroUsize;
use std::time::Duration;

use protocol::security::ClientSecurity;

use crate::metrics::Metrics;

/// The workers of a cluster.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Workers {
    /// A worker in this process.
    Embedded {
        /// Number of jobs that it computes at the same time.
        threads: usize,
    },
    /// Worker processes, each `host:port`. A name stands for all machines that it resolves to, now and later.
    Remote(Vec<String>),
}

/// When jobs are sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Schedule {
    /// As soon as a worker has finished one.
    #[default]
    Finished,
    /// Periodically, as a baseline for measurements.
    Periodic {
        /// The period.
        period: Duration,
    },
}

/// Settings of a cluster.
#[derive(Debug, Clone)]
pub struct ClusterSettings {
    /// The workers of a cluster.
    pub workers: Workers,
    /// When jobs are sent.
    pub schedule: Schedule,
    /// How long a cluster without workers waits for one, at the start and later.
    pub grace: Duration,
    /// Time after which a worker that was at fault, or refused to work, is dialled again; `None` for never.
    pub forgives: Option<Duration>,
    /// Threads of the worker that this process starts after the grace; `None` fails instead.
    pub fallback: Option<NonZeroUsize>,
    /// Security of connections to remote workers.
    pub security: ClientSecurity,
    /// Metrics of the cluster.
    pub metrics: Metrics,
}

impl ClusterSettings {
    /// Default grace: enough for a worker or its machine to restart.
    pub const DEFAULT_GRACE: Duration = Duration::from_secs(30);

    /// When a service dials such a worker again: it may have been replaced, and the job that it stumbled over be gone.
    pub const FORGIVES: Duration = Duration::from_secs(60);

    /// Waits for workers without a limit, as a service does.
    pub const ENDLESS_GRACE: Duration = Duration::MAX;
}

impl From<Workers> for ClusterSettings {
    fn from(workers: Workers) -> Self {
        Self {
            workers,
            schedule: Schedule::default(),
            grace: Self::DEFAULT_GRACE,
            forgives: None,
            fallback: None,
            security: ClientSecurity::default(),
            metrics: Metrics::default(),
        }
    }
}
