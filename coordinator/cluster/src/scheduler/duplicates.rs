//! Copies of jobs that others are late with, for idle workers.
//!
//! A worker that is slow or hangs holds up all others once they wait for its jobs. So a worker with an idle thread and nothing in the
//! queue gets a second copy of a job that another one holds. The first answer counts, the other copy is cancelled. No job has more
//! than two copies, which bounds the waste; it should be next to nothing while all is well. In this order:
//!
//! 1. Jobs *overdue*. There is no clock here, but the other threads are one: with n of them busy, a job that is finished moves the
//!    time on by one nth of a *round*, and a job should take about one round. A job computed for [`PATIENCE`] rounds is overdue.
//! 2. Jobs that *wait* for a thread of their worker: deepest in its line first, so that it comes to them last. If the idle worker
//!    is faster they are cancelled before they are begun, and nothing is wasted.
//! 3. The *oldest* job, if no other copy is under way anywhere. The caller waits for it in the end. While all others are idle
//!    no event would follow without a copy.

use std::cmp::Reverse;

use kernel::row::JobId;

use super::event::{Action, WorkerId};
use super::job::Job;
use super::state::Scheduler;
use super::worker::{Load, Worker};

/// Rounds after which a job that is computed is overdue. At the end of a batch, when no more jobs follow, n busy threads
/// become one in ln n rounds: of 64 the last three are then given to others, of which there are plenty.
pub(super) const PATIENCE: f64 = 3.0;

/// A job that an idle worker may take over.
#[derive(Clone, Copy)]
struct Candidate {
    /// Lowest first; see above.
    rank: (Rank, u64),
    job: JobId,
    holder: WorkerId,
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Rank {
    Overdue,
    /// Depth in the line of its worker, in jobs per thread: deepest first.
    Waiting(Reverse<usize>),
    Oldest,
}

impl Scheduler {
    /// Gives copies of jobs under way to idle workers, for which nothing is left in the queue.
    pub(super) fn share_duplicates(&mut self, actions: &mut Vec<Action>) {
        let is_idle = |(id, worker): &(&WorkerId, &Worker)| worker.is_idle() && self.reserved != Some(**id);
        let mut idle: Vec<Load> =
            self.workers.iter().filter(is_idle).map(|(id, worker)| worker.load(*id)).collect();
        if idle.is_empty() {
            return;
        }
        let mut helped = self.news_is_due();
        let mut candidates = self.candidates(!helped);
        idle.sort_unstable();
        for id in idle.into_iter().map(|load| load.worker) {
            while self.workers[&id].is_idle() && self.duplicate_one(id, &mut candidates, helped, actions) {
                helped = true;
            }
        }
    }

    /// A copy is under way, so that there will be news of it; one that is overdue itself promises nothing.
    pub(super) fn news_is_due(&self) -> bool {
        let mut held = self.workers.values().flat_map(|worker| &worker.under_way);
        held.any(|held| held.copy && held.begun.is_none_or(|begun| self.rounds - begun < PATIENCE))
    }

    /// Jobs that idle workers may take over, most urgent first; with `all`, also those that are computed in time.
    fn candidates(&self, all: bool) -> Vec<Candidate> {
        let mut candidates = vec![];
        for (&holder, worker) in &self.workers {
            for (place, held) in worker.under_way.iter().enumerate() {
                if held.twice || !held.wanted {
                    continue;
                }
                let rank = match held.begun {
                    None => Rank::Waiting(Reverse(place / worker.threads())),
                    Some(begun) if self.rounds - begun >= PATIENCE => Rank::Overdue,
                    Some(_) if all => Rank::Oldest,
                    Some(_) => continue,
                };
                candidates.push(Candidate { rank: (rank, held.order), job: held.job, holder });
            }
        }
        candidates.sort_unstable_by_key(|candidate| candidate.rank);
        candidates
    }

    /// Whether a worker may compute a copy of a job: a suspect only while it is empty.
    pub(super) fn may_copy(&self, id: WorkerId, job: &Job) -> bool {
        self.may_try(id, &job.kind) && (!job.is_suspect() || self.workers[&id].under_way.is_empty())
    }

    /// Gives an idle worker a copy of the first job that it can compute. False where there is none.
    fn duplicate_one(
        &mut self,
        id: WorkerId,
        candidates: &mut Vec<Candidate>,
        helped: bool,
        actions: &mut Vec<Action>,
    ) -> bool {
        for place in 0..candidates.len() {
            let Candidate { rank, job, holder } = candidates[place];
            if helped && rank.0 == Rank::Oldest {
                return false;
            }
            let Some(state) = self.jobs.get(&job).filter(|_| holder != id) else { continue };
            if !self.may_copy(id, state) {
                continue;
            }
            let is_suspect = state.is_suspect();
            if self.workers[&id].holds(&state.kind.needs) {
                candidates.remove(place);
                self.send(id, job, is_suspect, actions);
                return true;
            }
            let needs = state.kind.needs.clone();
            self.load(id, &needs, actions);
        }
        false
    }
}
