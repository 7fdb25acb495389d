//! What happens at workers and on the way to them, and what it leads to.

use std::time::Duration;

use cluster::JobId;
use cluster::scheduler::{Action, Event, PassOutcome, WorkerId, room};
use kernel::replica::Digest;

use super::{Job, Simulated, Worker};
use crate::model::{WAKING, Where};
use crate::processor::{Nanoseconds, processor_time};

/// Length of the message that has a worker pass a replica on.
const PASS_BYTES: u64 = 100;

/// What can happen.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Happening {
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

impl Simulated<'_> {
    pub(super) fn happens(&mut self, time: Nanoseconds, happening: Happening) {
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
}
