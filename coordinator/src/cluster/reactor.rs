//! The one task that owns the scheduler: turns messages into its events, and carries out its actions.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::time::Duration;

use shared::protocol::FailureReason;
use shared::replica::{Digest, EncodedReplica};
use shared::row::RowRequest;
use tokio::sync::mpsc;

use super::connect::Connection;
use super::session::{self, Answer, Command, News};
use super::{ClusterError, FinishedJob, WorkerSummary};
use crate::scheduler::{Action, Event, JobId, Scheduler, WorkerId};

/// What the reactor is told.
pub(super) enum Message {
    /// A replica that jobs may need from now on.
    Publish(EncodedReplica),
    /// A replica that no job needs any more.
    Release(Digest),
    /// More jobs.
    Submit(Vec<(JobId, RowRequest)>),
    /// What did each worker do?
    Summarise(Sender<Vec<WorkerSummary>>),
    /// Say goodbye to all workers; the sender is dropped when all have answered.
    Shutdown(Sender<()>),
    /// From a session.
    News(WorkerId, News),
}

pub(super) struct Reactor {
    scheduler: Scheduler,
    replicas: HashMap<Digest, EncodedReplica>,
    requests: HashMap<JobId, Arc<RowRequest>>,
    sessions: BTreeMap<WorkerId, mpsc::UnboundedSender<Command>>,
    summaries: BTreeMap<WorkerId, WorkerSummary>,
    results: Sender<Result<FinishedJob, ClusterError>>,
    /// Held from the order to shut down until the last session is over.
    shutdown: Option<Sender<()>>,
}

impl Reactor {
    /// Takes over these connections. Results of jobs go to `results`.
    pub(super) fn start(
        connections: Vec<Connection>,
        results: Sender<Result<FinishedJob, ClusterError>>,
    ) -> mpsc::UnboundedSender<Message> {
        let (messages, inbox) = mpsc::unbounded_channel();
        let mut reactor = Self {
            scheduler: Scheduler::new(),
            replicas: HashMap::new(),
            requests: HashMap::new(),
            sessions: BTreeMap::new(),
            summaries: BTreeMap::new(),
            results,
            shutdown: None,
        };
        for (worker, connection) in (0..).map(WorkerId).zip(connections) {
            reactor.connect(worker, connection, messages.clone());
        }
        tokio::spawn(reactor.run(inbox));
        messages
    }

    fn connect(&mut self, worker: WorkerId, connection: Connection, news: mpsc::UnboundedSender<Message>) {
        let (hello, address) = (&connection.hello, &connection.address);
        let threads = hello.threads as usize;
        tracing::info!(worker = hello.name, address, threads, version = hello.software_version, "connected");
        self.summaries.insert(worker, WorkerSummary::new(hello.name.clone(), address.clone(), threads));
        let (commands, inbox) = mpsc::unbounded_channel();
        self.sessions.insert(worker, commands);
        tokio::spawn(session::run(connection, inbox, move |told| {
            // The reactor ends before its sessions only when the whole runtime does.
            let _ = news.send(Message::News(worker, told));
        }));
        self.on(Event::WorkerConnected { worker, threads });
    }

    async fn run(mut self, mut inbox: mpsc::UnboundedReceiver<Message>) {
        while let Some(message) = inbox.recv().await {
            match message {
                Message::Publish(replica) => {
                    self.replicas.insert(replica.digest, replica);
                }
                Message::Release(digest) => {
                    self.replicas.remove(&digest);
                    self.on(Event::Released { digest });
                }
                Message::Submit(requests) => {
                    let needs = |request: &RowRequest| vec![request.scene, request.receivers];
                    let jobs = requests.iter().map(|(job, request)| (*job, needs(request))).collect();
                    self.requests.extend(requests.into_iter().map(|(job, request)| (job, Arc::new(request))));
                    self.on(Event::Submitted { jobs });
                }
                Message::Summarise(reply) => {
                    // Whoever asked may have left.
                    let _ = reply.send(self.summaries.values().cloned().collect());
                }
                Message::Shutdown(done) => {
                    for worker in self.sessions.keys() {
                        self.command(*worker, Command::Goodbye);
                    }
                    self.shutdown = Some(done);
                }
                Message::News(worker, news) => self.hear(worker, news),
            }
            if self.shutdown.is_some() && self.sessions.is_empty() {
                return;
            }
        }
    }

