//! Assigns jobs to workers. Pure: events in, actions out; no socket, no clock, no thread.
//!
//! | module | contents |
//! |---|---|
//! | `event` | events in, actions out, policies |
//! | `job` | state of a job; the queue |
//! | `worker` | state of a worker |
//! | `choice` | which job goes next, and to which worker |
//! | `turns` | the handle whose job goes next |
//! | `duplicates` | copies of late jobs for idle workers |
//! | `checking` | invariants between any two events |
//!
//! Load sharing: a worker holds a bounded number of jobs and gets the next one when it finishes one, so a fast worker gets more
//! of them. It holds more jobs than it has threads, so that a thread that finishes goes on at once.
//!
//! Replicas are loaded to a worker when it has room for a job that needs them; meanwhile it gets other jobs.

mod checking;
mod choice;
mod duplicates;
mod event;
mod job;
mod turns;
mod worker;

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

pub use event::{Abandonment, Action, Event, Policy, WorkerId};
use job::{Job, Queue};
pub use kernel::row::JobId;
pub use turns::{HandleId, Turns};
use worker::{ReplicaState, Worker};

/// Failed tries after which a job is given up: the fault is the job's.
pub const MOST_FAILURES: usize = 3;

/// Times that workers forget a job's replicas before it is given up: their stores are too small, and each upload would evict what the
/// next job needs.
pub const MOST_RELOADS: usize = 100;

/// Lost workers after which a job that they held is a suspect: it may be what breaks them. From then on it is sent to an empty worker
/// only, and alone, so that no other job shares the blame.
pub const SUSPECT_LOSSES: usize = 2;

/// Workers lost while they computed nothing but a suspect before it is given up.
pub const MOST_LOSSES_ALONE: usize = 3;

/// The state of all jobs and workers.
#[derive(Debug, Default)]
pub struct Scheduler {
    policy: Policy,
    workers: BTreeMap<WorkerId, Worker>,
    /// All jobs that are not over.
    jobs: BTreeMap<JobId, Job>,
    /// Those that no worker holds.
    queue: Queue,
    /// Gets no jobs until it is empty and can take a suspect.
    reserved: Option<WorkerId>,
    /// Jobs submitted so far.
    submitted: u64,
    /// Rounds so far, the scheduler's only clock: in one round each busy thread finishes a job, on average.
    rounds: f64,
    ignored_answers: u64,
    duplicates_sent: u64,
    duplicates_dropped: u64,
}

impl Scheduler {
    /// No workers, no jobs.
    #[must_use]
    pub fn new(policy: Policy) -> Self {
        Self { policy, ..Self::default() }
    }

    /// Number of answers to jobs that the worker did not hold. They do no harm: a job has the same answer everywhere.
    #[must_use]
    pub fn ignored_answers(&self) -> u64 {
        self.ignored_answers
    }

    /// Number of jobs sent to a second worker while a first one held them.
    #[must_use]
    pub fn duplicates_sent(&self) -> u64 {
        self.duplicates_sent
    }

    /// Number of answers dropped because another worker had answered before. Answers to withdrawn jobs do not count.
    #[must_use]
    pub fn duplicates_dropped(&self) -> u64 {
        self.duplicates_dropped
    }

    /// Takes in an event. Returns the actions that follow from it, in their order.
    pub fn handle(&mut self, event: Event) -> Vec<Action> {
        let mut actions = vec![];
        let decides = self.policy.decides_on(&event);
        self.take_in(event, &mut actions);
        if decides {
            self.share_out(&mut actions);
        }
        actions
    }

    fn take_in(&mut self, event: Event, actions: &mut Vec<Action>) {
        match event {
            Event::WorkerConnected { worker, threads } => {
                self.workers.insert(worker, Worker::new(threads));
            }
            Event::WorkerLost { worker, orderly } => self.lose(worker, orderly, actions),
            Event::Submitted { jobs } => {
                for (id, needs) in jobs {
                    if let Entry::Vacant(place) = self.jobs.entry(id) {
                        let job = place.insert(Job::new(self.submitted, needs));
                        self.submitted += 1;
                        self.queue.insert(id, job);
                    }
                }
            }
            Event::Withdrawn { jobs } => {
                for job in jobs {
                    if let Some(state) = self.jobs.get(&job).filter(|state| state.holders.is_empty()) {
                        self.queue.remove(job, state);
                    }
                    self.end(job, true, actions);
                }
            }
            Event::ReplicaLoaded { worker, digest } => {
                let replica =
                    self.workers.get_mut(&worker).and_then(|worker| worker.replicas.get_mut(&digest));
                // It may have been released meanwhile.
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
                let busy: usize = self.workers.values().map(Worker::busy).sum();
                if self.take_back(worker, job) {
                    self.rounds += 1.0 / busy as f64;
                    actions.push(Action::Deliver { job });
                    self.end(job, false, actions);
                }
            }
            Event::ForgotReplica { worker, job } => {
                if self.take_back(worker, job) {
                    self.load_again(worker, job, actions);
                }
            }
            Event::Failed { worker, job } => {
                if self.take_back(worker, job) {
                    self.try_again(worker, job, actions);
                }
            }
            // A worker that does not do a job that is still wanted has failed on it.
            Event::Cancelled { worker, job } => {
                if self.take_back(worker, job) {
                    self.try_again(worker, job, actions);
                }
            }
            Event::Refused { worker, job } => {
                if self.take_back(worker, job) {
                    self.abandon(job, Abandonment::Refused, actions);
                }
            }
            Event::Tick => {}
        }
    }

