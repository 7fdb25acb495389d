//! Whole sequences of events.

use proptest::prelude::*;

use super::*;

const A: WorkerId = WorkerId(1);
const B: WorkerId = WorkerId(2);

fn digest(number: u8) -> Digest {
    Digest([number; 32])
}

/// Jobs that need replica 0.
fn submitted(jobs: impl IntoIterator<Item = u64>) -> Event {
    Event::Submitted { jobs: jobs.into_iter().map(|job| (JobId(job), vec![digest(0)])).collect() }
}

fn load(worker: WorkerId) -> Action {
    Action::LoadReplica { worker, digest: digest(0) }
}

fn loaded(worker: WorkerId) -> Event {
    Event::ReplicaLoaded { worker, digest: digest(0) }
}

fn send(worker: WorkerId, job: u64) -> Action {
    Action::Send { worker, job: JobId(job) }
}

fn finished(worker: WorkerId, job: u64) -> Event {
    Event::Finished { worker, job: JobId(job) }
}

fn failed(worker: WorkerId, job: u64) -> Event {
    Event::Failed { worker, job: JobId(job) }
}

fn deliver(job: u64) -> Action {
    Action::Deliver { job: JobId(job) }
}

/// A scheduler that is checked after each event.
#[derive(Default)]
struct Checked(Scheduler);

impl Checked {
    fn on(&mut self, event: Event) -> Vec<Action> {
        let actions = self.0.handle(event);
        self.0.sanity_check();
        actions
    }

    /// With these workers of one thread, which hold replica 0.
    fn with(workers: &[WorkerId]) -> Self {
        let mut scheduler = Self::default();
        // A first job has the replica loaded.
        for &worker in workers {
            scheduler.on(Event::WorkerConnected { worker, threads: 1 });
        }
        assert_eq!(scheduler.on(submitted([0])), workers.iter().map(|w| load(*w)).collect::<Vec<_>>());
        for &worker in workers {
            scheduler.on(loaded(worker));
        }
        assert_eq!(scheduler.on(finished(workers[0], 0)), [deliver(0)]);
        scheduler
    }
}

#[test]
fn a_finished_job_makes_room_for_the_next() {
    let mut scheduler = Checked::with(&[A]);
    assert_eq!(scheduler.on(submitted(1..=5)), [send(A, 1), send(A, 2), send(A, 3)]);
    assert_eq!(scheduler.on(finished(A, 2)), [deliver(2), send(A, 4)]);
    assert_eq!(scheduler.on(finished(A, 1)), [deliver(1), send(A, 5)]);
    assert_eq!(scheduler.on(finished(A, 5)), [deliver(5)]);
}

#[test]
fn work_is_shared_by_threads() {
    let mut scheduler = Checked::with(&[A]);
    scheduler.on(Event::WorkerConnected { worker: B, threads: 3 });
    assert_eq!(scheduler.on(submitted([1])), [send(A, 1)]);
    assert_eq!(scheduler.on(submitted([2])), [load(B), send(A, 2)]);
    assert_eq!(scheduler.on(loaded(B)), []);
    assert_eq!(
        scheduler.on(submitted(3..=9)),
        [send(B, 3), send(B, 4), send(B, 5), send(B, 6), send(B, 7), send(B, 8), send(A, 9)]
    );
    assert_eq!(scheduler.on(submitted(10..=12)), [send(B, 10)]);
}

#[test]
fn other_jobs_go_on_while_a_replica_is_loaded() {
    let mut scheduler = Checked::with(&[A]);
    let jobs = vec![(JobId(1), vec![digest(0), digest(1)]), (JobId(2), vec![digest(0)])];
    assert_eq!(
        scheduler.on(Event::Submitted { jobs }),
        [Action::LoadReplica { worker: A, digest: digest(1) }, send(A, 2)]
    );
    assert_eq!(scheduler.on(Event::ReplicaLoaded { worker: A, digest: digest(1) }), [send(A, 1)]);
}

#[test]
fn jobs_of_a_lost_worker_come_first() {
    let mut scheduler = Checked::with(&[A, B]);
    assert_eq!(scheduler.on(submitted(1..=8)).len(), 6);
    // A holds 1, 3, 5 and B holds 2, 4, 6.
    assert_eq!(scheduler.on(Event::WorkerLost { worker: A }), []);
    assert_eq!(scheduler.on(finished(B, 2)), [deliver(2), send(B, 1)]);
    assert_eq!(scheduler.on(finished(B, 4)), [deliver(4), send(B, 3)]);
    assert_eq!(scheduler.on(finished(B, 6)), [deliver(6), send(B, 5)]);
    assert_eq!(scheduler.on(finished(B, 1)), [deliver(1), send(B, 7)]);
    assert_eq!(scheduler.on(Event::WorkerLost { worker: B }), [Action::AllWorkersLost]);
}

#[test]
fn late_and_double_answers_are_ignored_and_counted() {
    let mut scheduler = Checked::with(&[A, B]);
    scheduler.on(submitted([1]));
    scheduler.on(Event::WorkerLost { worker: A });
    assert_eq!(scheduler.on(finished(A, 1)), []);
    assert_eq!(scheduler.on(finished(B, 1)), [deliver(1)]);
    assert_eq!(scheduler.on(finished(B, 1)), []);
    assert_eq!(scheduler.on(failed(B, 1)), []);
    assert_eq!(scheduler.0.ignored_answers(), 3);
}

