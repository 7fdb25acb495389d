//! When jobs are suspected or given up.

/// Failed tries after which a job is given up: the fault is the job's.
pub const MOST_FAILURES: usize = 3;

/// Times that workers forget a job's replicas before it is given up: their stores are too small, and each upload would evict what the
/// next job needs.
pub const MOST_RELOADS: usize = 100;

/// Lost workers after which a job that they held is a suspect: it may be what breaks them. From then on it is sent to an empty worker
/// only, and alone, so that no other job shares the blame.
pub const SUSPECT_LOSSES: usize = 2;

/// Workers lost while they computed nothing but a suspect before it is given up. Lost workers are dialled again within two seconds, so
/// that a bad network alone may take three from one job.
pub const MOST_LOSSES_ALONE: usize = 4;
