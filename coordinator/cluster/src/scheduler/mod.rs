//! Which worker computes which job. Pure: events in, actions out; no socket, no clock, no thread.
//!
//! | module | what lives there |
//! |---|---|
//! | `event` | what the scheduler is told, and what it wants done |
//! | `job` | what it knows of a job; the queue |
//! | `worker` | what it knows of a worker |
//! | `choice` | which job goes next, and to which worker |
//! | `turns` | the handle whose job goes next |
//! | `duplicates` | idle workers take over what others are late with |
//! | `checking` | what must hold between any two events |
//!
//! Load sharing: a worker holds a bounded number of jobs, and gets the next one when it finishes one, so a fast worker
//! gets more of them. It holds more jobs than it has threads, so that a thread that finishes goes on at once, while the
//! news of it travels.
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

/// A job is given up when it failed on so many tries: then the fault is the job's.
pub const MOST_FAILURES: usize = 3;

/// A job is given up when workers forgot its replicas so many times: their stores are too small for it, and each loading
/// would push out what the next job needs.
pub const MOST_RELOADS: usize = 100;

/// A job that was held by so many workers when they were lost is a suspect: it may be what breaks them. From then on it is sent
/// to an empty worker only, and alone, so that no other job shares the blame.
pub const SUSPECT_LOSSES: usize = 2;

/// A suspect is given up when so many workers were lost while they computed nothing else.
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
    /// Rounds so far, all that the scheduler knows of the time: in one round each busy thread finishes a job, on the average.
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

    /// Answers of workers to jobs that they do not hold. They do no harm: the same job has the same answer everywhere.
    #[must_use]
    pub fn ignored_answers(&self) -> u64 {
        self.ignored_answers
    }

    /// Jobs sent to a second worker while a first one held them.
    #[must_use]
    pub fn duplicates_sent(&self) -> u64 {
        self.duplicates_sent
    }

    /// Answers dropped, whatever they said, because another worker had answered before. Answers to withdrawn jobs do not count.
    #[must_use]
    pub fn duplicates_dropped(&self) -> u64 {
        self.duplicates_dropped
    }

    /// Takes in what happened; returns what is to be done about it, in this order.
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

    /// The worker does not hold the job any more. False where its answer is of no use: it did not hold it, or another worker
    /// answered before.
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

    /// Of two holders of a job, the other one is now the only one.
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

    /// A job that nobody waits for is over; whoever holds it need not begin it.
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
