//! Invariants after every event of a scheduler, checked against the events and actions instead of the scheduler's state.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use kernel::replica::Digest;

use super::plan::Plan;
use crate::connections::ReactorObserver;
use crate::scheduler::{Action, Event, JobId, PassOutcome, Scheduler, WorkerId};

/// Bound on jobs of a worker: this many per thread, and as many again.
const MOST_JOBS_PER_THREAD: usize = 4;

/// Largest number of workers that hold a job.
const MOST_HOLDERS: usize = 2;

thread_local! {
    /// State of the simulation that this thread runs, if any.
    static WATCH: RefCell<Option<Watch>> = const { RefCell::new(None) };
}

/// Counts of faults and reactions.
#[derive(Debug, Clone, Copy, Default)]
pub struct Counts {
    /// Workers that were lost.
    pub lost_workers: u64,
    /// Those of them that said goodbye.
    pub orderly: u64,
    /// Jobs sent to a second worker, or more often.
    pub sent_again: u64,
    /// Answers after the first one.
    pub late: u64,
    /// Jobs cancelled.
    pub cancelled: u64,
    /// Replicas passed on.
    pub passed: u64,
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { lost_workers, orderly, sent_again, late, cancelled, passed } = self;
        write!(f, "{lost_workers} {orderly} {sent_again} {late} {cancelled} {passed}")
    }
}

impl Counts {
    /// Reads what was printed.
    pub fn parse(printed: &str) -> Option<Self> {
        let mut numbers = printed.split_whitespace().map_while(|number| number.parse().ok());
        let mut next = || numbers.next();
        Some(Self {
            lost_workers: next()?,
            orderly: next()?,
            sent_again: next()?,
            late: next()?,
            cancelled: next()?,
            passed: next()?,
        })
    }

    /// Adds those of another simulation.
    pub fn add(&mut self, other: &Self) {
        self.lost_workers += other.lost_workers;
        self.orderly += other.orderly;
        self.sent_again += other.sent_again;
        self.late += other.late;
        self.cancelled += other.cancelled;
        self.passed += other.passed;
    }
}

/// The scheduler's state as deduced from outside.
#[derive(Default)]
pub struct Watch {
    pub trace: Vec<String>,
    /// First invariant that was violated.
    pub violation: Option<String>,
    pub counts: Counts,
    workers: BTreeMap<WorkerId, Known>,
    submitted: BTreeSet<JobId>,
    sent: BTreeSet<JobId>,
    delivered: BTreeSet<JobId>,
}

struct Known {
    threads: usize,
    /// Jobs that it may hold since it was found to be far away.
    room: usize,
    under_way: BTreeSet<JobId>,
    /// Replicas, and whether they have arrived.
    replicas: BTreeMap<Digest, bool>,
    /// Those that another worker was to pass on to it.
    passed: BTreeSet<Digest>,
}

/// Starts to watch the simulation that this thread is about to run.
pub fn begin(plan: &Plan) {
    let trace = vec![format!("{plan:?}")];
    WATCH.set(Some(Watch { trace, ..Watch::default() }));
}

/// Stops to watch.
pub fn end() -> Watch {
    WATCH.take().unwrap_or_default()
}

/// Whether an invariant was violated.
pub fn is_violated() -> bool {
    WATCH.with_borrow(|watch| watch.as_ref().is_some_and(|watch| watch.violation.is_some()))
}

/// Puts a line into the trace.
pub fn note(time: Duration, line: String) {
    with(|watch| watch.trace.push(format!("{:8.3} {line}", time.as_secs_f64())));
}

fn with(look: impl FnOnce(&mut Watch)) {
    WATCH.with_borrow_mut(|watch| watch.as_mut().map(look));
}

/// Observes the reactor of the simulation that this thread runs.
pub struct Watcher;

impl ReactorObserver for Watcher {
    fn begin(&mut self, scheduler: &mut Scheduler) {
        // Of few workers, too, some are to get what they need from others.
        scheduler.upload_at_most(1);
    }

    fn decide(&mut self, scheduler: &mut Scheduler, event: Event) -> Vec<Action> {
        let actions = scheduler.handle(event.clone());
        scheduled(&event, &actions, scheduler);
        actions
    }

