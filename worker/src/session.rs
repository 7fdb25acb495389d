//! One session: a coordinator's messages in, answers out.

use std::collections::HashMap;
use std::time::Duration;

use kernel::replica::Digest;
use kernel::row::ROW_VERSION;
use kernel::visibility::Stop;
use protocol::telemetry::Held;
use protocol::worker::coordinator_message::Body as Incoming;
use protocol::worker::worker_message::Body as Outgoing;
use protocol::worker::{
    CancelJob, CoordinatorHello, CoordinatorMessage, Goodbye, KeepAlive, PROTOCOL_VERSION, ReplicaHeld,
    ReplicaPassed, WorkerHello, WorkerMessage, check_versions,
};
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;
use tonic::{Status, Streaming};

use crate::job::{Job, JobError, answer};
use crate::shared::Shared;
use crate::tile::Tile;

/// Jobs of one session that may be under way for each thread: more are left in the network until some are answered. Far
/// above what a coordinator that shares work out sends ahead.
const JOBS_PER_THREAD: usize = 64;

/// Replicas of one session that may be passed on at the same time: far above what a coordinator asks for.
const MOST_PASSES: usize = 64;

/// How long a coordinator may take to say hello.
const HELLO: Duration = Duration::from_secs(10);

type Outbound = mpsc::Sender<Result<WorkerMessage, Status>>;

/// Answers a coordinator until one side says goodbye, the coordinator leaves, or the worker shuts down.
///
/// # Errors
/// A status for the coordinator, when it breaks the protocol or its connection is lost.
pub(crate) async fn run(
    worker: &Shared,
    inbound: Streaming<CoordinatorMessage>,
    outbound: &Outbound,
) -> Result<(), Status> {
    let session = Session {
        worker,
        outbound,
        // Jobs still queued when the session ends are not worth computing.
        abandoned: worker.shutdown.child_token(),
        over: CancellationToken::new(),
        jobs: JoinSet::new(),
        unanswered: HashMap::new(),
    };
    let _counted = Held::new(&worker.settings.metrics.sessions);
    let _guards = [&session.abandoned, &session.over].map(|token| token.clone().drop_guard());
    session.converse(inbound).await
}

struct Session<'a> {
    worker: &'a Shared,
    outbound: &'a Outbound,
    /// Jobs that see it cancelled before they start are handed back.
    abandoned: CancellationToken,
    /// Jobs that are being computed when it is cancelled end: nobody is there to be answered.
    over: CancellationToken,
    /// Each gives the answer to a job, or nothing where it was handed back.
    jobs: JoinSet<(u64, Option<Outgoing>)>,
    /// Cancels each of these jobs, as long as it is not begun.
    unanswered: HashMap<u64, CancellationToken>,
}