    fn hear(&mut self, worker: WorkerId, news: News) {
        match news {
            News::Loaded(digest) => self.on(Event::ReplicaLoaded { worker, digest }),
            News::Finished(answer) => self.finish(worker, answer),
            News::Failed { job, reason, message } => {
                let event = match reason {
                    FailureReason::UnknownReplica => Event::ForgotReplica { worker, job },
                    FailureReason::InvalidJob => Event::Refused { worker, job },
                    FailureReason::Internal | FailureReason::Unspecified => {
                        let name = &self.summaries[&worker].name;
                        tracing::warn!(worker = name, %job, message, "a job failed");
                        Event::Failed { worker, job }
                    }
                };
                let actions = self.scheduler.handle(event);
                self.carry_out(actions, &message);
            }
            News::Lost(reason) => {
                self.sessions.remove(&worker);
                if self.shutdown.is_some() {
                    return;
                }
                if let Some(summary) = self.summaries.get_mut(&worker) {
                    tracing::warn!(worker = summary.name, address = summary.address, %reason, "lost a worker");
                    summary.lost = Some(reason.to_string());
                }
                self.on(Event::WorkerLost { worker });
            }
        }
    }

    fn finish(&mut self, worker: WorkerId, answer: Answer) {
        let Answer { job, rows, statistics, bytes } = answer;
        let actions = self.scheduler.handle(Event::Finished { worker, job });
        if actions.contains(&Action::Deliver { job }) {
            if let Some(summary) = self.summaries.get_mut(&worker) {
                summary.jobs += 1;
                summary.rows += rows.len() as u64;
                for statistics in &statistics {
                    summary.rays += statistics.rays;
                    summary.busy += Duration::from_nanos(statistics.busy_nanoseconds);
                }
                summary.bytes_received += bytes;
            }
            self.requests.remove(&job);
            self.report(Ok(FinishedJob { job, rows, statistics }));
        }
        self.carry_out(actions, "");
    }

    fn on(&mut self, event: Event) {
        let actions = self.scheduler.handle(event);
        self.carry_out(actions, "");
    }

    /// Does what the scheduler wants; `message` is what a worker said about the job that failed.
    fn carry_out(&mut self, actions: Vec<Action>, message: &str) {
        for action in actions {
            match action {
                Action::LoadReplica { worker, digest } => match self.replicas.get(&digest) {
                    Some(replica) => self.command(worker, Command::Load(replica.clone())),
                    None => self.report(Err(ClusterError::NotPublished(digest))),
                },
                Action::ReleaseReplica { worker, digest } => self.command(worker, Command::Release(digest)),
                Action::Send { worker, job } => {
                    if let Some(request) = self.requests.get(&job) {
                        self.command(worker, Command::Job(job, Arc::clone(request)));
                    }
                }
                // Where the answer is.
                Action::Deliver { .. } => {}
                Action::Abandon { job, why } => {
                    self.requests.remove(&job);
                    self.report(Err(ClusterError::Abandoned { job, why, message: message.into() }));
                }
                Action::AllWorkersLost => {
                    let reason = |worker: &WorkerSummary| {
                        format!("worker at {}: {}", worker.address, worker.lost.as_deref().unwrap_or("lost"))
                    };
                    let reasons = self.summaries.values().map(reason).collect();
                    self.report(Err(ClusterError::AllWorkersLost { reasons }));
                }
            }
        }
    }

    fn command(&self, worker: WorkerId, command: Command) {
        if let Some(session) = self.sessions.get(&worker) {
            // A session that is over has told so, and its jobs come back with that news.
            let _ = session.send(command);
        }
    }

    fn report(&self, result: Result<FinishedJob, ClusterError>) {
        // A driver that left needs no results.
        let _ = self.results.send(result);
    }
}
