//! What waits goes to those with room; answers come late, twice, or not at all.

use super::*;

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
    assert_eq!(scheduler.on(submitted([1, 2])), [send(A, 1), load(B), send(A, 2)]);
    assert_eq!(scheduler.on(submitted(3..=10)), [send(A, 3)], "B has no replica yet");
    assert_eq!(scheduler.on(loaded(B)), (4..=10).map(|job| send(B, job)).collect::<Vec<_>>());
    assert_eq!(scheduler.on(submitted(11..=12)), []);
    assert_eq!(scheduler.on(finished(B, 5)), [deliver(5), send(B, 11)]);
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
    assert_eq!(scheduler.on(broken(A)), []);
    assert_eq!(scheduler.on(finished(B, 2)), [deliver(2), send(B, 1)]);
    assert_eq!(scheduler.on(finished(B, 4)), [deliver(4), send(B, 3)]);
    assert_eq!(scheduler.on(finished(B, 6)), [deliver(6), send(B, 5)]);
    assert_eq!(scheduler.on(finished(B, 1)), [deliver(1), send(B, 7)]);
    assert_eq!(scheduler.on(broken(B)), []);
}

#[test]
fn late_and_double_answers_are_ignored_and_counted() {
    let mut scheduler = Checked::with(&[A, B]);
    scheduler.on(submitted([1]));
    scheduler.on(broken(A));
    assert_eq!(scheduler.on(finished(A, 1)), []);
    assert_eq!(scheduler.on(finished(B, 1)), [deliver(1)]);
    assert_eq!(scheduler.on(finished(B, 1)), []);
    assert_eq!(scheduler.on(failed(B, 1)), []);
    assert_eq!(scheduler.0.ignored_answers(), 3);
    assert_eq!(scheduler.0.duplicates_dropped(), 0, "these are no answers to duplicates");
}

#[test]
fn a_failing_job_is_tried_elsewhere_and_then_given_up() {
    let mut scheduler = Checked::with(&[A, B]);
    scheduler.on(submitted(2..=6));
    assert_eq!(scheduler.on(submitted([7, 8])), [send(B, 7)], "each holds three");
    // A holds 2, 4, 6, and B holds 3, 5, 7; 8 waits.
    assert_eq!(scheduler.on(failed(A, 2)), [send(A, 8)], "not once more to A");
    assert_eq!(scheduler.on(finished(B, 3)), [deliver(3), send(B, 2)]);
    assert_eq!(scheduler.on(failed(B, 2)), [send(B, 2)], "all have failed: whoever has room tries again");
    assert_eq!(scheduler.on(failed(B, 2))[0], abandon(2, Abandonment::FailedTooOften));
    assert_eq!(
        scheduler.on(Event::Refused { worker: A, job: JobId(6) })[0],
        abandon(6, Abandonment::Refused)
    );
}

#[test]
fn a_job_that_is_wanted_and_was_not_done_counts_as_failed() {
    let mut scheduler = Checked::with(&[A]);
    scheduler.on(submitted([1]));
    for _ in 1..MOST_FAILURES {
        assert_eq!(scheduler.on(cancelled(A, 1)), [send(A, 1)]);
    }
    assert_eq!(scheduler.on(cancelled(A, 1)), [abandon(1, Abandonment::FailedTooOften)]);
}

#[test]
fn a_forgotten_replica_is_loaded_once_more_for_all_its_jobs() {
    let mut scheduler = Checked::with(&[A]);
    scheduler.on(submitted([1, 2]));
    assert_eq!(scheduler.on(Event::ForgotReplica { worker: A, job: JobId(1) }), [load(A)]);
    assert_eq!(scheduler.on(Event::ForgotReplica { worker: A, job: JobId(2) }), []);
    assert_eq!(scheduler.on(loaded(A)), [send(A, 1), send(A, 2)]);
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
        [abandon(1, Abandonment::ReplicasForgotten)]
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

#[test]
fn by_the_period_jobs_are_sent_on_ticks_alone() {
    let mut scheduler = Checked(Scheduler::new(Policy::Periodic));
    scheduler.on(Event::WorkerConnected { worker: A, threads: 1 });
    assert_eq!(scheduler.on(submitted(1..=5)), []);
    assert_eq!(scheduler.on(Event::Tick), [load(A)]);
    assert_eq!(scheduler.on(loaded(A)), []);
    assert_eq!(scheduler.on(Event::Tick), [send(A, 1), send(A, 2), send(A, 3)]);
    for job in 1..=3 {
        assert_eq!(scheduler.on(finished(A, job)), [deliver(job)]);
    }
    assert_eq!(scheduler.on(Event::Tick), [send(A, 4), send(A, 5)]);
    assert_eq!(scheduler.on(Event::Tick), []);
}

#[test]
fn a_tick_changes_nothing_where_news_does_all() {
    let mut scheduler = Checked::with(&[A, B]);
    scheduler.on(submitted(1..=10));
    assert_eq!(scheduler.on(Event::Tick), []);
}

#[test]
fn what_nobody_waits_for_is_not_begun_and_not_delivered() {
    let mut scheduler = Checked::with(&[A]);
    // Three are sent to a worker of one thread, two wait.
    assert_eq!(scheduler.on(submitted(1..=5)), [send(A, 1), send(A, 2), send(A, 3)]);
    let withdrawn = Event::Withdrawn { jobs: [1, 2, 4, 9].map(JobId).to_vec() };
    assert_eq!(scheduler.on(withdrawn), [cancel(A, 1), cancel(A, 2)]);
    assert_eq!(scheduler.on(finished(A, 1)), [send(A, 5)]);
    assert_eq!(scheduler.on(cancelled(A, 2)), []);
    assert_eq!(scheduler.on(finished(A, 3))[0], deliver(3));
    assert_eq!(scheduler.on(finished(A, 5))[0], deliver(5));
    assert_eq!(scheduler.0.duplicates_dropped(), 0, "nobody else answered them");
}
