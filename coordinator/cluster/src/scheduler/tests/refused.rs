//! Replicas that workers do not take.

use super::*;

fn refused(worker: WorkerId) -> Event {
    Event::ReplicaRefused { worker, digest: digest(0) }
}

#[test]
fn jobs_go_to_workers_that_take_their_replicas() {
    let mut scheduler = Checked::default();
    scheduler.on(Event::WorkerConnected { worker: A, threads: 1 });
    assert_eq!(scheduler.on(submitted([1])), [load(A)]);
    assert_eq!(scheduler.on(refused(A)), []);
    assert!(scheduler.0.has_refused_jobs());
    // Another job runs meanwhile.
    let needs = vec![digest(1)];
    let load_other = Action::LoadReplica { worker: A, digest: digest(1) };
    assert_eq!(scheduler.on(Event::Submitted { jobs: vec![(JobId(2), needs)] }), [load_other]);
    let other_loaded = Event::ReplicaLoaded { worker: A, digest: digest(1) };
    assert_eq!(scheduler.on(other_loaded), [send(A, 2)]);
    assert_eq!(scheduler.on(finished(A, 2)), [deliver(2)]);
    // One that takes it comes, and fails once: the other one is not tried.
    assert_eq!(scheduler.on(Event::WorkerConnected { worker: B, threads: 1 }), [load(B)]);
    assert!(!scheduler.0.has_refused_jobs());
    assert_eq!(scheduler.on(Event::GaveUpOnRefused), []);
    assert_eq!(scheduler.on(loaded(B)), [send(B, 1)]);
    assert_eq!(scheduler.on(failed(B, 1)), [send(B, 1)]);
    assert_eq!(scheduler.on(finished(B, 1)), [deliver(1)]);
}

#[test]
fn jobs_whose_replicas_nobody_takes_are_given_up_alone() {
    let mut scheduler = Checked::with(&[A]);
    let jobs = [1, 2, 3].map(|job| (JobId(job), vec![digest(0), digest(1)]));
    scheduler.on(Event::Submitted { jobs: jobs.to_vec() });
    scheduler.on(Event::ReplicaRefused { worker: A, digest: digest(1) });
    // Two more that are sent at once.
    assert_eq!(scheduler.on(submitted([4, 5])), [send(A, 4), send(A, 5)]);
    let why = Abandonment::ReplicaRefused;
    assert_eq!(scheduler.on(Event::GaveUpOnRefused), [1, 2, 3].map(|job| abandon(job, why)));
    assert!(!scheduler.0.has_refused_jobs());
    assert_eq!(scheduler.on(finished(A, 4)), [deliver(4)]);
    // What was refused once may be published again, and is tried again.
    scheduler.on(Event::Released { digest: digest(1) });
    let again = vec![(JobId(6), vec![digest(1)])];
    assert_eq!(
        scheduler.on(Event::Submitted { jobs: again }),
        [Action::LoadReplica { worker: A, digest: digest(1) }]
    );
}

#[test]
fn suspects_are_given_up_as_well() {
    let mut scheduler = Checked::with(&[A]);
    scheduler.on(submitted([1]));
    scheduler.on(broken(A));
    scheduler.join(B, 1);
    scheduler.on(broken(B));
    assert_eq!(scheduler.on(Event::WorkerConnected { worker: C, threads: 1 }), [load(C)]);
    assert_eq!(scheduler.on(refused(C)), []);
    assert_eq!(scheduler.on(Event::GaveUpOnRefused), [abandon(1, Abandonment::ReplicaRefused)]);
}
