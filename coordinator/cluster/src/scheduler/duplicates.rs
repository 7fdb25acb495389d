//! Copies of jobs that others are late with, for idle workers.
//!
//! A worker that is slow or hangs holds up all others once they wait for its jobs. So a worker with an idle thread and nothing in the
//! queue gets a second copy of a job that another one holds. The first answer counts, the other copy is cancelled. No job has more
//! than two copies, which bounds the waste; it should be next to nothing while all is well. In this order:
//!
//! 1. Jobs *overdue*. There is no clock here, but the other threads are one: with n of them busy, a job that is finished moves the
//!    time on by one nth of a *round*, and a job should take about one round. A job computed for
//!    [`PATIENCE`](super::index::PATIENCE) rounds is overdue.
//! 2. Jobs that *wait* for a thread of their worker: deepest in its line first, so that it comes to them last. If the idle worker
//!    is faster they are cancelled before they are begun, and nothing is wasted.
//! 3. The *oldest* job, if no other copy is under way anywhere. The caller waits for it in the end. While all others are idle
//!    no event would follow without a copy.

use super::event::{Action, WorkerId};
use super::held::Candidate;
use super::job::Job;
use super::state::Scheduler;

impl Scheduler {
    /// Gives copies of jobs under way to idle workers, for which nothing is left in the queue.
    pub(super) fn share_duplicates(&mut self, actions: &mut Vec<Action>) {
        self.index.pass_time(self.rounds);
        let mut helped = self.index.news_is_due(self.rounds);
        let mut last = None;
        while self.index.has_candidates(!helped)
            && let Some(load) = self.index.idle_after(last)
        {
            last = Some(load);
            let id = load.worker;
            while self.reserved != Some(id)
                && self.workers[&id].is_idle()
                && self.duplicate_one(id, helped, actions)
            {
                helped = true;
            }
        }
    }

    /// Jobs that idle workers may take over, most urgent first; with `all`, also those that are computed in time.
    fn candidates(&self, all: bool) -> impl Iterator<Item = Candidate> + '_ {
        let lines = self.index.with_lines().flat_map(|holder| self.workers[&holder].line());
        let in_time = self.index.in_time().filter(move |_| all);
        self.index.overdue().chain(lines).chain(in_time)
    }

    /// Whether a worker may compute a copy of a job: a suspect only while it is empty.
    pub(super) fn may_copy(&self, id: WorkerId, job: &Job) -> bool {
        self.may_try(id, &job.kind) && (!job.is_suspect() || self.workers[&id].under_way.is_empty())
    }

    /// Gives an idle worker a copy of the first job that it may compute, or the replicas that it lacks for it. False where it gets no
    /// job.
    fn duplicate_one(&mut self, id: WorkerId, helped: bool, actions: &mut Vec<Action>) -> bool {
        let may_copy = |candidate: &Candidate| {
            let state = self.jobs.get(&candidate.job).filter(|_| candidate.holder != id);
            state.is_some_and(|state| self.may_copy(id, state))
        };
        let Some(Candidate { job, .. }) = self.candidates(!helped).find(may_copy) else { return false };
        let state = &self.jobs[&job];
        let is_suspect = state.is_suspect();
        if self.workers[&id].holds(&state.kind.needs) {
            self.send(id, job, is_suspect, actions);
            return true;
        }
        let needs = state.kind.needs.clone();
        self.load(id, &needs, actions);
        false
    }
}