    /// The worker does not hold the job any more. False where its answer is dropped: it did not hold the job, or the job is over.
    fn take_back(&mut self, worker: WorkerId, job: JobId) -> bool {
        let held = self.workers.get_mut(&worker).and_then(|worker| worker.take_back(job, self.rounds));
        match held {
            None => self.ignored_answers += 1,
            Some(held) if !held.wanted => self.duplicates_dropped += u64::from(!held.withdrawn),
            Some(_) => {
                self.forget_holder(worker, job);
                return true;
            }
        }
        false
    }

    /// The other holder of a job, if any, is now the only one.
    fn forget_holder(&mut self, worker: WorkerId, job: JobId) {
        let Some(state) = self.jobs.get_mut(&job) else { return };
        state.holders.retain(|holder| *holder != worker);
        for other in &state.holders {
            if let Some(held) = self.workers.get_mut(other).and_then(|other| other.held_mut(job)) {
                held.twice = false;
            }
        }
    }

    fn lose(&mut self, worker: WorkerId, orderly: bool, actions: &mut Vec<Action>) {
        let Some(lost) = self.workers.remove(&worker) else { return };
        self.reserved = self.reserved.filter(|reserved| *reserved != worker);
        for held in lost.under_way.into_iter().filter(|held| held.wanted) {
            self.forget_holder(worker, held.job);
            let Some(job) = self.jobs.get_mut(&held.job) else { continue };
            if !orderly {
                job.losses += 1;
                job.losses_alone += usize::from(held.alone);
            }
            if job.losses_alone >= MOST_LOSSES_ALONE {
                self.abandon(held.job, Abandonment::KillsWorkers, actions);
            } else {
                self.put_back(held.job);
            }
        }
    }

    fn load_again(&mut self, worker: WorkerId, job: JobId, actions: &mut Vec<Action>) {
        let (Some(worker), Some(state)) = (self.workers.get_mut(&worker), self.jobs.get_mut(&job)) else {
            return;
        };
        // Those that are being loaded already are left at that: several jobs tell the same news.
        worker.replicas.retain(|digest, replica| {
            *replica == ReplicaState::Loading || !state.kind.needs.contains(digest)
        });
        state.reloads += 1;
        if state.reloads >= MOST_RELOADS && state.holders.is_empty() {
            self.abandon(job, Abandonment::ReplicasForgotten, actions);
        } else {
            self.put_back(job);
        }
    }

    fn try_again(&mut self, worker: WorkerId, job: JobId, actions: &mut Vec<Action>) {
        let Some(state) = self.jobs.get_mut(&job) else { return };
        state.kind.failures.push(worker);
        if state.kind.failures.len() >= MOST_FAILURES && state.holders.is_empty() {
            self.abandon(job, Abandonment::FailedTooOften, actions);
        } else {
            self.put_back(job);
        }
    }

    /// A job waits again, unless another worker holds it.
    fn put_back(&mut self, job: JobId) {
        if let Some(state) = self.jobs.get(&job).filter(|state| state.holders.is_empty()) {
            self.queue.insert(job, state);
        }
    }

    fn abandon(&mut self, job: JobId, why: Abandonment, actions: &mut Vec<Action>) {
        actions.push(Action::Abandon { job, why });
        self.end(job, false, actions);
    }

    /// A job is over; its holders need not begin it.
    fn end(&mut self, job: JobId, withdrawn: bool, actions: &mut Vec<Action>) {
        let Some(state) = self.jobs.remove(&job) else { return };
        for worker in state.holders {
            if let Some(held) = self.workers.get_mut(&worker).and_then(|other| other.held_mut(job)) {
                (held.wanted, held.withdrawn) = (false, withdrawn);
                actions.push(Action::Cancel { worker, job });
            }
        }
    }
}
