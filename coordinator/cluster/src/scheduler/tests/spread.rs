//! Replicas from the coordinator and from workers.

use std::collections::VecDeque;

use super::*;

/// Workers, of one thread each, that pass replicas on; the coordinator sends one at a time.
fn peers(workers: &[WorkerId]) -> Checked {
    let mut scheduler = Checked::default();
    scheduler.0.upload_at_most(1);
    for &worker in workers {
        scheduler.on(Event::PassesReplicas { worker });
        scheduler.on(Event::WorkerConnected { worker, threads: 1 });
    }
    scheduler
}

fn pass(from: WorkerId, worker: WorkerId) -> Action {
    Action::PassReplica { from, worker, digest: digest(0) }
}

fn ended(from: WorkerId, worker: WorkerId, outcome: PassOutcome) -> Event {
    Event::PassEnded { from, worker, digest: digest(0), outcome }
}

fn late(worker: WorkerId) -> Event {
    Event::ReplicaLate { worker, digest: digest(0) }
}

/// Without the jobs that go with them.
fn uploads(actions: Vec<Action>) -> Vec<Action> {
    let is_upload =
        |action: &Action| matches!(action, Action::LoadReplica { .. } | Action::PassReplica { .. });
    actions.into_iter().filter(is_upload).collect()
}

#[test]
fn those_that_hold_a_replica_pass_it_on() {
    let mut scheduler = peers(&[A, B, C, WorkerId(4)]);
    assert_eq!(uploads(scheduler.on(submitted(0..8))), [load(A)], "one at a time");
    assert_eq!(uploads(scheduler.on(loaded(A))), [pass(A, B), pass(A, C), load(WorkerId(4))]);
    scheduler.on(loaded(B));
    assert_eq!(scheduler.0.passed_replicas(), 1);
}

#[test]
fn a_source_that_is_free_again_serves_the_next() {
    let mut scheduler = peers(&[A, B, C, WorkerId(4), WorkerId(5), WorkerId(6)]);
    scheduler.on(submitted(0..8));
    assert_eq!(uploads(scheduler.on(loaded(A))), [pass(A, B), pass(A, C), load(WorkerId(4))]);
    assert_eq!(uploads(scheduler.on(ended(A, B, PassOutcome::Done))), [pass(A, WorkerId(5))]);
    assert_eq!(uploads(scheduler.on(loaded(B))), [pass(B, WorkerId(6))]);
}

#[test]
fn the_coordinator_steps_in_where_a_pass_fails_or_is_late() {
    let mut scheduler = peers(&[A, B, C]);
    scheduler.on(submitted(0..4));
    assert_eq!(uploads(scheduler.on(loaded(A))), [pass(A, B), pass(A, C)]);
    assert_eq!(uploads(scheduler.on(late(B))), [load(B)]);
    assert_eq!(uploads(scheduler.on(ended(A, B, PassOutcome::Failed))), [], "it was given up before");
    assert_eq!(uploads(scheduler.on(ended(A, C, PassOutcome::Failed))), [load(C)]);
    // They get the next one from the coordinator at once.
    scheduler.on(loaded(B));
    scheduler.on(loaded(C));
    let needs = vec![digest(7)];
    let actions = scheduler.on(Event::Submitted { jobs: vec![(JobId(100), needs)] });
    let load = |worker| Action::LoadReplica { worker, digest: digest(7) };
    assert!([B, C].iter().all(|worker| actions.contains(&load(*worker))), "{actions:?}");
}

#[test]
fn the_tree_heals_when_a_source_is_lost() {
    let mut scheduler = peers(&[A, B, C]);
    scheduler.on(submitted(0..8));
    scheduler.on(loaded(A));
    assert_eq!(uploads(scheduler.on(broken(A))), [load(B), load(C)]);
    // Late news of one that is lost changes nothing.
    assert_eq!(uploads(scheduler.on(ended(A, B, PassOutcome::Failed))), []);
}

#[test]
fn a_source_that_has_forgotten_is_not_to_blame_and_gets_it_again() {
    let mut scheduler = peers(&[A, B, C]);
    scheduler.on(submitted(0..8));
    scheduler.on(loaded(A));
    let actions = uploads(scheduler.on(ended(A, B, PassOutcome::NotHeld)));
    assert!(actions.contains(&load(B)), "{actions:?}");
    scheduler.on(loaded(B));
    assert_eq!(uploads(scheduler.on(ended(A, C, PassOutcome::NotHeld))), [load(C)]);
}

#[test]
fn a_slow_upload_of_the_coordinator_holds_nobody_up() {
    let mut scheduler = peers(&[A, B]);
    assert_eq!(uploads(scheduler.on(submitted(0..8))), [load(A)]);
    assert_eq!(uploads(scheduler.on(late(A))), [load(B)]);
}

#[test]
fn workers_that_never_reach_each_other_are_not_asked_for_long() {
    let workers: Vec<WorkerId> = (1..=20).map(WorkerId).collect();
    let mut scheduler = peers(&workers);
    let mut under_way = VecDeque::from(uploads(scheduler.on(submitted(0..100))));
    let mut failed = 0;
    while let Some(action) = under_way.pop_front() {
        let next = match action {
            Action::PassReplica { from, worker, .. } => {
                failed += 1;
                scheduler.on(ended(from, worker, PassOutcome::Failed))
            }
            Action::LoadReplica { worker, .. } => scheduler.on(loaded(worker)),
            _ => vec![],
        };
        under_way.extend(uploads(next));
    }
    assert!((4..=8).contains(&failed), "{failed}");
    assert!(workers.iter().all(|worker| scheduler.0.workers[worker].holds(&[digest(0)])));
}

#[test]
fn workers_that_do_not_pass_replicas_on_wait_for_nobody() {
    let mut scheduler = Checked::default();
    scheduler.0.upload_at_most(1);
    for worker in [A, B, C] {
        scheduler.on(Event::WorkerConnected { worker, threads: 1 });
    }
    assert_eq!(uploads(scheduler.on(submitted(0..8))), [load(A), load(B), load(C)]);
}

#[test]
fn announced_replicas_are_loaded_before_jobs_need_them() {
    let mut scheduler = Checked::default();
    scheduler.on(Event::WorkerConnected { worker: A, threads: 1 });
    assert_eq!(scheduler.on(Event::Announced { digest: digest(0) }), [load(A)]);
    assert_eq!(scheduler.on(Event::WorkerConnected { worker: B, threads: 1 }), [load(B)]);
    assert_eq!(scheduler.on(loaded(A)), []);
    assert_eq!(scheduler.on(submitted([0, 1])), [send(A, 0), send(A, 1)]);
    let release = |worker| Action::ReleaseReplica { worker, digest: digest(0) };
    scheduler.on(Event::Withdrawn { jobs: vec![JobId(0), JobId(1)] });
    assert_eq!(scheduler.on(Event::Released { digest: digest(0) }), [release(A), release(B)]);
    assert_eq!(scheduler.on(Event::WorkerConnected { worker: C, threads: 1 }), []);
}

#[test]
fn a_replica_that_was_never_sent_is_not_released() {
    let mut scheduler = peers(&[A, B]);
    assert_eq!(uploads(scheduler.on(submitted([0]))), [load(A)]);
    scheduler.on(Event::Withdrawn { jobs: vec![JobId(0)] });
    let released = scheduler.on(Event::Released { digest: digest(0) });
    assert_eq!(released, [Action::ReleaseReplica { worker: A, digest: digest(0) }]);
}
