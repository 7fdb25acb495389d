//! Which worker computes which job. Pure: events in, actions out; no socket, no clock, no thread.
//!
//! Load sharing: a worker holds a bounded number of jobs, and gets the next one when it finishes one, so a fast worker
//! gets more of them. It holds more jobs than it has threads, so that a thread that finishes goes on at once, while the
//! news of it travels.
//!
//! Replicas are loaded to a worker when it has room for a job that needs them; meanwhile it gets other jobs.

mod event;
mod worker;

#[cfg(test)]
mod tests;

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, VecDeque};

use shared::replica::Digest;

pub use event::{Abandonment, Action, Event, JobId, WorkerId};
use worker::{ReplicaState, Worker};

/// A job is given up when it failed on so many tries: then the fault is the job's.
pub const MOST_FAILURES: usize = 3;

/// A job is given up when workers forgot its replicas so many times: their stores are too small for it, and each loading
/// would push out what the next job needs.
pub const MOST_RELOADS: usize = 100;

/// How many waiting jobs are looked at in search of one whose replicas a worker holds.
const LOOK_AHEAD: usize = 256;

/// The state of all jobs and workers.
#[derive(Debug, Default)]
pub struct Scheduler {
    workers: BTreeMap<WorkerId, Worker>,
    /// All jobs that are not finished.
    jobs: BTreeMap<JobId, Job>,
    /// Those that no worker holds, the most urgent one first.
    queue: VecDeque<JobId>,
    ignored_answers: u64,
}

#[derive(Debug)]
struct Job {
    needs: Vec<Digest>,
    /// Which worker failed on it, each time.
    failures: Vec<WorkerId>,
    reloads: usize,
}

impl Scheduler {
    /// No workers, no jobs.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Answers that came late or twice. They do no harm: the same job has the same answer everywhere.
    #[must_use]
    pub fn ignored_answers(&self) -> u64 {
        self.ignored_answers
    }

    /// Takes in what happened; returns what is to be done about it, in this order.
    pub fn handle(&mut self, event: Event) -> Vec<Action> {
        let mut actions = vec![];
        match event {
            Event::WorkerConnected { worker, threads } => {
                self.workers.insert(worker, Worker::new(threads));
            }
            Event::WorkerLost { worker } => {
                if let Some(lost) = self.workers.remove(&worker) {
                    // Backwards, so that the order in which they were sent stays.
                    lost.under_way.into_iter().rev().for_each(|job| self.queue.push_front(job));
                    if self.workers.is_empty() {
                        actions.push(Action::AllWorkersLost);
                    }
                }
            }
            Event::Submitted { jobs } => {
                for (job, needs) in jobs {
                    if let Entry::Vacant(place) = self.jobs.entry(job) {
                        place.insert(Job { needs, failures: vec![], reloads: 0 });
                        self.queue.push_back(job);
                    }
                }
            }
            Event::ReplicaLoaded { worker, digest } => {
                let replica =
                    self.workers.get_mut(&worker).and_then(|worker| worker.replicas.get_mut(&digest));
                // Released meanwhile otherwise.
                if let Some(replica) = replica {
                    *replica = ReplicaState::Loaded;
                }
            }
            Event::Released { digest } => {
                for (&worker, state) in &mut self.workers {
                    if state.replicas.remove(&digest).is_some() {
                        actions.push(Action::ReleaseReplica { worker, digest });
                    }
                }
            }
            Event::Finished { worker, job } => {
                if self.take_back(worker, job) {
                    self.jobs.remove(&job);
                    actions.push(Action::Deliver { job });
                }
            }
            Event::ForgotReplica { worker, job } => {
                if self.take_back(worker, job) {
                    self.load_again(worker, job, &mut actions);
                }
            }
            Event::Failed { worker, job } => {
                if self.take_back(worker, job) {
                    self.try_again(worker, job, &mut actions);
                }
            }
            Event::Refused { worker, job } => {
                if self.take_back(worker, job) {
                    self.abandon(job, Abandonment::Refused, &mut actions);
                }
            }
        }
        self.share_out(&mut actions);
        actions
    }

    /// The worker does not hold the job any more. False where it did not hold it: the answer is late or a duplicate.
    fn take_back(&mut self, worker: WorkerId, job: JobId) -> bool {
        let held = self.workers.get_mut(&worker).is_some_and(|worker| worker.take_back(job));
        if !held {
            self.ignored_answers += 1;
        }
        held
    }

