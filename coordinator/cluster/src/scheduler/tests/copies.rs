//! Idle workers take over what others are late with.

use std::collections::VecDeque;

use super::*;
use crate::scheduler::index::PATIENCE;

#[test]
fn the_first_answer_counts_and_the_other_copy_is_cancelled() {
    let mut scheduler = Checked::with(&[A, B]);
    assert_eq!(scheduler.on(submitted([1])), [send(A, 1), send(B, 1)]);
    assert_eq!(scheduler.on(finished(B, 1)), [deliver(1), cancel(A, 1)]);
    assert_eq!(scheduler.on(submitted([2])), [send(B, 2)], "B has more room, and A is busy until it answers");
    assert_eq!(scheduler.on(cancelled(A, 1)), [send(A, 2)]);
    assert_eq!(scheduler.0.duplicates_sent(), 2);
    assert_eq!(scheduler.0.duplicates_dropped(), 1);
    assert_eq!(scheduler.0.ignored_answers(), 0);
}

#[test]
fn a_copy_that_was_begun_is_dropped_when_it_comes() {
    let mut scheduler = Checked::with(&[A, B]);
    scheduler.on(submitted([1]));
    assert_eq!(scheduler.on(finished(A, 1)), [deliver(1), cancel(B, 1)]);
    assert_eq!(scheduler.on(finished(B, 1)), []);
    assert_eq!(scheduler.0.duplicates_dropped(), 1);
    assert_eq!(scheduler.0.ignored_answers(), 0);
}

#[test]
fn no_job_has_more_than_two_copies() {
    let mut scheduler = Checked::with(&[A, B, C]);
    assert_eq!(scheduler.on(submitted([1])), [send(A, 1), send(B, 1)]);
    assert_eq!(scheduler.on(Event::Tick), []);
}

#[test]
fn a_job_that_fails_has_its_other_copy_left() {
    let mut scheduler = Checked::with(&[A, B]);
    scheduler.on(submitted([1]));
    assert_eq!(scheduler.on(failed(A, 1)), []);
    assert_eq!(scheduler.on(finished(B, 1)), [deliver(1)]);
}

#[test]
fn a_refused_job_is_cancelled_everywhere() {
    let mut scheduler = Checked::with(&[A, B]);
    scheduler.on(submitted([1]));
    assert_eq!(
        scheduler.on(Event::Refused { worker: B, job: JobId(1) }),
        [abandon(1, Abandonment::Refused), cancel(A, 1)]
    );
}

#[test]
fn a_lost_worker_leaves_the_other_copy() {
    let mut scheduler = Checked::with(&[A, B]);
    scheduler.on(submitted([1]));
    assert_eq!(scheduler.on(broken(A)), []);
    assert_eq!(scheduler.join(C, 1), [], "the copy is under way");
    assert_eq!(scheduler.on(finished(B, 1)), [deliver(1)]);
}

#[test]
fn what_waits_deepest_in_a_line_is_taken_first() {
    let mut scheduler = Checked::with(&[A, B]);
    assert_eq!(scheduler.on(submitted(1..=6)).len(), 6);
    // A holds 1, 3, 5 and B holds 2, 4, 6.
    assert_eq!(scheduler.on(finished(B, 2)), [deliver(2)]);
    assert_eq!(scheduler.on(finished(B, 4)), [deliver(4)]);
    assert_eq!(scheduler.on(finished(B, 6)), [deliver(6), send(B, 5)]);
    assert_eq!(scheduler.on(finished(B, 5)), [deliver(5), cancel(A, 5), send(B, 3)]);
    assert_eq!(scheduler.on(cancelled(A, 5)), []);
    assert_eq!(scheduler.on(finished(B, 3)), [deliver(3), cancel(A, 3), send(B, 1)]);
    assert_eq!(scheduler.on(finished(B, 1)), [deliver(1), cancel(A, 1)]);
    assert_eq!(scheduler.0.duplicates_sent(), 3);
}

#[test]
fn idle_workers_leave_alone_what_is_in_time() {
    let workers: Vec<WorkerId> = (1..=8).map(WorkerId).collect();
    let mut scheduler = Checked::with(&workers);
    let sent = scheduler.on(submitted(1..=4));
    // Of four jobs on four workers, one gets a second copy: that is all that four idle workers do.
    assert_eq!(sent.len(), 5);
    assert_eq!(scheduler.0.duplicates_sent(), 1);
}

