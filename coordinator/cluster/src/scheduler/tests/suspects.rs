//! Jobs that break workers are found, and those that were only near are not blamed.

use super::*;

/// Two unorderly losses make suspects of all that is under way.
fn with_suspects(jobs: impl IntoIterator<Item = u64>) -> Checked {
    let mut scheduler = Checked::with(&[A]);
    scheduler.on(submitted(jobs));
    scheduler.on(broken(A));
    scheduler.on(Event::WorkerConnected { worker: B, threads: 1 });
    scheduler.on(loaded(B));
    scheduler.on(broken(B));
    scheduler
}

#[test]
fn a_job_that_breaks_every_worker_is_given_up() {
    let mut scheduler = with_suspects([1, 2]);
    for worker in [3, 4, 5].map(WorkerId) {
        assert_eq!(scheduler.on(Event::WorkerConnected { worker, threads: 4 }), [load(worker)]);
        assert_eq!(scheduler.on(loaded(worker)), [send(worker, 1)], "alone");
        assert_eq!(scheduler.on(broken(worker)), []);
    }
    let worker = WorkerId(6);
    scheduler.on(Event::WorkerConnected { worker, threads: 4 });
    scheduler.on(loaded(worker));
    assert_eq!(scheduler.on(broken(worker)), [abandon(1, Abandonment::KillsWorkers)]);
    // The other one was only near.
    let worker = WorkerId(7);
    scheduler.on(Event::WorkerConnected { worker, threads: 4 });
    assert_eq!(scheduler.on(loaded(worker)), [send(worker, 2)]);
    assert_eq!(scheduler.on(finished(worker, 2)), [deliver(2)]);
}

#[test]
fn machines_that_are_switched_off_are_no_fault_of_their_jobs() {
    let mut scheduler = Checked::default();
    scheduler.on(submitted(1..=3));
    for worker in (1..=100).map(WorkerId) {
        scheduler.on(Event::WorkerConnected { worker, threads: 1 });
        assert_eq!(scheduler.on(loaded(worker)), [send(worker, 1), send(worker, 2), send(worker, 3)]);
        assert_eq!(scheduler.on(left(worker)), []);
    }
}

#[test]
fn jobs_that_share_their_worker_are_never_given_up() {
    // However many workers break: while other jobs are beside it no job is at fault.
    let mut scheduler = with_suspects(1..=3);
    for worker in (3..=100).map(WorkerId) {
        scheduler.on(Event::WorkerConnected { worker, threads: 1 });
        scheduler.on(loaded(worker));
        assert_eq!(scheduler.on(left(worker)), []);
    }
    assert_eq!(scheduler.0.jobs.len(), 3);
}

#[test]
fn suspects_wait_for_an_empty_worker_and_get_one() {
    let mut scheduler = Checked::with(&[A]);
    scheduler.on(submitted(1..=12));
    scheduler.join(B, 1);
    scheduler.on(broken(A));
    scheduler.join(C, 1);
    scheduler.on(broken(C));
    // A held 1, 2, 3, and so did C; B holds 4, 5, 6.
    assert_eq!(scheduler.0.queue.suspects().map(|job| job.0).collect::<Vec<_>>(), [1, 2, 3]);
    // It gets nothing more until it is empty, then a suspect, then the others and the next suspect in turn.
    for job in [4, 5] {
        assert_eq!(scheduler.on(finished(B, job)), [deliver(job)]);
    }
    assert_eq!(scheduler.on(finished(B, 6)), [deliver(6), send(B, 1)]);
    // Another one does the rest meanwhile, and is not kept.
    assert_eq!(scheduler.join(A, 1)[1..], [send(A, 2)]);
    assert_eq!(scheduler.on(finished(A, 2)), [deliver(2), send(A, 3)]);
    assert_eq!(scheduler.on(finished(B, 1)), [deliver(1), send(B, 7), send(B, 8), send(B, 9)]);
    assert_eq!(scheduler.on(finished(A, 3)), [deliver(3), send(A, 10), send(A, 11), send(A, 12)]);
}

#[test]
fn one_worker_at_a_time_is_kept_for_suspects() {
    let mut scheduler = Checked::with(&[A]);
    scheduler.on(submitted(1..=12));
    scheduler.join(B, 1);
    scheduler.on(broken(A));
    scheduler.join(C, 1);
    // B holds 4, 5, 6 and C holds 1, 2, 3.
    scheduler.join(A, 1);
    scheduler.on(broken(C));
    assert_eq!(scheduler.on(finished(B, 4)), [deliver(4), send(B, 10)], "A is the one that is kept");
    for job in [7, 8] {
        assert_eq!(scheduler.on(finished(A, job)), [deliver(job)]);
    }
    assert_eq!(scheduler.on(finished(A, 9)), [deliver(9), send(A, 1)]);
    assert_eq!(scheduler.on(finished(B, 5)), [deliver(5), send(B, 11)], "and stays so for the next one");
    assert_eq!(scheduler.on(finished(A, 1)), [deliver(1), send(A, 2)]);
}
