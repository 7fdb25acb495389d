//! Whole sequences of events.

mod copies;
mod random;
mod refused;
mod sequences;
mod spread;
mod suspects;

use std::collections::BTreeMap;

use kernel::replica::Digest;

use super::*;

const A: WorkerId = WorkerId(1);
const B: WorkerId = WorkerId(2);
const C: WorkerId = WorkerId(3);

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

fn cancel(worker: WorkerId, job: u64) -> Action {
    Action::Cancel { worker, job: JobId(job) }
}

fn finished(worker: WorkerId, job: u64) -> Event {
    Event::Finished { worker, job: JobId(job) }
}

fn cancelled(worker: WorkerId, job: u64) -> Event {
    Event::Cancelled { worker, job: JobId(job) }
}

fn failed(worker: WorkerId, job: u64) -> Event {
    Event::Failed { worker, job: JobId(job) }
}

fn broken(worker: WorkerId) -> Event {
    Event::WorkerLost { worker, orderly: false }
}

fn left(worker: WorkerId) -> Event {
    Event::WorkerLost { worker, orderly: true }
}

fn deliver(job: u64) -> Action {
    Action::Deliver { job: JobId(job) }
}

fn abandon(job: u64, why: Abandonment) -> Action {
    Action::Abandon { job: JobId(job), why }
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

    /// A worker of so many threads, which holds replica 0; nothing may wait.
    fn join(&mut self, worker: WorkerId, threads: usize) -> Vec<Action> {
        let mut actions = self.on(Event::WorkerConnected { worker, threads });
        actions.extend(self.on(loaded(worker)));
        actions
    }

    /// With these workers of one thread, which hold replica 0.
    fn with(workers: &[WorkerId]) -> Self {
        let mut scheduler = Self::default();
        for &worker in workers {
            scheduler.on(Event::WorkerConnected { worker, threads: 1 });
        }
        // A first job has the replica loaded.
        assert_eq!(scheduler.on(submitted([0])), workers.iter().map(|w| load(*w)).collect::<Vec<_>>());
        // The others may help with it.
        let mut holders = vec![];
        for &worker in workers {
            let actions = scheduler.on(loaded(worker));
            holders.extend(actions.contains(&send(worker, 0)).then_some(worker));
        }
        assert_eq!(scheduler.on(finished(holders[0], 0))[0], deliver(0));
        for &worker in &holders[1..] {
            scheduler.on(cancelled(worker, 0));
        }
        scheduler.0.duplicates_sent = 0;
        scheduler.0.duplicates_dropped = 0;
        scheduler
    }
}
