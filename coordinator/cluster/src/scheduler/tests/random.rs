//! Workers and network as a dice game: which of the things under way comes to its end next, and how.

use std::collections::BTreeSet;

use proptest::prelude::*;
use proptest::sample::Index;

use super::*;

/// Every so manieth job breaks each worker that computes it.
const JOBS_PER_KILLER: u64 = 19;

fn kills(job: JobId) -> bool {
    job.0 % JOBS_PER_KILLER == JOBS_PER_KILLER - 1
}

/// What the world knows, counted without a look into the scheduler.
#[derive(Default)]
struct World {
    scheduler: Checked,
    /// Jobs sent and replicas being loaded; those of lost workers stay, and come late.
    under_way: Vec<Action>,
    /// Jobs that were cancelled and not answered since.
    cancelled: BTreeSet<(WorkerId, JobId)>,
    /// Suspects where they were sent.
    alone: BTreeSet<(WorkerId, JobId)>,
    alive: BTreeSet<WorkerId>,
    ended: BTreeMap<JobId, u32>,
    /// Unorderly losses that a job was under way in, and those in which it was all that was.
    losses: BTreeMap<JobId, [usize; 2]>,
    workers: u32,
    jobs: u64,
    answers_dropped: u64,
}

impl World {
    fn new(policy: Policy) -> Self {
        let mut scheduler = Scheduler::new(policy);
        // Of few workers, too, some are to get what they need from others.
        scheduler.upload_at_most(1);
        Self { scheduler: Checked(scheduler), ..Self::default() }
    }

    fn happens(&mut self, event: Event) {
        for action in self.scheduler.on(event) {
            match action {
                Action::Deliver { job } => *self.ended.entry(job).or_default() += 1,
                Action::Abandon { job, why } => {
                    *self.ended.entry(job).or_default() += 1;
                    let [_, alone] = self.losses.get(&job).copied().unwrap_or_default();
                    assert!(
                        (why == Abandonment::KillsWorkers) == (alone == MOST_LOSSES_ALONE),
                        "{job:?} after {alone} losses"
                    );
                }
                Action::Send { worker, job } => {
                    assert!(self.alive.contains(&worker), "sent to one that is lost");
                    assert!(!self.ended.contains_key(&job), "{job:?} is over");
                    if self.losses.get(&job).is_some_and(|losses| losses[0] >= SUSPECT_LOSSES) {
                        self.alone.insert((worker, job));
                        assert_eq!(
                            self.held(worker).count(),
                            0,
                            "the suspect {job:?} is not alone on {worker:?}"
                        );
                    }
                    self.under_way.push(action);
                    let copies = self.copies(job);
                    assert!(copies <= 2, "{copies} copies of {job:?}");
                }
                Action::Cancel { worker, job } => {
                    assert!(self.held(worker).any(|held| held == job), "cancels what is not there");
                    assert!(self.cancelled.insert((worker, job)), "cancelled twice");
                }
                Action::LoadReplica { .. } => self.under_way.push(action),
                Action::PassReplica { from, worker, .. } => {
                    assert!(self.alive.contains(&from) && self.alive.contains(&worker), "both are there");
                    self.under_way.push(action);
                }
                Action::ReleaseReplica { .. } => {}
            }
        }
    }