#[test]
fn what_is_overdue_is_taken_before_what_waits() {
    let mut scheduler = Checked::with(&[A, B, C]);
    assert_eq!(scheduler.on(submitted(1..=9)).len(), 9);
    // A holds 1, 4, 7 and hangs, C holds 3, 6, 9 and works, and B goes through all others, three to a round.
    scheduler.on(submitted(10..=16));
    for job in [2, 5, 8, 10, 11, 12, 13, 14] {
        assert_eq!(scheduler.on(finished(B, job))[0], deliver(job));
    }
    assert_eq!(scheduler.on(finished(B, 15)), [deliver(15)]);
    assert!(
        (scheduler.0.rounds - scheduler.0.workers[&A].under_way[0].begun.unwrap() - PATIENCE).abs() < 1e-9
    );
    // Three rounds are over: jobs 1 and 3 are overdue, and 7 and 9 wait deepest in their lines.
    assert_eq!(scheduler.on(finished(B, 16)), [deliver(16), send(B, 1)]);
    assert_eq!(scheduler.on(finished(B, 1)), [deliver(1), cancel(A, 1), send(B, 3)]);
    assert_eq!(scheduler.on(finished(B, 3)), [deliver(3), cancel(C, 3), send(B, 7)]);
}

#[test]
fn one_that_hangs_holds_nobody_up() {
    // The third of eight workers never answers, and all is done by the others.
    let workers: Vec<WorkerId> = (1..=8).map(WorkerId).collect();
    let mut scheduler = Checked::with(&workers);
    let hangs = |worker: WorkerId| worker.0 == 3;
    let mut under_way = scheduler.on(submitted(1..=100));
    let mut delivered = 0;
    while let Some(action) = under_way.pop() {
        match action {
            Action::Send { worker, job } if !hangs(worker) => {
                under_way.extend(scheduler.on(Event::Finished { worker, job }));
            }
            Action::Deliver { .. } => delivered += 1,
            _ => {}
        }
    }
    assert_eq!(delivered, 100);
}

/// Workers of one thread that compute their jobs in turn; `late` of each round some finish nothing.
fn computed_in_rounds(jobs: u64, workers: u32, is_late: impl Fn(u32, WorkerId) -> bool) -> (Scheduler, u32) {
    let mut scheduler = Scheduler::default();
    let mut lines: BTreeMap<WorkerId, VecDeque<JobId>> = BTreeMap::new();
    let mut events = VecDeque::from_iter(
        (1..=workers).map(|worker| Event::WorkerConnected { worker: WorkerId(worker), threads: 1 }),
    );
    events.push_back(submitted(0..jobs));
    let (mut delivered, mut rounds) = (0, 0);
    while delivered < jobs {
        while let Some(event) = events.pop_front() {
            for action in scheduler.handle(event) {
                match action {
                    Action::LoadReplica { worker, digest } => {
                        events.push_back(Event::ReplicaLoaded { worker, digest });
                    }
                    Action::Send { worker, job } => lines.entry(worker).or_default().push_back(job),
                    Action::Cancel { worker, job } => {
                        let line = lines.get_mut(&worker).unwrap();
                        if let Some(place) = line.iter().skip(1).position(|waits| *waits == job) {
                            line.remove(place + 1);
                            events.push_back(Event::Cancelled { worker, job });
                        }
                    }
                    Action::Deliver { .. } => delivered += 1,
                    _ => {}
                }
            }
        }
        rounds += 1;
        for (&worker, line) in lines.iter_mut().filter(|(worker, _)| !is_late(rounds, **worker)) {
            events.extend(line.pop_front().map(|job| Event::Finished { worker, job }));
        }
        assert!(rounds < 100_000, "it stands still");
    }
    (scheduler, rounds)
}

#[test]
fn on_even_workers_there_are_few_copies() {
    let (scheduler, rounds) = computed_in_rounds(10_000, 256, |_, _| false);
    assert!(rounds <= 10_000_u32.div_ceil(256) + 1, "{rounds}");
    assert!(scheduler.duplicates_sent() <= 100, "{} copies", scheduler.duplicates_sent());
}

#[test]
fn a_worker_that_is_ten_times_slower_holds_nobody_up() {
    let (_, rounds) = computed_in_rounds(100, 4, |round, worker| worker == A && round % 10 != 0);
    // At best 100 / 3.1 = 32.3.
    assert!(rounds <= 35, "{rounds}");
    let (_, rounds) = computed_in_rounds(100, 4, |_, worker| worker == A);
    assert!(rounds <= 36, "{rounds}");
}