    fn load_again(&mut self, worker: WorkerId, job: JobId, actions: &mut Vec<Action>) {
        let (Some(worker), Some(state)) = (self.workers.get_mut(&worker), self.jobs.get_mut(&job)) else {
            return;
        };
        // Those that are being loaded already are left at that: several jobs tell the same news.
        worker
            .replicas
            .retain(|digest, replica| *replica == ReplicaState::Loading || !state.needs.contains(digest));
        state.reloads += 1;
        if state.reloads >= MOST_RELOADS {
            self.abandon(job, Abandonment::ReplicasForgotten, actions);
        } else {
            self.queue.push_front(job);
        }
    }

    fn try_again(&mut self, worker: WorkerId, job: JobId, actions: &mut Vec<Action>) {
        let Some(state) = self.jobs.get_mut(&job) else { return };
        state.failures.push(worker);
        if state.failures.len() >= MOST_FAILURES {
            self.abandon(job, Abandonment::FailedTooOften, actions);
        } else {
            self.queue.push_front(job);
        }
    }

    fn abandon(&mut self, job: JobId, why: Abandonment, actions: &mut Vec<Action>) {
        self.jobs.remove(&job);
        actions.push(Action::Abandon { job, why });
    }

    /// Gives waiting jobs to workers with room, one at a time to the least loaded one, until no more can be given.
    fn share_out(&mut self, actions: &mut Vec<Action>) {
        let mut candidates: Vec<WorkerId> = self.workers.keys().copied().collect();
        loop {
            candidates.retain(|id| self.workers[id].has_room());
            let least_loaded =
                candidates.iter().copied().min_by(|a, b| self.workers[a].compare_load(&self.workers[b]));
            let Some(worker) = least_loaded else { break };
            if !self.give_one(worker, actions) {
                candidates.retain(|candidate| *candidate != worker);
            }
        }
    }

    /// Gives this worker the first waiting job that it can compute now, and has the replicas loaded that jobs before it
    /// need. False where there is no such job.
    fn give_one(&mut self, id: WorkerId, actions: &mut Vec<Action>) -> bool {
        for place in 0..self.queue.len().min(LOOK_AHEAD) {
            let job = self.queue[place];
            if !self.may_try(id, job) {
                continue;
            }
            let (Some(worker), Some(state)) = (self.workers.get_mut(&id), self.jobs.get(&job)) else {
                continue;
            };
            for &digest in &state.needs {
                worker.replicas.entry(digest).or_insert_with(|| {
                    actions.push(Action::LoadReplica { worker: id, digest });
                    ReplicaState::Loading
                });
            }
            if worker.holds(&state.needs) {
                self.queue.remove(place);
                worker.under_way.push(job);
                actions.push(Action::Send { worker: id, job });
                return true;
            }
        }
        false
    }

    /// A job that failed goes to a worker that has not tried it, while there is one.
    fn may_try(&self, worker: WorkerId, job: JobId) -> bool {
        let failures = &self.jobs[&job].failures;
        !failures.contains(&worker) || self.workers.keys().all(|other| failures.contains(other))
    }

    /// Checks what must hold between any two events: no job is lost or held twice, and nobody idles who could work.
    ///
    /// # Panics
    /// When it does not: the scheduler has a bug.
    pub fn sanity_check(&self) {
        let under_way = self.workers.values().flat_map(|worker| &worker.under_way);
        let mut held: Vec<JobId> = under_way.chain(&self.queue).copied().collect();
        held.sort_unstable();
        assert!(held.iter().eq(self.jobs.keys()), "each job either waits or is under way, once");
        for (&id, worker) in &self.workers {
            worker.sanity_check();
            if worker.has_room() {
                for job in self.queue.iter().take(LOOK_AHEAD).filter(|job| self.may_try(id, **job)) {
                    let needs = &self.jobs[job].needs;
                    assert!(!worker.holds(needs), "{id:?} has room for {job:?}, which waits");
                    assert!(
                        needs.iter().all(|digest| worker.replicas.contains_key(digest)),
                        "{id:?} could compute {job:?}, but nobody loads its replicas"
                    );
                }
            }
        }
    }
}
