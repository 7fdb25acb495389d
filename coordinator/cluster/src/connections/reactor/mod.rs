//! The task that owns the scheduler: turns messages into its events and carries out its actions.
//!
//! | file | what it does |
//! |---|---|
//! | `workers` | what comes from workers, to events |
//! | `actions` | what the scheduler decides, to commands and results |

mod actions;
mod workers;

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;

use kernel::replica::Digest;
use protocol::worker::ReplicaKind;
use tokio::sync::{mpsc, oneshot};
use tokio::time::{Instant, Interval, interval, sleep_until};
use tokio_util::sync::CancellationToken;

use super::accounts::Accounts;
use super::distance::Distances;
use super::error::ClusterError;
use super::ledger::{Ledger, Threads};
use super::members::Members;
use super::message::Message;
use super::passing::Passing;
use super::refusals::Refusals;
use super::request::Request;
use super::session::Command;
use super::settings::{ClusterSettings, Schedule};
use super::summary::{ClusterCounts, Delivery};
use super::upload::Published;
use super::waiting::{Ready, Waiting};
use crate::scheduler::{Action, Event, JobId, Policy, Scheduler, WorkerId};

pub(super) type Result = std::result::Result<Delivery, ClusterError>;

/// The workers that are connected now.
#[derive(Debug, Default)]
pub(super) struct Connected {
    /// Number of workers.
    pub(super) workers: AtomicUsize,
    /// Number of jobs that they compute at the same time.
    pub(super) threads: AtomicUsize,
    /// Number of jobs that those far away hold beyond what others of their threads do.
    pub(super) ahead: AtomicUsize,
    /// What the threads did so far.
    pub(super) ledger: Ledger,
}

/// Observes the decisions of a reactor's scheduler. `()` observes nothing, at no cost; simulations check.
pub(crate) trait ReactorObserver: Send + 'static {
    /// Hands an event to the scheduler and returns its actions.
    fn decide(&mut self, scheduler: &mut Scheduler, event: Event) -> Vec<Action> {
        scheduler.handle(event)
    }

    /// Sees the scheduler before its first event.
    fn begin(&mut self, _scheduler: &mut Scheduler) {}

    /// Takes the numbers of requests, sessions, and digests of answers that may come twice, between two messages.
    fn held(&mut self, _requests: usize, _sessions: usize, _delivered: usize) {}
}

impl ReactorObserver for () {}

pub(super) struct Reactor<O> {
    observer: O,
    settings: ClusterSettings,
    members: Arc<Members>,
    scheduler: Scheduler,
    replicas: HashMap<Digest, Arc<Published>>,
    requests: HashMap<JobId, Arc<Request>>,
    sessions: BTreeMap<WorkerId, mpsc::UnboundedSender<Command>>,
    accounts: Accounts,
    distances: Distances,
    refusals: Refusals,
    passing: Passing,
    /// Answers that were delivered, of jobs that another worker holds too, until it has answered or is lost.
    delivered: HashMap<JobId, Delivered>,
    /// Counts the sessions.
    connected: Arc<Connected>,
    results: mpsc::UnboundedSender<Result>,
    waiting: Waiting,
    /// Held from the order to shut down until the last session is over.
    shutdown: Option<oneshot::Sender<()>>,
}

/// The first answer to a job.
struct Delivered {
    /// Of its content.
    digest: Digest,
    /// The worker that sent it.
    by: WorkerId,
    /// The worker that holds the job too.
    holder: WorkerId,
}

impl<O: ReactorObserver> Reactor<O> {
    /// A reactor that waits for workers from this number of names. Results of jobs go to `results`.
    pub(super) fn new(
        mut observer: O,
        settings: ClusterSettings,
        members: Arc<Members>,
        names: usize,
        results: mpsc::UnboundedSender<Result>,
        connected: Arc<Connected>,
        ready: Ready,
    ) -> Self {
        let policy = match settings.schedule {
            Schedule::Finished => Policy::Finished,
            Schedule::Periodic { .. } => Policy::Periodic,
        };
        let mut scheduler = Scheduler::new(policy);
        observer.begin(&mut scheduler);
        Self {
            observer,
            settings,
            members,
            scheduler,
            replicas: HashMap::new(),
            requests: HashMap::new(),
            sessions: BTreeMap::new(),
            connected,
            accounts: Accounts::default(),
            distances: Distances::default(),
            refusals: Refusals::default(),
            passing: Passing::default(),
            delivered: HashMap::new(),
            results,
            waiting: Waiting::new(names, ready),
            shutdown: None,
        }
    }

