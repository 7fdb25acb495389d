//! Which job goes next, and to which worker. With [`turns`](super::turns), which picks the handle whose job enters the queue, all
//! of it is decided here, in this order:
//!
//! 1. *Suspects*, the oldest first: each goes to an empty worker, and alone.
//! 2. *Waiting* jobs: the worker with the fewest jobs per thread gets the first one that it can compute now, and the replicas loaded
//!    that jobs before it need.
//! 3. *Copies* of jobs that others are late with, for idle workers: see [`duplicates`](super::duplicates).
//!
//! [`checking`](super::checking) asks the same questions, and finds that nothing is left to be sent.

use kernel::replica::Digest;
use kernel::row::JobId;

use super::event::{Action, WorkerId};
use super::held::Held;
use super::job::Kind;
use super::state::Scheduler;
use super::worker::{ReplicaState, Worker};

/// Where a suspect goes.
pub(super) enum Place {
    /// To this worker, now.
    Empty(WorkerId),
    /// To this worker, which gets no other job until it is empty.
    Reserved(WorkerId),
    /// To this worker, once it holds the replicas.
    WithoutReplicas(WorkerId),
}

impl Scheduler {
    /// Gives out all that can be given out.
    pub(super) fn share_out(&mut self, actions: &mut Vec<Action>) {
        self.share_suspects(actions);
        self.share_queue(actions);
        self.share_duplicates(actions);
    }

    /// Gives waiting jobs to workers with room, one at a time to the least loaded one, until no more can be given.
    fn share_queue(&mut self, actions: &mut Vec<Action>) {
        let mut last = None;
        while !self.queue.is_empty()
            && let Some(load) = self.index.open_after(last)
        {
            let id = load.worker;
            if self.reserved == Some(id) {
                last = Some(load);
            } else if !self.give_one(id, actions) {
                self.index.block(self.workers[&id].load(), &self.queue);
            }
        }
    }

    /// Gives this worker its next job, and the replicas that jobs before it need. False where there is no such job.
    fn give_one(&mut self, id: WorkerId, actions: &mut Vec<Action>) -> bool {
        let (job, missing) = self.next_for(id);
        self.load(id, &missing, actions);
        if let Some(job) = job {
            self.send(id, job, false, actions);
        }
        job.is_some()
    }

    /// The first waiting job that a worker can compute now, and the replicas that jobs before it need.
    pub(super) fn next_for(&self, id: WorkerId) -> (Option<JobId>, Vec<Digest>) {
        let mut missing = vec![];
        for (_, job, kind) in self.queue.first_of_each_kind() {
            if !self.may_try(id, kind) {
                continue;
            }
            if self.workers[&id].holds(&kind.needs) {
                return (Some(job), missing);
            }
            missing.extend_from_slice(&kind.needs);
        }
        (None, missing)
    }

    /// A job goes to a worker that takes its replicas; one that failed to a worker that has not tried it, while there is one.
    pub(super) fn may_try(&self, worker: WorkerId, kind: &Kind) -> bool {
        let has_failed = |worker: &WorkerId| kind.failures.contains(worker);
        let mut others = self.workers.keys().filter(|other| self.takes(**other, kind));
        self.takes(worker, kind) && (!has_failed(&worker) || others.all(has_failed))
    }

    /// Has replicas loaded that are not there or on their way.
    pub(super) fn load(&mut self, id: WorkerId, digests: &[Digest], actions: &mut Vec<Action>) {
        let Some(worker) = self.workers.get_mut(&id) else { return };
        for &digest in digests {
            worker.replicas.entry(digest).or_insert_with(|| {
                self.spread.ask(id, digest, actions);
                ReplicaState::Loading
            });
        }
        worker.place(&mut self.index);
    }

    /// Sends a job that waits, or the second copy of one that does not.
    pub(super) fn send(&mut self, id: WorkerId, job: JobId, alone: bool, actions: &mut Vec<Action>) {
        let Some(state) = self.jobs.get_mut(&job) else { return };
        if let Some(first) = state.holders.first() {
            if let Some(first) = self.workers.get_mut(first) {
                first.change(job, &mut self.index, |held| held.twice = true);
            }
            self.duplicates_sent += 1;
        } else {
            self.queue.remove(job, state);
        }
        let twice = !state.holders.is_empty();
        state.holders.push(id);
        if let Some(worker) = self.workers.get_mut(&id) {
            let (order, copy, begun) = (state.order, twice, None);
            let held = Held { job, order, alone, copy, twice, wanted: true, withdrawn: false, begun };
            worker.take(held, self.rounds, &mut self.index);
        }
        actions.push(Action::Send { worker: id, job });
    }

    /// Gives each suspect to an empty worker. Where there is none, one worker gets nothing else until it is empty: the others go
    /// on, and suspects take their turns.
    fn share_suspects(&mut self, actions: &mut Vec<Action>) {
        let mut reserved = None;
        for job in self.queue.suspects().collect::<Vec<_>>() {
            match self.place_of(job) {
                Some(Place::Empty(id)) => self.send(id, job, true, actions),
                Some(Place::Reserved(id)) => reserved = reserved.or(Some(id)),
                Some(Place::WithoutReplicas(id)) => {
                    let needs = self.jobs[&job].kind.needs.clone();
                    self.load(id, &needs, actions);
                }
                None => {}
            }
        }
        self.reserved = reserved;
    }

    /// The worker that a suspect goes to; none without any that may try it.
    pub(super) fn place_of(&self, suspect: JobId) -> Option<Place> {
        let kind = &self.jobs[&suspect].kind;
        let least_loaded = |choice: &dyn Fn(&Worker) -> bool| {
            let able = self.workers.iter().filter(|(id, worker)| self.may_try(**id, kind) && choice(worker));
            able.map(|(_, worker)| worker.load()).min().map(|load| load.worker)
        };
        let is_able = |worker: &Worker| worker.holds(&kind.needs);
        let empty = least_loaded(&|worker| worker.under_way.is_empty() && is_able(worker));
        // One that was reserved before stays.
        let chosen = || self.reserved.filter(|id| self.workers.get(id).is_some_and(is_able));
        let reserved = || least_loaded(&is_able).map(|id| chosen().unwrap_or(id));
        let without = || least_loaded(&|_| true).map(Place::WithoutReplicas);
        empty.map(Place::Empty).or_else(|| reserved().map(Place::Reserved)).or_else(without)
    }
}
