//! The cluster as a bake sees it.

use std::cmp::Reverse;
use std::time::Duration;

use bake::{BakeError, RowService};
use cluster::{FinishedJob, JobId};
use kernel::replica::{Digest, EncodedReplica};
use kernel::row::RowRequest;

use super::happenings::Happening;
use super::{Simulated, processor_times};

impl RowService for Simulated<'_> {
    fn publish(&mut self, replica: EncodedReplica) {
        self.charge();
        self.recorder.publish(replica);
        self.mark = processor_times();
    }

    fn release(&mut self, digest: Digest) {
        self.charge();
        self.foresee(self.now, Happening::Released(digest));
        self.mark = processor_times();
    }

    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>) {
        self.charge();
        let now = self.now;
        self.submitted.extend(requests.into_iter().map(|(job, request)| (now, job, request)));
        self.mark = processor_times();
    }

    fn threads(&self) -> usize {
        self.model.workers.len()
    }

    fn jobs_ahead(&self) -> usize {
        4 * self.model.workers.len() + self.ahead
    }

    fn withdraw(&mut self) {
        self.submitted.clear();
    }

    fn next(&mut self, _: Duration) -> Result<Option<FinishedJob>, BakeError> {
        self.charge();
        self.take_submitted();
        while self.results.is_empty() {
            let Reverse((time, _, happening)) = self.future.pop().expect("somebody answers");
            let waiting = self.waiting();
            self.account.wait(time, self.now, self.phase.get(), &waiting);
            self.happens(time, happening);
        }
        let (time, id) = self.results.pop_front().expect("there is one");
        self.now = self.now.max(time);
        // Who computes it a second time needs to know how long that takes.
        let rows = self.jobs[&id].rows.clone();
        let finished = FinishedJob {
            job: id,
            rows: rows.iter().map(|row| row.row.clone()).collect(),
            statistics: rows.iter().map(|row| row.statistics).collect(),
        };
        self.mark = processor_times();
        Ok(Some(finished))
    }
}