    /// Works until it is told to shut down and the last session is over, or `leaving` is cancelled.
    pub(super) async fn run(
        mut self,
        mut inbox: mpsc::UnboundedReceiver<Message>,
        leaving: CancellationToken,
    ) {
        let mut timer: Option<Interval> = match self.settings.schedule {
            Schedule::Finished => None,
            Schedule::Periodic { period } => Some(interval(period)),
        };
        loop {
            let grace_ends = self.waiting.ends(self.settings.grace);
            let begins = self.waiting.begins();
            let refusals_end = self.refusals.ends();
            let late = self.passing.next_late();
            tokio::select! {
                message = inbox.recv() => match message {
                    Some(message) => self.take(message),
                    None => return,
                },
                () = sleep_until(grace_ends.unwrap_or_else(Instant::now)), if grace_ends.is_some() => {
                    self.end_grace();
                }
                () = sleep_until(begins.unwrap_or_else(Instant::now)), if begins.is_some() => {
                    self.waiting.begin(!self.sessions.is_empty());
                }
                () = sleep_until(refusals_end.unwrap_or_else(Instant::now)), if refusals_end.is_some() => {
                    self.on(Event::GaveUpOnRefused);
                }
                () = sleep_until(late.unwrap_or_else(Instant::now)), if late.is_some() => {
                    if let Some((worker, digest)) = self.passing.take_late() {
                        self.on(Event::ReplicaLate { worker, digest });
                    }
                }
                () = tick(&mut timer) => self.on(Event::Tick),
                // The caller left without a goodbye.
                () = leaving.cancelled(), if self.shutdown.is_none() => return,
            }
            self.refusals.wait(self.scheduler.has_refused_jobs());
            self.show();
            if self.shutdown.is_some() && self.sessions.is_empty() {
                return;
            }
            if self.shutdown.is_none() {
                self.observer.held(self.requests.len(), self.sessions.len(), self.delivered.len());
            }
        }
    }

    /// Shows what the scheduler holds and counted, and what the threads do.
    fn show(&self) {
        let (metrics, scheduler) = (&self.settings.metrics, &self.scheduler);
        metrics.unfinished(self.requests.len());
        metrics.scheduled(
            scheduler.duplicates_sent(),
            scheduler.duplicates_dropped(),
            scheduler.ignored_answers(),
        );
        self.connected.ledger.set(Threads {
            connected: self.connected.threads.load(Relaxed),
            occupied: scheduler.occupied_threads(),
            loading: scheduler.loading_threads(),
        });
    }

    fn take(&mut self, message: Message) {
        match message {
            Message::Publish(replica) => {
                let (digest, kind) = (replica.digest, replica.kind);
                self.replicas.insert(digest, Arc::new(Published::new(replica)));
                // Of receivers there may be fewer than workers.
                if kind == ReplicaKind::Scene {
                    self.on(Event::Announced { digest });
                }
            }
            Message::Release(digest) => {
                self.replicas.remove(&digest);
                self.refusals.released(digest);
                self.on(Event::Released { digest });
            }
            Message::Submit(requests) => {
                let jobs = requests.iter().map(|(job, request)| (*job, request.needs())).collect();
                self.requests.extend(requests.into_iter().map(|(job, request)| (job, Arc::new(request))));
                self.on(Event::Submitted { jobs });
            }
            Message::Withdraw(jobs) => self.withdraw(jobs),
            Message::Summarise(reply) => {
                let counts = ClusterCounts {
                    duplicates: self.scheduler.duplicates_sent(),
                    ignored_answers: self.scheduler.ignored_answers(),
                    lost_workers: self.accounts.losses(),
                    passed_replicas: self.scheduler.passed_replicas(),
                };
                // The caller may have left.
                let _ = reply.send((self.accounts.summaries(), counts));
            }
            Message::Shutdown(done) => {
                self.members.leave();
                for worker in self.sessions.keys() {
                    self.command(*worker, Command::Goodbye);
                }
                self.waiting.stop();
                self.shutdown = Some(done);
            }
            Message::Joined(joined) => self.join(joined),
            Message::News(worker, news) => self.hear(worker, news),
            Message::Failed { place, error } => self.waiting.not_reached(place, error),
            Message::Tried { name } => {
                self.waiting.tried(&name, &self.accounts);
                self.look_round();
            }
            Message::GaveUp => {
                self.waiting.gave_up();
                self.look_round();
            }
        }
    }

    fn withdraw(&mut self, jobs: Vec<JobId>) {
        for job in &jobs {
            self.requests.remove(job);
        }
        self.on(Event::Withdrawn { jobs });
    }

    /// Tells that the cluster is ready when it is, and gives up when no worker can come any more.
    fn look_round(&mut self) {
        if self.waiting.is_hopeless(!self.sessions.is_empty()) {
            self.end_grace();
        }
    }

    /// There was no worker for too long.
    fn end_grace(&mut self) {
        self.waiting.stop();
        if let Some(threads) = self.settings.fallback.take() {
            tracing::warn!(threads, "no worker came back in time: going on in this process");
            self.waiting.hope_for_one_more();
            self.members.embed(threads);
        } else if let Some(error) = self.waiting.fail(&self.accounts) {
            self.report(Err(error));
        }
    }
}

/// Waits for the timer to ring; for ever where there is none.
async fn tick(timer: &mut Option<Interval>) {
    match timer {
        Some(timer) => {
            timer.tick().await;
        }
        None => std::future::pending().await,
    }
}
