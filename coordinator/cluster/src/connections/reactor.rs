//! The task that owns the scheduler: turns messages into its events and carries out its actions.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;

use kernel::replica::Digest;
use protocol::worker::FailureReason;
use tokio::sync::{mpsc, oneshot};
use tokio::time::{Instant, Interval, interval, sleep_until};
use tokio_util::sync::CancellationToken;

use super::accounts::Accounts;
use super::answer::Checked;
use super::distance::Distances;
use super::error::ClusterError;
use super::ledger::{Ledger, Threads};
use super::members::Members;
use super::message::{Joined, Message};
use super::passing::Passing;
use super::refusals::Refusals;
use super::request::Request;
use super::session::{Command, LostWorkerReason, News};
use super::settings::{ClusterSettings, Schedule};
use super::summary::{ClusterCounts, Delivery};
use super::upload::Published;
use super::waiting::{Ready, Waiting};
use crate::scheduler::{Abandonment, Action, Event, JobId, PassOutcome, Policy, Scheduler, WorkerId};

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
                self.replicas.insert(replica.digest, Arc::new(Published::new(replica)));
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

    fn join(&mut self, Joined { worker, address, hello, peer, commands, bytes_sent }: Joined) {
        let threads = hello.threads as usize;
        tracing::info!(worker = hello.name, address, threads, version = hello.software_version, "connected");
        self.waiting.came(&address);
        self.refusals.joined(worker, hello.largest_replica);
        if self.accounts.open(worker, hello.name, address, threads, bytes_sent) {
            self.settings.metrics.came_back();
        }
        if self.shutdown.is_some() {
            // It came too late: without commands its session ends.
            return;
        }
        self.sessions.insert(worker, commands);
        self.connected.workers.fetch_add(1, Relaxed);
        self.connected.threads.fetch_add(threads, Relaxed);
        self.distances.joined(worker, threads);
        if let Some(peer) = peer {
            self.passing.joined(worker, peer);
            self.on(Event::PassesReplicas { worker });
        }
        self.on(Event::WorkerConnected { worker, threads });
        self.look_round();
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

    fn hear(&mut self, worker: WorkerId, news: News) {
        match news {
            News::Loaded(digest) => {
                self.refusals.arrived(worker, self.accounts.address(worker), digest);
                self.passing.arrived(worker, digest);
                self.on(Event::ReplicaLoaded { worker, digest });
            }
            News::Passed { digest, to, outcome, message } => {
                if outcome == PassOutcome::Failed {
                    let from = self.accounts.name(worker);
                    tracing::debug!(worker = from, replica = %digest, message, "a replica was not passed on");
                }
                self.on(Event::PassEnded { from: worker, worker: to, digest, outcome });
            }
            News::Refused { digest, message } => self.refuse(worker, digest, message),
            News::Finished(answer) => self.finish(worker, answer),
            News::Failed { job, reason, message } => {
                // There is nothing to compare with any more.
                self.delivered.remove(&job);
                let event = match reason {
                    FailureReason::UnknownReplica => Event::ForgotReplica { worker, job },
                    FailureReason::InvalidJob => Event::Refused { worker, job },
                    FailureReason::Cancelled => Event::Cancelled { worker, job },
                    FailureReason::Internal | FailureReason::Unspecified => {
                        tracing::warn!(worker = self.accounts.name(worker), %job, message, "a job failed");
                        Event::Failed { worker, job }
                    }
                };
                let actions = self.observer.decide(&mut self.scheduler, event);
                self.carry_out(actions, &message);
            }
            News::RoundTrip(time) => {
                if let Some(jobs) = self.distances.answered_after(worker, time) {
                    self.hold(worker, jobs);
                }
            }
            News::Lost(reason) => self.lose(worker, &reason),
        }
    }

    /// A worker may hold this many jobs.
    fn hold(&mut self, worker: WorkerId, jobs: usize) {
        self.connected.ahead.store(self.distances.ahead(), Relaxed);
        self.on(Event::RoomChanged { worker, jobs });
    }

    fn lose(&mut self, worker: WorkerId, reason: &LostWorkerReason) {
        if self.sessions.remove(&worker).is_some() {
            self.connected.workers.fetch_sub(1, Relaxed);
            self.connected.threads.fetch_sub(self.accounts.threads(worker), Relaxed);
        }
        self.distances.lost(worker);
        self.connected.ahead.store(self.distances.ahead(), Relaxed);
        self.delivered.retain(|_, delivered| delivered.holder != worker);
        self.refusals.lost(worker, self.accounts.address(worker), reason.is_orderly());
        self.passing.lost(worker);
        if self.shutdown.is_some() {
            self.accounts.close(worker);
            return;
        }
        self.settings.metrics.lost(reason.is_orderly());
        let (name, address) = self.accounts.lose(worker, reason.to_string(), reason.is_orderly());
        if reason.is_fault() {
            let again = match self.settings.forgives {
                Some(pause) => format!("it is asked again in {} s", pause.as_secs()),
                None => "it is not asked again".into(),
            };
            tracing::warn!(worker = name, address, %reason, "lost a worker: {again}");
        } else {
            tracing::warn!(worker = name, address, %reason, "lost a worker");
        }
        if self.sessions.is_empty() && self.waiting.is_alone() {
            tracing::warn!(seconds = self.settings.grace.as_secs_f64(), "no worker is left: waiting for one");
        }
        let event = Event::WorkerLost { worker, orderly: reason.is_orderly() };
        let actions = self.observer.decide(&mut self.scheduler, event);
        self.carry_out(actions, &format!("worker {name} was lost: {reason}"));
        self.look_round();
    }

    /// A worker does not take a replica: others may.
    fn refuse(&mut self, worker: WorkerId, digest: Digest, message: String) {
        tracing::warn!(worker = self.accounts.name(worker), message, "a worker does not take a replica");
        self.refusals.refused(worker, digest, message);
        self.on(Event::ReplicaRefused { worker, digest });
    }

    fn finish(&mut self, worker: WorkerId, Checked { work, digest, bytes }: Checked) {
        let job = work.job();
        if let Some(jobs) = self.distances.computed(worker, work.busy()) {
            self.hold(worker, jobs);
        }
        let actions = self.observer.decide(&mut self.scheduler, Event::Finished { worker, job });
        let is_first = actions.contains(&Action::Deliver { job });
        self.accounts.count(worker, is_first, &work, bytes);
        self.connected.ledger.computed(work.busy());
        self.settings.metrics.answered(is_first, work.rows(), work.rays(), work.busy(), bytes);
        if is_first {
            let holder = actions.iter().find_map(|action| match action {
                Action::Cancel { worker, job: cancelled } if *cancelled == job => Some(*worker),
                _ => None,
            });
            if let Some(holder) = holder {
                self.delivered.insert(job, Delivered { digest, by: worker, holder });
            }
            self.requests.remove(&job);
            let by = self.accounts.who(worker);
            self.report(Ok(Delivery { work, by, bytes }));
        } else if let Some(first) = self.delivered.remove(&job) {
            self.accounts.count_late(worker);
            if first.digest != digest {
                tracing::error!(
                    %job,
                    first = self.accounts.name(first.by),
                    second = self.accounts.name(worker),
                    "two workers gave different answers to the same job: one of them is broken, and the output is in doubt"
                );
            }
        }
        self.carry_out(actions, "");
    }

    fn on(&mut self, event: Event) {
        let actions = self.observer.decide(&mut self.scheduler, event);
        self.carry_out(actions, "");
    }

    /// Carries out actions. `message` is the worker's, about a job that failed.
    fn carry_out(&mut self, actions: Vec<Action>, message: &str) {
        let mut refused = vec![];
        for action in actions {
            match action {
                Action::LoadReplica { worker, digest } => {
                    refused.extend(self.load(worker, digest, None));
                }
                Action::PassReplica { from, worker, digest } => {
                    refused.extend(self.load(worker, digest, Some(from)));
                }
                Action::ReleaseReplica { worker, digest } => self.command(worker, Command::Release(digest)),
                Action::Send { worker, job } => {
                    if let Some(request) = self.requests.get(&job) {
                        self.command(worker, Command::Job(job, Arc::clone(request)));
                    }
                }
                Action::Cancel { worker, job } => self.command(worker, Command::Cancel(job)),
                // Done where the answer is.
                Action::Deliver { .. } => {}
                Action::Abandon { job, why } => {
                    let request = self.requests.remove(&job);
                    let message = match (why, request) {
                        (Abandonment::ReplicaRefused, Some(request)) => {
                            self.refusals.reason(&request.needs())
                        }
                        _ => message.into(),
                    };
                    self.report(Err(ClusterError::Abandoned { job, why, message }));
                }
            }
        }
        for (worker, digest, message) in refused {
            self.refuse(worker, digest, message);
        }
    }

    /// Has a replica loaded to a worker, by another one or from here. Returns why it is not to be, if so.
    fn load(
        &mut self,
        worker: WorkerId,
        digest: Digest,
        from: Option<WorkerId>,
    ) -> Option<(WorkerId, Digest, String)> {
        let Some(replica) = self.replicas.get(&digest).map(Arc::clone) else {
            self.report(Err(ClusterError::NotPublished(digest)));
            return None;
        };
        let place = (self.accounts.name(worker), self.accounts.address(worker));
        if let Err(message) = self.refusals.sends(worker, place, &replica.replica) {
            return Some((worker, digest, message));
        }
        self.passing.begins(worker, digest, replica.replica.bytes.len() as u64);
        match from.zip(self.passing.peer(worker)) {
            Some((from, peer)) => {
                let peer = peer.clone();
                self.command(from, Command::Pass { digest, to: worker, peer });
            }
            None => self.command(worker, Command::Load(replica)),
        }
        None
    }

    fn command(&self, worker: WorkerId, command: Command) {
        if let Some(session) = self.sessions.get(&worker) {
            // A session that is over has told so, and its jobs come back with that news.
            let _ = session.send(command);
        }
    }

    fn report(&self, result: Result) {
        // A caller that left needs no results.
        let _ = self.results.send(result);
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
