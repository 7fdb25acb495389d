//! Rows from a simulated cluster: the real scheduler, rows that were recorded, a clock that only this program moves.

use std::cell::Cell;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, HashMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use bake::{BakeError, Phase, RowService};
use cluster::scheduler::{Action, Event, PassOutcome, Policy, Scheduler, WorkerId, room};
use cluster::{FinishedJob, JobId};
use kernel::replica::{Digest, EncodedReplica};
use kernel::row::RowRequest;
use prost::Message;

use crate::account::{Account, Cause};
use crate::model::{Model, NETWORK_THREADS, WAKING, Where};
use crate::processor::{Nanoseconds, processor_time, processor_time_of_all};
use crate::recorder::{Recorded, Recorder};

/// Length of the message that has a worker pass a replica on.
const PASS_BYTES: u64 = 100;

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

/// What can happen.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Happening {
    Submitted(JobId),
    Tick,
    ReplicaLoaded(usize, Digest),
    PassArrives([usize; 2], Digest),
    PassEnded([usize; 2], Digest),
    Released(Digest),
    JobArrives(usize, JobId),
    CancelArrives(usize, JobId),
    Computed(usize, JobId),
    Shot(usize, JobId),
    Cancelled(usize, JobId),
    Answered(usize, JobId),
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

    fn happens(&mut self, time: Nanoseconds, happening: Happening) {
        let id = |worker: usize| WorkerId(worker as u32);
        match happening {
            Happening::Submitted(job) => {
                let needs = self.jobs[&job].needs.clone();
                self.tell(time, Event::Submitted { jobs: vec![(job, needs)] });
            }
            Happening::Tick => {
                self.tell(time, Event::Tick);
                self.foresee(time + self.model.period, Happening::Tick);
            }
            Happening::ReplicaLoaded(worker, digest) => {
                self.workers[worker].loading -= 1;
                self.tell(time, Event::ReplicaLoaded { worker: id(worker), digest });
            }
            Happening::PassArrives([from, to], digest) => {
                let (bytes, prepare) = self.recorder.replica(digest);
                // The other worker is dialled: a message there and back before the first byte.
                let connected = time + 2 * (self.model.latency + self.model.per_message);
                let sent = self.workers[from].link_out.max(connected) + self.model.travelling(bytes);
                self.workers[from].link_out = sent;
                let ready = sent + self.model.latency + self.model.scaled(prepare);
                let told = ready + self.model.latency + self.model.per_message;
                self.foresee(told, Happening::ReplicaLoaded(to, digest));
                // It hears from the other worker that it is done, and says so.
                let ended = told + self.model.latency + self.model.per_message;
                self.foresee(ended, Happening::PassEnded([from, to], digest));
            }
            Happening::PassEnded([from, to], digest) => {
                let outcome = PassOutcome::Done;
                self.tell(time, Event::PassEnded { from: id(from), worker: id(to), digest, outcome });
            }
            Happening::Released(digest) => self.tell(time, Event::Released { digest }),
            Happening::JobArrives(worker, job) => {
                self.workers[worker].coming -= 1;
                self.workers[worker].line.push_back(job);
                self.begin(worker, time);
            }
            Happening::CancelArrives(worker, job) => {
                let line = &mut self.workers[worker].line;
                if let Some(place) = line.iter().position(|waits| *waits == job) {
                    line.remove(place);
                    let there = self.on_network_thread(time + self.model.latency, self.model.per_message);
                    self.foresee(there, Happening::Cancelled(worker, job));
                }
            }
            Happening::Computed(worker, job) => match self.model.shooting {
                Where::Remotely { bytes } if self.jobs[&job].shoots && self.model.workers.len() > 1 => {
                    // Fetched and brought back, while nobody else may.
                    let held = 2 * (self.model.latency + self.model.travelling(bytes));
                    self.energies = self.energies.max(time) + held;
                    self.foresee(self.energies, Happening::Shot(worker, job));
                }
                _ => self.answer(worker, job, time),
            },
            Happening::Shot(worker, job) => self.answer(worker, job, time),
            Happening::Cancelled(worker, job) => {
                self.tell(time, Event::Cancelled { worker: id(worker), job })
            }
            Happening::Answered(worker, job) => {
                self.measure(worker, job, time);
                self.tell(time, Event::Finished { worker: id(worker), job });
            }
        }
    }

    /// A worker may hold as many jobs as its distance takes.
    fn measure(&mut self, worker: usize, job: JobId, time: Nanoseconds) {
        let latest = self.jobs[&job].compute as f64;
        let state = &mut self.workers[worker];
        state.mean = if state.mean == 0.0 { latest } else { 0.8 * state.mean + 0.2 * latest };
        let round_trip = Duration::from_nanos(2 * self.model.latency);
        let jobs = room(1, round_trip, Duration::from_nanos(state.mean as u64));
        let before = std::mem::replace(&mut state.room, jobs);
        if before != jobs {
            self.ahead = self.workers.iter().map(|worker| worker.room.saturating_sub(3)).sum();
            self.tell(time, Event::RoomChanged { worker: WorkerId(worker as u32), jobs });
        }
    }

    /// A worker sends the rows home and goes on.
    fn answer(&mut self, worker: usize, id: JobId, time: Nanoseconds) {
        let Job { decode, answer_bytes, shoots, .. } = self.jobs[&id];
        // Energies are home already.
        let remote = shoots && self.model.shooting != Where::Locally && self.model.workers.len() > 1;
        let (decode, bytes) = if remote { (0, 64) } else { (decode, answer_bytes) };
        self.link_in = self.link_in.max(time) + self.model.travelling(bytes);
        let decoded =
            self.on_network_thread(self.link_in + self.model.latency, self.model.per_message + decode);
        self.account.decoding += decode;
        self.foresee(decoded, Happening::Answered(worker, id));
        self.workers[worker].computing = None;
        self.begin(worker, time);
    }

    fn begin(&mut self, worker: usize, time: Nanoseconds) {
        let speed = self.model.workers[worker];
        let Worker { line, computing, .. } = &mut self.workers[worker];
        if computing.is_none()
            && let Some(id) = line.pop_front()
        {
            *computing = Some(id);
            if speed > 0.0 {
                let compute = (self.jobs[&id].compute as f64 / speed) as Nanoseconds;
                self.foresee(time + compute, Happening::Computed(worker, id));
            }
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

    fn tell(&mut self, time: Nanoseconds, event: Event) {
        let start = processor_time();
        let actions = self.scheduler.handle(event);
        let took = self.model.scaled(processor_time() - start);
        self.account.scheduling += took;
        self.account.events += 1;
        self.reactor = self.reactor.max(time) + took;
        let time = self.reactor;
        for action in actions {
            match action {
                Action::LoadReplica { worker, digest } => {
                    let (bytes, prepare) = self.recorder.replica(digest);
                    let prepare = self.model.scaled(prepare);
                    let there = if self.model.free_replicas { time } else { self.send(time, bytes) };
                    let known = there + prepare + self.model.latency;
                    self.workers[worker.0 as usize].loading += 1;
                    self.foresee(known, Happening::ReplicaLoaded(worker.0 as usize, digest));
                }
                Action::PassReplica { from, worker, digest } => {
                    let there = self.send(time, PASS_BYTES);
                    self.workers[worker.0 as usize].loading += 1;
                    let ends = [from, worker].map(|worker| worker.0 as usize);
                    self.foresee(there, Happening::PassArrives(ends, digest));
                }
                Action::Send { worker, job } => {
                    let state = self.jobs.get_mut(&job).expect("it was submitted");
                    state.copies += 1;
                    let bytes = state.bytes;
                    let there = self.send(time, bytes);
                    self.workers[worker.0 as usize].coming += 1;
                    self.foresee(there, Happening::JobArrives(worker.0 as usize, job));
                }
                Action::Cancel { worker, job } => {
                    let there = self.send(time, 16);
                    self.foresee(there, Happening::CancelArrives(worker.0 as usize, job));
                }
                Action::Deliver { job } => {
                    self.jobs.get_mut(&job).expect("it was submitted").delivered = true;
                    self.results.push_back((time + WAKING, job));
                }
                Action::Abandon { .. } => unreachable!("nobody is lost here"),
                Action::ReleaseReplica { .. } => {}
            }
        }
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

impl RowService for Simulated<'_> {
    fn publish(&mut self, replica: EncodedReplica) {
        self.charge();
        self.recorder.publish(replica);
        self.mark = processor_times();
    }

    fn release(&mut self, digest: Digest) {
        self.charge();
        self.foresee(self.now, Happening::Released(digest));
        self.mark = processor_times();
    }

    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>) {
        self.charge();
        let now = self.now;
        self.submitted.extend(requests.into_iter().map(|(job, request)| (now, job, request)));
        self.mark = processor_times();
    }

    fn threads(&self) -> usize {
        self.model.workers.len()
    }

    fn jobs_ahead(&self) -> usize {
        4 * self.model.workers.len() + self.ahead
    }

    fn withdraw(&mut self) {
        self.submitted.clear();
    }

    fn next(&mut self, _: Duration) -> Result<Option<FinishedJob>, BakeError> {
        self.charge();
        self.take_submitted();
        while self.results.is_empty() {
            let Reverse((time, _, happening)) = self.future.pop().expect("somebody answers");
            let waiting = self.waiting();
            self.account.wait(time, self.now, self.phase.get(), &waiting);
            self.happens(time, happening);
        }
        let (time, id) = self.results.pop_front().expect("there is one");
        self.now = self.now.max(time);
        // Who computes it a second time needs to know how long that takes.
        let rows = self.jobs[&id].rows.clone();
        let finished = FinishedJob {
            job: id,
            rows: rows.iter().map(|row| row.row.clone()).collect(),
            statistics: rows.iter().map(|row| row.statistics).collect(),
        };
        self.mark = processor_times();
        Ok(Some(finished))
    }
}
