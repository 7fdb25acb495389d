//! Time of the scheduler per event, by the number of workers: batches that begin with a replica that no worker has, as rounds of
//! refinement do, and end with more threads than jobs.

use std::collections::VecDeque;
use std::hint::black_box;

use cluster::scheduler::{Action, Event, JobId, PassOutcome, Policy, Scheduler, WorkerId};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use kernel::replica::Digest;

/// Batches of a bake, each with receivers of its own.
const BATCHES: u8 = 8;

/// Jobs of a batch, per worker.
const JOBS_PER_WORKER: u64 = 8;

/// Messages under way that answers overtake: a replica takes as long to load as some jobs to compute.
const OUT_OF_ORDER: usize = 7;

/// Bakes on this number of workers of one thread. Returns the number of events.
fn bake(workers: u32) -> u64 {
    let mut scheduler = Scheduler::new(Policy::Finished);
    let mut events: VecDeque<Event> =
        (0..workers).map(|worker| Event::WorkerConnected { worker: WorkerId(worker), threads: 1 }).collect();
    let mut count = 0;
    for batch in 0..BATCHES {
        let jobs = u64::from(workers) * JOBS_PER_WORKER;
        let digest = Digest([batch; 32]);
        let ids = (u64::from(batch) * jobs..).map(JobId).take(jobs as usize);
        // The hub hands jobs over one by one, and no more than workers may have.
        let mut waiting: VecDeque<Event> =
            ids.map(|job| Event::Submitted { jobs: vec![(job, vec![Digest([99; 32]), digest])] }).collect();
        events.extend(waiting.drain(..(3 * workers as usize + 2).min(waiting.len())));
        let mut turn = 0;
        while !events.is_empty() {
            turn += 1;
            let place = turn % OUT_OF_ORDER % events.len();
            let Some(event) = events.remove(place) else { break };
            count += 1;
            for action in scheduler.handle(event) {
                match action {
                    Action::LoadReplica { worker, digest } => {
                        events.push_back(Event::ReplicaLoaded { worker, digest });
                    }
                    Action::PassReplica { from, worker, digest } => {
                        events.push_back(Event::ReplicaLoaded { worker, digest });
                        let outcome = PassOutcome::Done;
                        events.push_back(Event::PassEnded { from, worker, digest, outcome });
                    }
                    Action::Send { worker, job } => events.push_back(Event::Finished { worker, job }),
                    Action::Deliver { .. } => events.extend(waiting.pop_front()),
                    Action::Cancel { .. } | Action::Abandon { .. } | Action::ReleaseReplica { .. } => {}
                }
            }
        }
    }
    count
}

fn events(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("scheduler");
    group.sample_size(10);
    for workers in [16, 64, 256, 1024] {
        group.throughput(Throughput::Elements(bake(workers)));
        group.bench_function(format!("events, {workers} workers"), |bench| {
            bench.iter(|| bake(black_box(workers)));
        });
    }
    group.finish();
}

criterion_group!(benches, events);
criterion_main!(benches);