    /// Jobs that a worker has not answered.
    fn held(&self, of: WorkerId) -> impl Iterator<Item = JobId> + '_ {
        self.under_way.iter().filter_map(move |action| match action {
            Action::Send { worker, job } if *worker == of => Some(*job),
            _ => None,
        })
    }

    fn copies(&self, job: JobId) -> usize {
        self.alive.iter().filter(|worker| self.held(**worker).any(|held| held == job)).count()
    }

    fn connect(&mut self, threads: usize) {
        self.workers += 1;
        let worker = WorkerId(self.workers);
        self.alive.insert(worker);
        if !self.workers.is_multiple_of(4) {
            self.happens(Event::PassesReplicas { worker });
        }
        self.happens(Event::WorkerConnected { worker, threads });
    }

    fn lose(&mut self, worker: WorkerId, orderly: bool) {
        if !self.alive.remove(&worker) {
            return;
        }
        let held: Vec<JobId> = self.held(worker).collect();
        for job in &held {
            if !orderly && !self.cancelled.contains(&(worker, *job)) {
                let losses = self.losses.entry(*job).or_default();
                losses[1] += usize::from(self.alone.contains(&(worker, *job)));
                losses[0] += 1;
            }
        }
        self.happens(Event::WorkerLost { worker, orderly });
    }

    /// A job or a replica comes to its end.
    fn ends(&mut self, action: Action, dice: u8) {
        match action {
            Action::LoadReplica { worker, digest } if dice == 10 => {
                self.happens(Event::ReplicaRefused { worker, digest });
            }
            Action::LoadReplica { worker, digest } | Action::PassReplica { worker, digest, .. }
                if dice == 9 =>
            {
                self.happens(Event::ReplicaLate { worker, digest });
                self.under_way.push(action);
            }
            Action::LoadReplica { worker, digest } => self.happens(Event::ReplicaLoaded { worker, digest }),
            Action::PassReplica { from, worker, digest } => {
                let outcome = match dice {
                    7 => PassOutcome::NotHeld,
                    8 | 10 => PassOutcome::Failed,
                    _ => PassOutcome::Done,
                };
                if outcome == PassOutcome::Done {
                    self.happens(Event::ReplicaLoaded { worker, digest });
                }
                if self.alive.contains(&from) {
                    self.happens(Event::PassEnded { from, worker, digest, outcome });
                }
            }
            Action::Send { worker, job } => {
                let is_first = self.alive.contains(&worker);
                let was_cancelled = self.cancelled.remove(&(worker, job));
                self.answers_dropped += u64::from(was_cancelled && is_first);
                self.happens(match dice {
                    7 => Event::Failed { worker, job },
                    8 => Event::ForgotReplica { worker, job },
                    9..12 if was_cancelled => Event::Cancelled { worker, job },
                    _ => Event::Finished { worker, job },
                });
            }
            _ => unreachable!("nothing else is kept"),
        }
    }

    fn step(&mut self, dice: u8, pick: Index) {
        match dice {
            0 => self.connect(pick.index(3) + 1),
            1 | 2 if self.workers > 0 => {
                // Its messages that are still under way then come late.
                self.lose(WorkerId(pick.index(self.workers as usize) as u32 + 1), dice == 1);
            }
            3 if pick.index(4) == 3 => self.happens(Event::GaveUpOnRefused),
            3 if pick.index(3) == 2 => self.happens(Event::Announced { digest: digest(pick.index(4) as u8) }),
            3 => self.happens(Event::Released { digest: digest(pick.index(4) as u8) }),
            4..6 => {
                let first = self.jobs;
                self.jobs += pick.index(8) as u64;
                let needs = |job: u64| vec![digest(job as u8 % 3), digest((job / 2) as u8 % 3)];
                let jobs = (first..self.jobs).map(|job| (JobId(job), needs(job))).collect();
                self.happens(Event::Submitted { jobs });
            }
            14.. => self.happens(Event::Tick),
            _ if self.under_way.is_empty() => {}
            6 => {
                // An answer that nobody asked for.
                let late = self.under_way[pick.index(self.under_way.len())].clone();
                if let Action::Send { worker, job } = late
                    && !self.alive.contains(&worker)
                {
                    self.happens(Event::Finished { worker, job });
                }
            }
            _ => self.goes_on(pick.index(self.under_way.len()), dice),
        }
    }

    /// What is in this place of those under way comes to its end.
    fn goes_on(&mut self, place: usize, dice: u8) {
        match self.under_way[place] {
            // It stays with the worker, and its answer never comes.
            Action::Send { worker, job } if kills(job) && self.alive.contains(&worker) => {
                self.lose(worker, false)
            }
            _ => {
                let action = self.under_way.swap_remove(place);
                self.ends(action, dice);
            }
        }
    }

    /// As long as workers come, and do their work, all ends.
    fn finish(&mut self) {
        for _ in 0..10_000 {
            if self.ended.len() as u64 == self.jobs {
                return;
            }
            if self.alive.is_empty() {
                self.connect(2);
            }
            self.happens(Event::Tick);
            self.happens(Event::GaveUpOnRefused);
            // Late news has had its time.
            let alive = &self.alive;
            self.under_way.retain(|action| match action {
                Action::Send { worker, .. }
                | Action::LoadReplica { worker, .. }
                | Action::PassReplica { worker, .. } => alive.contains(worker),
                _ => false,
            });
            if let Some(last) = self.under_way.len().checked_sub(1) {
                self.goes_on(last, 13);
            }
        }
    }
}

proptest! {
    #[test]
    fn every_job_ends_exactly_once_whatever_happens(
        periodic in any::<bool>(),
        steps in prop::collection::vec((0_u8..16, any::<Index>()), 0..300)) {
        let mut world = World::new(if periodic { Policy::Periodic } else { Policy::Finished });
        for (dice, pick) in steps {
            world.step(dice, pick);
        }
        world.finish();
        prop_assert_eq!(world.ended.len() as u64, world.jobs);
        prop_assert!(world.ended.values().all(|times| *times == 1));
        prop_assert_eq!(world.scheduler.0.duplicates_dropped(), world.answers_dropped);
    }
}
