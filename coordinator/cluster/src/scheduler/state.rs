//! The state of the scheduler, and how events change it.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};

use kernel::replica::Digest;
use kernel::row::JobId;

use super::event::{Abandonment, Action, Event, PassOutcome, Policy, WorkerId};
use super::index::Index;
use super::job::{Job, Kind, Queue};
use super::limits::{MOST_FAILURES, MOST_LOSSES_ALONE, MOST_RELOADS};
use super::spread::Spread;
use super::worker::{ReplicaState, Worker};

/// The state of all jobs and workers.
#[derive(Debug, Default)]
pub struct Scheduler {
    pub(super) policy: Policy,
    pub(super) workers: BTreeMap<WorkerId, Worker>,
    /// The workers and what they hold, in the orders that choices ask for.
    pub(super) index: Index,
    /// All jobs that are not over.
    pub(super) jobs: BTreeMap<JobId, Job>,
    /// Those that no worker holds.
    pub(super) queue: Queue,
    /// Replicas on their way to workers.
    pub(super) spread: Spread,
    /// Replicas that all workers will need.
    pub(super) announced: BTreeSet<Digest>,
    /// Replicas that workers do not take.
    pub(super) refused: BTreeSet<(WorkerId, Digest)>,
    /// Gets no jobs until it is empty and can take a suspect.
    pub(super) reserved: Option<WorkerId>,
    /// Jobs submitted so far.
    pub(super) submitted: u64,
    /// Rounds so far, the scheduler's only clock: in one round each busy thread finishes a job, on average.
    pub(super) rounds: f64,
    pub(super) ignored_answers: u64,
    pub(super) duplicates_sent: u64,
    pub(super) duplicates_dropped: u64,
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

    /// Has workers pass replicas on as soon as this many uploads of the coordinator are under way.
    pub fn upload_at_most(&mut self, uploads: usize) {
        self.spread.upload_at_most(uploads);
    }

    /// Number of replicas that workers passed on to each other.
    #[must_use]
    pub fn passed_replicas(&self) -> u64 {
        self.spread.passed()
    }

    /// Number of threads that their workers hold a job for.
    #[must_use]
    pub fn occupied_threads(&self) -> usize {
        self.index.busy()
    }

    /// Number of threads without a job of workers to which a replica is on its way.
    #[must_use]
    pub fn loading_threads(&self) -> usize {
        self.index.loading()
    }

    /// Whether jobs wait although no worker that is there takes their replicas.
    #[must_use]
    pub fn has_refused_jobs(&self) -> bool {
        !self.refused.is_empty() && !self.workers.is_empty() && self.refused_jobs().next().is_some()
    }

