//! Waiting jobs go to workers with room.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use kernel::replica::Digest;

use super::job::Kind;
use super::worker::{Held, ReplicaState, Worker};
use super::{Action, JobId, Scheduler, WorkerId};

impl Scheduler {
    /// Gives out all that can be given out.
    pub(super) fn share_out(&mut self, actions: &mut Vec<Action>) {
        self.share_suspects(actions);
        self.share_queue(actions);
        self.share_duplicates(actions);
    }

    /// Gives waiting jobs to workers with room, one at a time to the least loaded one, until no more can be given.
    fn share_queue(&mut self, actions: &mut Vec<Action>) {
        if self.queue.is_empty() {
            return;
        }
        let with_room = self.workers.iter().filter(|(id, worker)| self.may_get_more(**id, worker));
        let mut least_loaded: BinaryHeap<_> =
            with_room.map(|(id, worker)| Reverse(worker.load(*id))).collect();
        while let Some(Reverse(load)) = least_loaded.pop() {
            let id = load.worker;
            if self.give_one(id, actions) && self.workers[&id].has_room() {
                least_loaded.push(Reverse(self.workers[&id].load(id)));
            }
        }
    }

    /// A worker has room for more jobs.
    pub(super) fn may_get_more(&self, id: WorkerId, worker: &Worker) -> bool {
        worker.has_room() && self.reserved != Some(id)
    }

    /// Gives this worker the first waiting job that it can compute now, and has the replicas loaded that jobs before it
    /// need. False where there is no such job.
    fn give_one(&mut self, id: WorkerId, actions: &mut Vec<Action>) -> bool {
        let mut missing = vec![];
        let mut found = None;
        for (_, job, kind) in self.queue.first_of_each_kind() {
            if !self.may_try(id, kind) {
                continue;
            }
            if self.workers[&id].holds(&kind.needs) {
                found = Some(job);
                break;
            }
            missing.extend_from_slice(&kind.needs);
        }
        self.load(id, &missing, actions);
        if let Some(job) = found {
            self.send(id, job, false, actions);
        }
        found.is_some()
    }

    /// A job that failed goes to a worker that has not tried it, while there is one.
    pub(super) fn may_try(&self, worker: WorkerId, kind: &Kind) -> bool {
        !kind.failures.contains(&worker) || self.workers.keys().all(|other| kind.failures.contains(other))
    }

    /// Has replicas loaded that are not there or on their way.
    pub(super) fn load(&mut self, id: WorkerId, digests: &[Digest], actions: &mut Vec<Action>) {
        let Some(worker) = self.workers.get_mut(&id) else { return };
        for &digest in digests {
            worker.replicas.entry(digest).or_insert_with(|| {
                actions.push(Action::LoadReplica { worker: id, digest });
                ReplicaState::Loading
            });
        }
    }

    /// Sends a job that waits, or the second copy of one that does not.
    pub(super) fn send(&mut self, id: WorkerId, job: JobId, alone: bool, actions: &mut Vec<Action>) {
        let Some(state) = self.jobs.get_mut(&job) else { return };
        if let Some(first) = state.holders.first() {
            if let Some(held) = self.workers.get_mut(first).and_then(|first| first.held_mut(job)) {
                held.twice = true;
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
            worker.take(held, self.rounds);
        }
        actions.push(Action::Send { worker: id, job });
    }

    /// Gives each suspect to an empty worker. Where there is none, one worker gets nothing else until it is empty: the others go
    /// on, and suspects take their turns.
    fn share_suspects(&mut self, actions: &mut Vec<Action>) {
        let mut reserved = None;
        for job in self.queue.suspects().collect::<Vec<_>>() {
            let kind = self.jobs[&job].kind.clone();
            let least_loaded = |choice: &dyn Fn(&Worker) -> bool| {
                let able =
                    self.workers.iter().filter(|(id, worker)| self.may_try(**id, &kind) && choice(worker));
                able.map(|(id, worker)| worker.load(*id)).min().map(|load| load.worker)
            };
            let is_able = |worker: &Worker| worker.holds(&kind.needs);
            if let Some(id) = least_loaded(&|worker| worker.under_way.is_empty() && is_able(worker)) {
                self.send(id, job, true, actions);
            } else if let Some(id) = least_loaded(&is_able) {
                // One that was chosen before stays.
                let chosen = self.reserved.filter(|id| self.workers.get(id).is_some_and(is_able));
                reserved = reserved.or(chosen).or(Some(id));
            } else if let Some(id) = least_loaded(&|_| true) {
                self.load(id, &kind.needs, actions);
            }
        }
        self.reserved = reserved;
    }
}