    fn held(&mut self, requests: usize, sessions: usize, delivered: usize) {
        held(requests, sessions, delivered);
    }
}

/// Checks a decision of the scheduler.
fn scheduled(event: &Event, actions: &[Action], scheduler: &Scheduler) {
    let time = turmoil::sim_elapsed().unwrap_or_default();
    note(time, format!("{event:?} -> {actions:?}"));
    with(|watch| {
        let checked = watch.hear(event, actions).and_then(|()| {
            // It panics where it finds something.
            catch_unwind(AssertUnwindSafe(|| scheduler.sanity_check())).map_err(|panic| {
                let words = panic.downcast_ref::<String>().cloned();
                words
                    .or_else(|| panic.downcast_ref::<&str>().map(|words| words.to_string()))
                    .unwrap_or_default()
            })
        });
        if let Err(violation) = checked {
            watch.violation.get_or_insert(violation);
        }
    });
}

/// Checks the numbers of requests, sessions, and digests of answers that may come twice, between two messages.
fn held(requests: usize, sessions: usize, delivered: usize) {
    with(|watch| {
        let unfinished = watch.submitted.len() - watch.delivered.len();
        let copies: usize = watch.workers.values().map(|worker| worker.under_way.len()).sum();
        let checks = [
            (
                requests == unfinished,
                format!("{requests} requests are held for {unfinished} unfinished jobs"),
            ),
            (
                sessions == watch.workers.len(),
                format!("{sessions} sessions with {} workers", watch.workers.len()),
            ),
            (
                delivered <= copies,
                format!("{delivered} digests are held, and {copies} answers can still come"),
            ),
        ];
        for (holds, words) in checks {
            if !holds {
                watch.violation.get_or_insert(words);
            }
        }
    });
}

/// Fails with these words unless it holds.
fn ensure(holds: bool, words: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(words()) }
}