    fn refused_jobs(&self) -> impl Iterator<Item = JobId> + '_ {
        let is_refused = |job: &JobId| {
            let kind = self.jobs.get(job).map(|job| &job.kind);
            kind.is_some_and(|kind| self.workers.keys().all(|worker| !self.takes(*worker, kind)))
        };
        self.queue.first_of_each_kind_and_suspects().filter(is_refused)
    }

    /// Whether a worker takes the replicas of these jobs.
    pub(super) fn takes(&self, worker: WorkerId, kind: &Kind) -> bool {
        self.refused.is_empty() || !kind.needs.iter().any(|digest| self.refused.contains(&(worker, *digest)))
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
                let state = Worker::new(worker, threads);
                self.workers.entry(worker).or_insert(state).place(&mut self.index);
                let announced: Vec<Digest> = self.announced.iter().copied().collect();
                self.load(worker, &announced, actions);
            }
            Event::RoomChanged { worker, jobs } => {
                if let Some(worker) = self.workers.get_mut(&worker) {
                    worker.set_room(jobs);
                    worker.place(&mut self.index);
                }
            }
            Event::WorkerLost { worker, orderly } => self.lose(worker, orderly, actions),
            Event::Submitted { jobs } => {
                for (id, needs) in jobs {
                    if let Entry::Vacant(place) = self.jobs.entry(id) {
                        place.insert(Job::new(self.submitted, needs));
                        self.submitted += 1;
                        self.enqueue(id);
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
                let Some(worker) = self.workers.get_mut(&worker) else { return };
                // It may have been released meanwhile.
                if let Some(replica) = worker.replicas.get_mut(&digest)
                    && *replica == ReplicaState::Loading
                {
                    *replica = ReplicaState::Loaded;
                    worker.place(&mut self.index);
                    self.spread.loaded(worker.id, digest, actions);
                }
            }
            Event::PassesReplicas { worker } => self.spread.join(worker),
            Event::PassEnded { from, worker, digest, outcome } => {
                let mut holds = false;
                if let Some(from) = self.workers.get_mut(&from)
                    && from.replicas.get(&digest) == Some(&ReplicaState::Loaded)
                {
                    holds = outcome != PassOutcome::NotHeld;
                    if !holds {
                        from.replicas.remove(&digest);
                        from.place(&mut self.index);
                    }
                }
                self.spread.pass_ended(([from, worker], holds), digest, outcome, actions);
            }
            Event::ReplicaLate { worker, digest } => self.spread.late(worker, digest, actions),
            Event::ReplicaRefused { worker, digest } => {
                // It may be lost, or the replica released meanwhile.
                let Some(state) = self.workers.get_mut(&worker) else { return };
                if state.replicas.remove(&digest).is_some() {
                    state.place(&mut self.index);
                    self.refused.insert((worker, digest));
                    self.spread.refuse(worker, digest, actions);
                    self.unblock();
                }
            }
            Event::GaveUpOnRefused => {
                while self.has_refused_jobs() {
                    for job in self.refused_jobs().collect::<Vec<_>>() {
                        if let Some(state) = self.jobs.get(&job) {
                            self.queue.remove(job, state);
                        }
                        self.abandon(job, Abandonment::ReplicaRefused, actions);
                    }
                }
            }
            Event::Announced { digest } => {
                self.announced.insert(digest);
                let workers: Vec<WorkerId> = self.workers.keys().copied().collect();
                workers.into_iter().for_each(|worker| self.load(worker, &[digest], actions));
            }
            Event::Released { digest } => {
                self.announced.remove(&digest);
                self.refused.retain(|(_, refused)| *refused != digest);
                let waited = self.spread.release(digest, actions);
                for (&worker, state) in &mut self.workers {
                    if state.replicas.remove(&digest).is_some() {
                        state.place(&mut self.index);
                        if !waited.contains(&worker) {
                            actions.push(Action::ReleaseReplica { worker, digest });
                        }
                    }
                }
                self.unblock();
            }
            Event::Finished { worker, job } => {
                let busy = self.index.busy();
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
        let index = &mut self.index;
        let held = self.workers.get_mut(&worker).and_then(|worker| worker.take_back(job, self.rounds, index));
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
            if let Some(other) = self.workers.get_mut(other) {
                other.change(job, &mut self.index, |held| held.twice = false);
            }
        }
    }

    fn lose(&mut self, worker: WorkerId, orderly: bool, actions: &mut Vec<Action>) {
        let Some(mut lost) = self.workers.remove(&worker) else { return };
        self.spread.lose(worker, actions);
        self.index.remove(&mut lost.standing);
        lost.under_way.iter().for_each(|held| self.index.forget(worker, held));
        // Jobs that only others have failed on may now be tried by them again.
        self.unblock();
        self.reserved = self.reserved.filter(|reserved| *reserved != worker);
        self.refused.retain(|(refusing, _)| *refusing != worker);
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
        let (id, spread) = (worker.id, &mut self.spread);
        worker.replicas.retain(|digest, replica| {
            let stays = *replica == ReplicaState::Loading || !state.kind.needs.contains(digest);
            if !stays {
                spread.forget(id, *digest);
            }
            stays
        });
        worker.place(&mut self.index);
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
        if self.jobs.get(&job).is_some_and(|state| state.holders.is_empty()) {
            self.enqueue(job);
        }
    }

    /// A job waits.
    fn enqueue(&mut self, job: JobId) {
        let Some(state) = self.jobs.get(&job) else { return };
        self.queue.insert(job, state);
        if self.index.may_suit_blocked(&state.kind) {
            self.unblock();
        }
    }

    /// Workers that no waiting job suited are considered again.
    fn unblock(&mut self) {
        for worker in self.index.blocked() {
            if let Some(worker) = self.workers.get_mut(&worker) {
                worker.place(&mut self.index);
            }
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
            let Some(other) = self.workers.get_mut(&worker) else { continue };
            if other.change(job, &mut self.index, |held| (held.wanted, held.withdrawn) = (false, withdrawn)) {
                actions.push(Action::Cancel { worker, job });
            }
        }
    }
}