impl Session<'_> {
    async fn converse(mut self, mut inbound: Streaming<CoordinatorMessage>) -> Result<(), Status> {
        let settings = &self.worker.settings;
        let mut arrivals = self.worker.arrivals.subscribe();
        let mut passes = JoinSet::new();
        let largest_replica = self.worker.store().largest();
        self.send(Outgoing::Hello(WorkerHello {
            protocol_version: PROTOCOL_VERSION,
            threads: settings.threads.get() as u32,
            name: settings.name.clone(),
            software_version: env!("CARGO_PKG_VERSION").into(),
            instance: settings.instance,
            row_version: ROW_VERSION,
            largest_replica,
            passes_replicas: settings.passing.is_some(),
        }))
        .await?;
        let hello = timeout(HELLO, inbound.message()).await;
        greet(hello.map_err(|_| Status::deadline_exceeded("the coordinator says no hello"))??)?;

        let most_jobs = settings.threads.get() * JOBS_PER_THREAD;
        let mut leaving = None;
        let mut listening = true;
        loop {
            if let Some(reason) = leaving
                && self.jobs.is_empty()
            {
                return self.send(Outgoing::Goodbye(Goodbye { reason: String::from(reason) })).await;
            }
            tokio::select! {
                Some(job) = self.jobs.join_next() => {
                    // The tasks only wait for the pool, which catches panics.
                    let (id, answer) = job.map_err(|error| Status::internal(error.to_string()))?;
                    self.unanswered.remove(&id);
                    if let Some(answer) = answer {
                        settings.metrics.count(&answer);
                        self.send(answer).await?;
                    }
                }
                Some(passed) = passes.join_next() => {
                    let passed: ReplicaPassed = passed.map_err(|error| Status::internal(error.to_string()))?;
                    settings.metrics.pass_ended(passed.outcome());
                    self.send(Outgoing::Passed(passed)).await?;
                }
                arrived = arrivals.recv() => {
                    // What this session has missed, the coordinator sends itself.
                    if let Ok(digest) = arrived {
                        self.send(Outgoing::Held(ReplicaHeld { digest: digest.to_bytes() })).await?;
                    }
                }
                message = inbound.message(), if listening && self.jobs.len() < most_jobs => {
                    match message?.map(|message| message.body) {
                        Some(Some(Incoming::Job(_) | Incoming::Tile(_))) if leaving.is_some() => {}
                        Some(Some(Incoming::Job(job))) => {
                            let rows = Job::new(&job, &mut self.worker.store());
                            self.start(job.job_id, rows, |rows, stop| rows.compute_until(stop).map(Outgoing::Finished));
                        }
                        Some(Some(Incoming::Tile(job))) => {
                            let tile = Tile::new(&job, &mut self.worker.store());
                            self.start(job.job_id, tile, |tile, _| Some(Outgoing::Tile(tile.compute())));
                        }
                        Some(Some(Incoming::Cancel(CancelJob { job_id }))) => {
                            // Answered already: the answer and the cancel crossed.
                            if let Some(job) = self.unanswered.get(&job_id) {
                                job.cancel();
                            }
                        }
                        Some(Some(Incoming::KeepAlive(KeepAlive { number, .. }))) => {
                            let uploaded = self.worker.uploads.progress();
                            self.send(Outgoing::KeepAlive(KeepAlive { number, uploaded })).await?;
                        }
                        Some(Some(Incoming::Release(release))) => {
                            let digest = Digest::try_from(release.digest.as_ref())
                                .map_err(|error| Status::invalid_argument(error.to_string()))?;
                            self.worker.change_store(|store| store.remove(digest));
                        }
                        Some(Some(Incoming::Pass(order))) => {
                            let digest = Digest::try_from(order.digest.as_ref())
                                .map_err(|error| Status::invalid_argument(error.to_string()))?;
                            let Some(passing) = settings.passing.clone().filter(|_| passes.len() < MOST_PASSES)
                            else {
                                return Err(Status::invalid_argument("more replicas to pass on than it may be asked for"));
                            };
                            passes.spawn(passing.pass(order, self.worker.store().parcel(digest)));
                        }
                        Some(Some(Incoming::Goodbye(_))) => leaving = Some("as the coordinator wishes"),
                        Some(Some(Incoming::Hello(_)) | None) => {
                            return Err(Status::invalid_argument("a second hello, or an unknown message"));
                        }
                        // After a goodbye the coordinator may close its half and still wait for answers.
                        None if leaving.is_some() => listening = false,
                        None => return Ok(()),
                    }
                }
                () = self.worker.shutdown.cancelled(), if leaving.is_none() => {
                    leaving = Some("the worker was told to stop");
                }
            }
        }
    }

    /// Takes a job in; its answer comes out of [`Self::jobs`].
    fn start<J: Send + 'static>(
        &mut self,
        id: u64,
        job: Result<J, JobError>,
        compute: fn(&J, Stop) -> Option<Outgoing>,
    ) {
        let job = match job {
            Ok(job) => job,
            Err(error) => {
                self.jobs.spawn(async move { (id, Some(answer(id, Err(error)))) });
                return;
            }
        };
        let abandoned = self.abandoned.clone();
        let cancelled = abandoned.child_token();
        let over = self.over.clone();
        self.unanswered.insert(id, cancelled.clone());
        let pool = self.worker.pool.clone();
        let metrics = self.worker.settings.metrics.clone();
        let queued = Held::new(&metrics.jobs_queued);
        let work = move || {
            drop(queued);
            let _counted = Held::new(&metrics.jobs_computing);
            if cancelled.is_cancelled() { None } else { compute(&job, &|| over.is_cancelled()) }
        };
        self.jobs.spawn(async move {
            let computed = pool.run(work).await;
            let result = match computed {
                Ok(Some(answer)) => Ok(answer),
                Ok(None) if abandoned.is_cancelled() => return (id, None),
                Ok(None) => Err(JobError::Cancelled),
                Err(panicked) => Err(panicked.into()),
            };
            (id, Some(answer(id, result)))
        });
    }

    async fn send(&self, body: Outgoing) -> Result<(), Status> {
        let message = WorkerMessage { body: Some(body) };
        self.outbound.send(Ok(message)).await.map_err(|_| Status::cancelled("the coordinator is gone"))
    }
}

/// Checks the coordinator's first message.
fn greet(message: Option<CoordinatorMessage>) -> Result<(), Status> {
    let Some(Incoming::Hello(CoordinatorHello { protocol_version, name, row_version })) =
        message.and_then(|message| message.body)
    else {
        return Err(Status::failed_precondition("the first message of a session is a hello"));
    };
    check_versions("worker", protocol_version, row_version)
        .map_err(|mismatch| Status::failed_precondition(format!("coordinator {name} {mismatch}")))?;
    tracing::info!(coordinator = name, "session open");
    Ok(())
}
