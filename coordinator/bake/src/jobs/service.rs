//! Whatever computes rows.

use std::time::Duration;

use kernel::replica::{Digest, EncodedReplica};
use kernel::row::{FinishedJob, JobId, RowRequest};

use super::time::ThreadTime;
use crate::error::{BakeError, Result};

/// Computes rows: a cluster of workers, in this process or elsewhere.
pub trait RowService {
    /// Publishes a replica before the first job that needs it. One may be published several times.
    fn publish(&mut self, replica: EncodedReplica);
    /// Takes back one [`Self::publish`]. No job needs the replica after the last one.
    fn release(&mut self, digest: Digest);
    /// Requests rows; earlier requests are more urgent. No job id may be used twice.
    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>);
    /// Forgets all unanswered jobs: none of them is answered any more.
    fn withdraw(&mut self);
    /// Returns how many jobs are computed at the same time now.
    fn threads(&self) -> usize {
        1
    }
    /// Returns how many jobs keep all threads busy: those computed, those that wait there, and those on their way.
    fn jobs_ahead(&self) -> usize {
        4 * self.threads()
    }
    /// Returns what the threads of the workers did so far; nothing where that is not known.
    fn thread_time(&self) -> ThreadTime {
        ThreadTime::default()
    }
    /// Waits for the next finished job, in any order. `None` where there is none within about `patience`.
    ///
    /// # Errors
    /// When no more rows can be had.
    fn next(&mut self, patience: Duration) -> Result<Option<FinishedJob>, BakeError>;
}

impl<S: RowService + ?Sized> RowService for &mut S {
    fn publish(&mut self, replica: EncodedReplica) {
        (**self).publish(replica);
    }

    fn release(&mut self, digest: Digest) {
        (**self).release(digest);
    }

    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>) {
        (**self).submit(requests);
    }

    fn withdraw(&mut self) {
        (**self).withdraw();
    }

    fn threads(&self) -> usize {
        (**self).threads()
    }

    fn jobs_ahead(&self) -> usize {
        (**self).jobs_ahead()
    }

    fn thread_time(&self) -> ThreadTime {
        (**self).thread_time()
    }

    fn next(&mut self, patience: Duration) -> Result<Option<FinishedJob>, BakeError> {
        (**self).next(patience)
    }
}
