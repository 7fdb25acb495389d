//! Rows from a simulated cluster: the real scheduler, rows that were recorded, a clock that only this program moves.

mod happenings;
mod service;

use std::cell::Cell;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, HashMap, VecDeque};
use std::sync::Arc;

use bake::Phase;
use cluster::JobId;
use cluster::scheduler::{Event, Policy, Scheduler, WorkerId};
use kernel::replica::Digest;
use kernel::row::RowRequest;
use prost::Message;

use crate::account::{Account, Cause};
use crate::model::{Model, NETWORK_THREADS};
use crate::processor::{Nanoseconds, processor_time, processor_time_of_all};
use crate::recorder::{Recorded, Recorder};
use happenings::Happening;

/// A cluster that is simulated.
pub struct Simulated<'a> {
    recorder: &'a mut Recorder,
    model: Model,
    phase: &'a Cell<Phase>,
    scheduler: Scheduler,
    /// The driver's clock: ahead of all that was simulated, or waiting for it.
    now: Nanoseconds,
    /// Processor time of the driver's thread and of all when it was last asked.
    mark: [Nanoseconds; 2],
    /// Jobs that workers hold because they are far away.
    ahead: usize,
    /// Asked for, and not yet told to the scheduler.
    submitted: Vec<(Nanoseconds, JobId, RowRequest)>,
    jobs: HashMap<JobId, Job>,
    workers: Vec<Worker>,
    /// What will happen, by time and then in the order in which it was foreseen.
    future: BinaryHeap<Reverse<(Nanoseconds, u64, Happening)>>,
    foreseen: u64,
    results: VecDeque<(Nanoseconds, JobId)>,
    /// When each thing is free again.
    link_in: Nanoseconds,
    link_out: Nanoseconds,
    reactor: Nanoseconds,
    network_threads: [Nanoseconds; NETWORK_THREADS],
    energies: Nanoseconds,
    /// Where the time went.
    pub account: Account,
}

struct Job {
    rows: Vec<Arc<Recorded>>,
    needs: Vec<Digest>,
    bytes: u64,
    compute: Nanoseconds,
    answer_bytes: u64,
    decode: Nanoseconds,
    shoots: bool,
    copies: u32,
    delivered: bool,
}

#[derive(Default)]
struct Worker {
    line: VecDeque<JobId>,
    computing: Option<JobId>,
    /// Jobs on their way to it.
    coming: u64,
    /// Replicas on their way to it, or made ready there.
    loading: u64,
    /// When its own link is free again, for replicas that it passes on.
    link_out: Nanoseconds,
    /// Mean time of its jobs.
    mean: f64,
    /// Jobs that it may hold, once that was measured.
    room: usize,
}

impl<'a> Simulated<'a> {
    /// With all workers connected; `phase` is what the bake is doing.
    pub fn new(recorder: &'a mut Recorder, model: Model, phase: &'a Cell<Phase>) -> Self {
        let mut scheduler = Scheduler::new(model.policy);
        let workers = model.workers.len();
        for worker in 0..workers {
            if model.passes {
                scheduler.handle(Event::PassesReplicas { worker: WorkerId(worker as u32) });
            }
            scheduler.handle(Event::WorkerConnected { worker: WorkerId(worker as u32), threads: 1 });
        }
        let mut simulated = Self {
            recorder,
            phase,
            scheduler,
            now: 0,
            mark: processor_times(),
            ahead: 0,
            submitted: vec![],
            jobs: HashMap::new(),
            workers: (0..workers).map(|_| Worker::default()).collect(),
            future: BinaryHeap::new(),
            foreseen: 0,
            results: VecDeque::new(),
            link_in: 0,
            link_out: 0,
            reactor: 0,
            network_threads: [0; NETWORK_THREADS],
            energies: 0,
            account: Account::new(workers),
            model,
        };
        if simulated.model.policy == Policy::Periodic {
            simulated.foresee(0, Happening::Tick);
        }
        simulated
    }

    /// The bake is over: the time that it took.
    pub fn finish(&mut self) -> Nanoseconds {
        self.charge();
        self.account.advance(self.now, self.now, self.phase.get());
        self.account.duplicates = [self.scheduler.duplicates_sent(), self.scheduler.duplicates_dropped()];
        self.now
    }

    /// The driver has worked since it was last here.
    fn charge(&mut self) {
        let [own, all] = processor_times();
        // Of the thread's own time nothing is shared: what threads share is done by others, while it waits.
        let own = self.model.scaled(own - self.mark[0]);
        let shared = self.model.scaled(all - self.mark[1]).saturating_sub(own);
        self.now += (own + shared / self.model.cores) / self.model.driver;
        self.account.shared += shared;
        *self.account.driver.entry(self.phase.get().name()).or_default() += own + shared;
    }

    fn foresee(&mut self, time: Nanoseconds, happening: Happening) {
        self.foreseen += 1;
        self.future.push(Reverse((time, self.foreseen, happening)));
    }

    /// Has what was submitted computed, where that was never done, and lets it happen.
    fn take_submitted(&mut self) {
        if self.submitted.is_empty() {
            return;
        }
        let submitted = std::mem::take(&mut self.submitted);
        let requests: Vec<RowRequest> = submitted.iter().map(|(_, _, request)| request.clone()).collect();
        self.recorder.record(&requests);
        for (time, id, request) in submitted {
            let rows = self.recorder.rows(&request);
            let sum = |part: fn(&Recorded) -> u64| rows.iter().map(|row| part(row)).sum::<u64>();
            let job = Job {
                needs: vec![request.scene, request.receivers],
                bytes: request.to_job(id.0).encoded_len() as u64,
                compute: self.model.scaled(sum(|row| row.compute)),
                answer_bytes: sum(|row| row.bytes + row.statistics.encoded_len() as u64),
                decode: self.model.scaled(sum(|row| row.decode)),
                shoots: self.phase.get() == Phase::Shoot,
                copies: 0,
                delivered: false,
                rows,
            };
            self.account.asked(job.compute, job.answer_bytes);
            self.jobs.insert(id, job);
            self.foresee(time, Happening::Submitted(id));
        }
    }

    fn on_network_thread(&mut self, time: Nanoseconds, work: Nanoseconds) -> Nanoseconds {
        let free = self.network_threads.iter_mut().min().expect("there are some");
        *free = time.max(*free) + work;
        *free
    }

    fn send(&mut self, time: Nanoseconds, bytes: u64) -> Nanoseconds {
        let made = self.on_network_thread(time, self.model.per_message);
        self.link_out = self.link_out.max(made) + self.model.travelling(bytes);
        self.link_out + self.model.latency
    }

    /// How many threads wait for what.
    fn waiting(&self) -> BTreeMap<Cause, usize> {
        let mut waiting = BTreeMap::new();
        let any = self.workers.iter().any(|worker| worker.computing.is_some());
        for worker in self.workers.iter().filter(|worker| worker.computing.is_none()) {
            let cause = match (worker.coming, worker.loading) {
                (0, 0) if any => Cause::TooFewJobs,
                (0, 1..) => Cause::Replica,
                _ => Cause::Network,
            };
            *waiting.entry(cause).or_default() += 1;
        }
        waiting
    }
}

/// Processor time of this thread, and of all.
fn processor_times() -> [Nanoseconds; 2] {
    [processor_time(), processor_time_of_all()]
}
