use std::fmt;

use super::Row;
use crate::messages::RowStatistics;

/// Name of a job, chosen by its submitter; never used twice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct JobId(pub u64);

impl fmt::Display for JobId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// The answer to a job.
#[derive(Debug, Clone, PartialEq)]
pub struct FinishedJob {
    /// The job.
    pub job: JobId,
    /// One row for each shooter of the request, each with a factor for each receiver of its range.
    pub rows: Vec<Row>,
    /// What each of them cost.
    pub statistics: Vec<RowStatistics>,
}
