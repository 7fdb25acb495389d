//! Who works, and what happens when nobody does.

use std::num::NonZeroUsize;
use std::time::Duration;

use protocol::security::ClientSecurity;

use crate::metrics::Metrics;

/// Who works.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Workers {
    /// A worker in this process.
    Embedded {
        /// How many jobs it computes at the same time.
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
    /// When a timer rings: to measure against.
    Periodic {
        /// From one time to the next.
        period: Duration,
    },
}

/// All that a cluster is told at its start.
#[derive(Debug, Clone)]
pub struct ClusterSettings {
    /// Who works.
    pub workers: Workers,
    /// When jobs are sent.
    pub schedule: Schedule,
    /// How long a cluster without any worker waits for one, at the start and later.
    pub grace: Duration,
    /// Threads of the worker that this process starts when the grace is over. None: the cluster fails then.
    pub fallback: Option<NonZeroUsize>,
    /// How remote workers are talked to.
    pub security: ClientSecurity,
    /// Where the cluster counts what it does.
    pub metrics: Metrics,
}

impl ClusterSettings {
    /// How long a cluster waits where nobody asks for more or less: a worker that restarts, or a machine that does.
    pub const DEFAULT_GRACE: Duration = Duration::from_secs(30);

    /// Waits on, however long no worker comes: for a service, whose workers come back.
    pub const ENDLESS_GRACE: Duration = Duration::MAX;
}

impl From<Workers> for ClusterSettings {
    fn from(workers: Workers) -> Self {
        Self {
            workers,
            schedule: Schedule::default(),
            grace: Self::DEFAULT_GRACE,
            fallback: None,
            security: ClientSecurity::default(),
            metrics: Metrics::default(),
        }
    }
}