impl Watch {
    fn hear(&mut self, event: &Event, actions: &[Action]) -> Result<(), String> {
        let mut finished = None;
        match event {
            Event::WorkerConnected { worker, threads } => {
                let known = Known {
                    threads: *threads,
                    room: 0,
                    under_way: BTreeSet::new(),
                    replicas: BTreeMap::new(),
                    passed: BTreeSet::new(),
                };
                ensure(self.workers.insert(*worker, known).is_none(), || {
                    format!("{worker:?} connected twice")
                })?;
            }
            Event::WorkerLost { worker, orderly } => {
                self.counts.lost_workers += 1;
                self.counts.orderly += u64::from(*orderly);
                ensure(self.workers.remove(worker).is_some(), || {
                    format!("{worker:?} was lost and not there")
                })?;
            }
            Event::Submitted { jobs } => {
                for (job, _) in jobs {
                    ensure(self.submitted.insert(*job), || format!("{job:?} submitted twice"))?;
                }
            }
            Event::ReplicaLoaded { worker, digest } => {
                if let Some(loaded) =
                    self.workers.get_mut(worker).and_then(|known| known.replicas.get_mut(digest))
                {
                    *loaded = true;
                }
            }
            Event::Finished { worker, job } => {
                self.answered(*worker, *job)?;
                finished = Some(*job);
            }
            Event::Cancelled { worker, job } => self.answered(*worker, *job)?,
            Event::ForgotReplica { worker, job } => {
                self.answered(*worker, *job)?;
                if let Some(known) = self.workers.get_mut(worker) {
                    known.replicas.retain(|_, loaded| !*loaded);
                }
            }
            Event::Failed { .. } | Event::Refused { .. } => {
                return Err("a worker failed at a job, and none is broken".into());
            }
            // Nothing is too large; but a worker may have been lost too often while it was given a replica.
            Event::ReplicaRefused { worker, digest } => {
                if let Some(known) = self.workers.get_mut(worker) {
                    known.replicas.remove(digest);
                }
            }
            Event::GaveUpOnRefused => return Err("jobs were given up, and all can be done".into()),
            Event::Withdrawn { .. } => return Err("jobs were withdrawn, and all are wanted".into()),
            Event::RoomChanged { worker, jobs } => {
                if let Some(known) = self.workers.get_mut(worker) {
                    known.room = *jobs;
                }
            }
            Event::PassEnded { from, digest, outcome, .. } => {
                self.counts.passed += u64::from(*outcome == PassOutcome::Done);
                if *outcome == PassOutcome::NotHeld
                    && let Some(known) = self.workers.get_mut(from)
                    && known.replicas.get(digest) == Some(&true)
                {
                    known.replicas.remove(digest);
                }
            }
            Event::PassesReplicas { .. }
            | Event::ReplicaLate { .. }
            | Event::Announced { .. }
            | Event::Released { .. }
            | Event::Tick => {}
        }
        let mut is_delivered = false;
        for action in actions {
            match action {
                Action::LoadReplica { worker, digest } => {
                    let known = self.known(*worker)?;
                    let was_passed = known.passed.remove(digest);
                    let before = known.replicas.insert(*digest, false);
                    ensure(before.is_none() || before == Some(false) && was_passed, || {
                        format!("{digest} loaded twice")
                    })?;
                }
                Action::PassReplica { from, worker, digest } => {
                    let holds = self.known(*from)?.replicas.get(digest) == Some(&true);
                    ensure(holds, || format!("{from:?} is to pass {digest} on, and does not hold it"))?;
                    let known = self.known(*worker)?;
                    known.passed.insert(*digest);
                    ensure(known.replicas.insert(*digest, false).is_none(), || {
                        format!("{digest} passed on twice")
                    })?;
                }
                Action::ReleaseReplica { worker, digest } => {
                    let known = self.known(*worker)?;
                    ensure(known.replicas.remove(digest).is_some(), || {
                        format!("{digest} released, and not there")
                    })?;
                }
                Action::Send { worker, job } => self.send(*worker, *job)?,
                Action::Deliver { job } => {
                    is_delivered = true;
                    ensure(finished == Some(*job), || format!("{job:?} delivered without an answer"))?;
                    ensure(self.submitted.contains(job), || format!("{job:?} delivered unasked"))?;
                    ensure(self.delivered.insert(*job), || format!("{job:?} delivered twice"))?;
                }
                Action::Abandon { job, why } => return Err(format!("{job:?} abandoned: {why}")),
                Action::Cancel { worker, job } => {
                    self.counts.cancelled += 1;
                    let known = self.known(*worker)?;
                    ensure(known.under_way.contains(job), || format!("{job:?} cancelled where it is not"))?;
                }
            }
        }
        self.counts.late += u64::from(finished.is_some() && !is_delivered);
        ensure(finished.is_none_or(|job| self.delivered.contains(&job)), || "an answer got lost".into())
    }

    fn known(&mut self, worker: WorkerId) -> Result<&mut Known, String> {
        self.workers.get_mut(&worker).ok_or_else(|| format!("an action for {worker:?}, which is not there"))
    }

    /// A worker answers each job that it was sent, once.
    fn answered(&mut self, worker: WorkerId, job: JobId) -> Result<(), String> {
        let was_held = self.known(worker)?.under_way.remove(&job);
        ensure(was_held, || format!("{worker:?} answers {job:?}, which it does not hold"))
    }

    fn send(&mut self, worker: WorkerId, job: JobId) -> Result<(), String> {
        ensure(self.submitted.contains(&job), || format!("{job:?} sent unasked"))?;
        ensure(!self.delivered.contains(&job), || format!("{job:?} sent although it is delivered"))?;
        self.counts.sent_again += u64::from(!self.sent.insert(job));
        let known = self.known(worker)?;
        ensure(known.under_way.insert(job), || format!("{job:?} sent twice to {worker:?}"))?;
        let most = known.room.max(MOST_JOBS_PER_THREAD * (known.threads + 1));
        let held = known.under_way.len();
        ensure(held <= most, || format!("{worker:?} holds {held} jobs"))?;
        let holders = self.workers.values().filter(|known| known.under_way.contains(&job)).count();
        ensure(holders <= MOST_HOLDERS, || format!("{job:?} is with {holders} workers"))
    }
}