#[test]
fn a_failing_job_is_tried_elsewhere_and_then_given_up() {
    let mut scheduler = Checked::with(&[A, B]);
    assert_eq!(scheduler.on(submitted([1])), [send(A, 1)]);
    assert_eq!(scheduler.on(failed(A, 1)), [send(B, 1)]);
    assert_eq!(scheduler.on(failed(B, 1)), [send(A, 1)]);
    assert_eq!(
        scheduler.on(failed(A, 1)),
        [Action::Abandon { job: JobId(1), why: Abandonment::FailedTooOften }]
    );
    assert_eq!(scheduler.on(submitted([2])), [send(A, 2)]);
    assert_eq!(
        scheduler.on(Event::Refused { worker: A, job: JobId(2) }),
        [Action::Abandon { job: JobId(2), why: Abandonment::Refused }]
    );
}

#[test]
fn a_forgotten_replica_is_loaded_once_more_for_all_its_jobs() {
    let mut scheduler = Checked::with(&[A]);
    scheduler.on(submitted([1, 2]));
    assert_eq!(scheduler.on(Event::ForgotReplica { worker: A, job: JobId(1) }), [load(A)]);
    assert_eq!(scheduler.on(Event::ForgotReplica { worker: A, job: JobId(2) }), []);
    assert_eq!(scheduler.on(loaded(A)), [send(A, 2), send(A, 1)]);
}

#[test]
fn a_replica_that_is_always_forgotten_does_not_go_round_for_ever() {
    let mut scheduler = Checked::with(&[A]);
    scheduler.on(submitted([1]));
    for _ in 1..MOST_RELOADS {
        assert_eq!(scheduler.on(Event::ForgotReplica { worker: A, job: JobId(1) }), [load(A)]);
        assert_eq!(scheduler.on(loaded(A)), [send(A, 1)]);
    }
    assert_eq!(
        scheduler.on(Event::ForgotReplica { worker: A, job: JobId(1) }),
        [Action::Abandon { job: JobId(1), why: Abandonment::ReplicasForgotten }]
    );
}

#[test]
fn a_released_replica_is_forgotten_and_loaded_again_when_needed() {
    let mut scheduler = Checked::with(&[A]);
    let release = Action::ReleaseReplica { worker: A, digest: digest(0) };
    assert_eq!(scheduler.on(Event::Released { digest: digest(0) }), [release]);
    assert_eq!(scheduler.on(loaded(A)), []);
    assert_eq!(scheduler.on(submitted([1])), [load(A)]);
    assert_eq!(scheduler.on(loaded(A)), [send(A, 1)]);
}

/// Workers and network as a dice game: which of the actions under way comes to its end next, and how.
#[derive(Default)]
struct World {
    scheduler: Checked,
    under_way: Vec<Action>,
    ended: BTreeMap<JobId, u32>,
    workers: u32,
    jobs: u64,
}

impl World {
    fn happens(&mut self, event: Event) {
        for action in self.scheduler.on(event) {
            match action {
                Action::Deliver { job } | Action::Abandon { job, .. } => {
                    *self.ended.entry(job).or_default() += 1
                }
                Action::LoadReplica { .. } | Action::Send { .. } => self.under_way.push(action),
                Action::ReleaseReplica { .. } | Action::AllWorkersLost => {}
            }
        }
    }

    fn connect(&mut self, threads: usize) {
        self.workers += 1;
        self.happens(Event::WorkerConnected { worker: WorkerId(self.workers), threads });
    }

    fn step(&mut self, dice: u8, pick: prop::sample::Index) {
        match dice {
            0 => self.connect(pick.index(3) + 1),
            1 if self.workers > 0 => {
                // Its messages that are still under way then come late.
                let worker = WorkerId(pick.index(self.workers as usize) as u32 + 1);
                self.happens(Event::WorkerLost { worker });
            }
            2 => self.happens(Event::Released { digest: digest(pick.index(3) as u8) }),
            3..6 => {
                let first = self.jobs;
                self.jobs += pick.index(8) as u64;
                let needs = |job: u64| vec![digest(job as u8 % 3), digest((job / 2) as u8 % 3)];
                let jobs = (first..self.jobs).map(|job| (JobId(job), needs(job))).collect();
                self.happens(Event::Submitted { jobs });
            }
            _ if self.under_way.is_empty() => {}
            6 => {
                // The same answer twice.
                let action = self.under_way[pick.index(self.under_way.len())].clone();
                self.under_way.push(action);
            }
            _ => {
                let action = self.under_way.swap_remove(pick.index(self.under_way.len()));
                self.happens(match action {
                    Action::LoadReplica { worker, digest } => Event::ReplicaLoaded { worker, digest },
                    Action::Send { worker, job } => match dice {
                        7 => Event::Failed { worker, job },
                        8 => Event::ForgotReplica { worker, job },
                        _ => Event::Finished { worker, job },
                    },
                    _ => unreachable!("nothing else is kept"),
                });
            }
        }
    }
}

proptest! {
    #[test]
    fn every_job_ends_exactly_once_whatever_happens(
        steps in prop::collection::vec((0_u8..14, any::<prop::sample::Index>()), 0..300)) {
        let mut world = World::default();
        for (dice, pick) in steps {
            world.step(dice, pick);
        }
        // As long as one worker lives, and does its work, all ends.
        world.connect(1);
        while let Some(action) = world.under_way.pop() {
            world.happens(match action {
                Action::LoadReplica { worker, digest } => Event::ReplicaLoaded { worker, digest },
                Action::Send { worker, job } => Event::Finished { worker, job },
                _ => unreachable!("nothing else is kept"),
            });
        }
        prop_assert_eq!(world.ended.len() as u64, world.jobs);
        prop_assert!(world.ended.values().all(|times| *times == 1));
    }
}
