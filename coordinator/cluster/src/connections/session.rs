//! One worker's session: commands in, news out. Any failure ends it and is reported in one way, as the loss of the worker.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use kernel::replica::Digest;
use protocol::telemetry::Held;
use protocol::worker::coordinator_message::Body as Outgoing;
use protocol::worker::worker_message::Body as Incoming;
use protocol::worker::{
    CancelJob, CoordinatorMessage, FailureReason, Goodbye, JobFailed, PassReplica, ReleaseReplica,
    WorkerMessage,
};
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio::time::{Instant, MissedTickBehavior, interval};
use tonic::Status;

use super::answer::{Answer, Checked, check_tile};
use super::connect::{Connection, Peer};
use super::error::words;
use super::pulse::{KEEP_ALIVE, Lapse, Pulse};
use super::request::Request;
use super::upload::{Published, UploadFailure, pack, upload};
use crate::metrics::{Metrics, WorkerMetrics};
use crate::scheduler::{JobId, PassOutcome, WorkerId};

/// Jobs of more time than this are told of in the log: others may have waited for them.
const LONG_JOB: Duration = Duration::from_millis(500);

/// A command to a session.
pub(super) enum Command {
    /// Send a job.
    Job(JobId, Arc<Request>),
    /// Load a replica.
    Load(Arc<Published>),
    /// Have the worker pass a replica on.
    Pass {
        /// The replica.
        digest: Digest,
        /// Its destination.
        to: WorkerId,
        /// Where that is.
        peer: Peer,
    },
    /// Tell the worker that a job is not wanted any more.
    Cancel(JobId),
    /// Tell the worker that it may forget a replica.
    Release(Digest),
    /// No more jobs.
    Goodbye,
}

/// News from a session.
pub(super) enum News {
    /// A replica has arrived.
    Loaded(Digest),
    /// The worker does not take a replica.
    Refused {
        /// The replica.
        digest: Digest,
        /// The worker's words.
        message: String,
    },
    /// A replica that it was to pass on has gone, or not.
    Passed {
        /// The replica.
        digest: Digest,
        /// Its destination.
        to: WorkerId,
        /// How it went.
        outcome: PassOutcome,
        /// The worker's words.
        message: String,
    },
    /// A job is done.
    Finished(Checked),
    /// A job was not done.
    Failed {
        /// The job.
        job: JobId,
        /// Reason, which decides what happens next.
        reason: FailureReason,
        /// The worker's words.
        message: String,
    },
    /// A message to the worker and its answer took this long.
    RoundTrip(Duration),
    /// The session is over; no news follows.
    Lost(LostWorkerReason),
}

/// Why a worker is lost.
#[derive(Debug, thiserror::Error)]
pub(super) enum LostWorkerReason {
    #[error("it left: {0}")]
    Left(String),
    #[error("it closed the session")]
    Closed,
    #[error("the connection broke: {0}")]
    Broken(String),
    #[error("it is silent")]
    Silent,
    #[error("it answers no job")]
    Idle,
    #[error("an upload to it does not get on")]
    Stalled,
    #[error("it sends garbage: {0}")]
    Garbage(String),
    #[error("replica {0} could not be loaded: {1}")]
    Upload(Digest, UploadFailure),
    #[error("the coordinator leaves")]
    Leaving,
}

impl LostWorkerReason {
    /// Whether the worker drained and said goodbye: its jobs are not to blame.
    pub(super) fn is_orderly(&self) -> bool {
        matches!(self, Self::Left(_) | Self::Leaving)
    }

    /// Whether the worker is at fault, so that it is not dialled again.
    pub(super) fn is_fault(&self) -> bool {
        matches!(self, Self::Garbage(_) | Self::Upload(_, UploadFailure::Impossible(_)))
    }
}

impl From<Lapse> for LostWorkerReason {
    fn from(lapse: Lapse) -> Self {
        match lapse {
            Lapse::Silent => Self::Silent,
            Lapse::Idle => Self::Idle,
            Lapse::Stalled => Self::Stalled,
        }
    }
}

/// Where a session counts.
pub(super) struct SessionMetrics {
    /// For all workers.
    pub(super) all: Metrics,
    /// For its own.
    pub(super) own: WorkerMetrics,
}

/// Runs a session until the worker is lost. Tells everything but the loss, which it returns.
pub(super) async fn run(
    connection: Connection,
    mut commands: mpsc::UnboundedReceiver<Command>,
    bytes_sent: Arc<AtomicU64>,
    metrics: SessionMetrics,
    tell: impl Fn(News),
) -> LostWorkerReason {
    let Connection { mut inbound, outbound, uploads: upload_client, remote, .. } = connection;
    let (under_way, passes, pulse) = (HashMap::new(), HashSet::new(), Pulse::default());
    let mut session = Session { outbound, under_way, passes, pulse, bytes_sent, metrics, tell };
    let (mut packings, mut uploads) = (JoinSet::new(), JoinSet::new());
    let mut keep_alive = interval(KEEP_ALIVE);
    keep_alive.set_missed_tick_behavior(MissedTickBehavior::Delay);

    loop {
        let step = tokio::select! {
            command = commands.recv() => match command {
                Some(Command::Load(replica)) => {
                    packings.spawn(pack(replica, remote));
                    Ok(())
                }
                Some(command) => {
                    session.obey(command);
                    Ok(())
                }
                None => Err(LostWorkerReason::Leaving),
            },
            message = inbound.message() => {
                session.pulse.heard();
                session.hear(message, !uploads.is_empty())
            }
            Some(packed) = packings.join_next() => match packed {
                Ok(parcel) => {
                    // Until now no byte could have moved.
                    session.pulse.uploads();
                    session.count_sent(parcel.len());
                    uploads.spawn(upload(upload_client.clone(), parcel));
                    Ok(())
                }
                Err(error) => Err(LostWorkerReason::Broken(error.to_string())),
            },
            Some(loaded) = uploads.join_next() => match loaded {
                Ok((digest, Ok(()))) => {
                    (session.tell)(News::Loaded(digest));
                    Ok(())
                }
                Ok((digest, Err(UploadFailure::Refused(message)))) => {
                    (session.tell)(News::Refused { digest, message });
                    Ok(())
                }
                Ok((digest, Err(failure))) => Err(LostWorkerReason::Upload(digest, failure)),
                Err(error) => Err(LostWorkerReason::Broken(error.to_string())),
            },
            // A worker in this process cannot be lost alone.
            _ = keep_alive.tick(), if remote => {
                let beat = session.pulse.beat(Instant::now(), !session.under_way.is_empty());
                beat.map(|beat| session.send(Outgoing::KeepAlive(beat))).map_err(LostWorkerReason::from)
            }
        };
        if let Err(reason) = step {
            // Both halves are dropped here, and uploads with them.
            return reason;
        }
    }
}

/// Rows where a tile was asked for, or the other way round.
fn other_kind(job: u64) -> LostWorkerReason {
    LostWorkerReason::Garbage(format!("an answer of another kind to job {job}"))
}

/// The replica that a message names.
fn replica_of(digest: &[u8]) -> Result<Digest, LostWorkerReason> {
    Digest::try_from(digest).map_err(|error| LostWorkerReason::Garbage(error.to_string()))
}

struct Session<T> {
    outbound: mpsc::UnboundedSender<CoordinatorMessage>,
    /// Jobs that the worker has not answered, each counted in the metrics while it is here.
    under_way: HashMap<JobId, (Arc<Request>, Held)>,
    /// Replicas that the worker is to pass on, and has not told of.
    passes: HashSet<(WorkerId, Digest)>,
    pulse: Pulse,
    /// Length of the replicas and jobs sent.
    bytes_sent: Arc<AtomicU64>,
    metrics: SessionMetrics,
    tell: T,
}

impl<T: Fn(News)> Session<T> {
    /// Sends a message. Where none can be sent any more, what the worker sent last tells why: its goodbye may not be read yet, and a
    /// worker that says nothing is found to be silent.
    fn send(&self, body: Outgoing) {
        self.outbound.send(CoordinatorMessage { body: Some(body) }).ok();
    }

    fn obey(&mut self, command: Command) {
        match command {
            Command::Job(job, request) => {
                let body = request.to_body(job);
                self.count_sent(body.encoded_len());
                self.under_way.insert(job, (request, self.metrics.all.in_flight()));
                self.send(body);
            }
            Command::Cancel(job) => self.send(Outgoing::Cancel(CancelJob { job_id: job.0 })),
            Command::Release(digest) => {
                self.send(Outgoing::Release(ReleaseReplica { digest: digest.to_bytes() }));
            }
            Command::Goodbye => self.send(Outgoing::Goodbye(Goodbye { reason: "the work is done".into() })),
            Command::Pass { digest, to, peer: Peer { name, socket, instance } } => {
                self.passes.insert((to, digest));
                let address = socket.to_string();
                let digest = digest.to_bytes();
                self.send(Outgoing::Pass(PassReplica { number: to.0, digest, name, address, instance }));
            }
            // Uploads are started where they are awaited.
            Command::Load(_) => {}
        }
    }

    /// Takes a message from the worker. Any end of its stream, whatever its code, is the loss of the worker.
    fn hear(
        &mut self,
        message: Result<Option<WorkerMessage>, Status>,
        is_uploading: bool,
    ) -> Result<(), LostWorkerReason> {
        let message = message
            .map_err(|status| LostWorkerReason::Broken(words(&status)))?
            .ok_or(LostWorkerReason::Closed)?;
        match message.body {
            Some(Incoming::Finished(finished)) => {
                let request = self.answered(finished.job_id)?;
                let Request::Rows(rows) = &*request else { return Err(other_kind(finished.job_id)) };
                let answer = Answer::check(rows, &finished)
                    .map_err(|error| LostWorkerReason::Garbage(error.to_string()))?;
                self.finished(answer.into());
            }
            Some(Incoming::Tile(finished)) => {
                let request = self.answered(finished.job_id)?;
                let Request::Tile(tile) = &*request else { return Err(other_kind(finished.job_id)) };
                let answer = check_tile(tile, &finished)
                    .map_err(|error| LostWorkerReason::Garbage(error.to_string()))?;
                self.finished(answer);
            }
            Some(Incoming::Failed(JobFailed { job_id, reason, message })) => {
                self.answered(job_id)?;
                let reason = FailureReason::try_from(reason).unwrap_or_default();
                (self.tell)(News::Failed { job: JobId(job_id), reason, message });
            }
            Some(Incoming::KeepAlive(answer)) => {
                if let Some(time) = self.pulse.answered(answer, Instant::now(), is_uploading)? {
                    self.metrics.own.round_trip(time);
                    (self.tell)(News::RoundTrip(time));
                }
            }
            Some(Incoming::Passed(passed)) => {
                let to = WorkerId(passed.number);
                let digest = replica_of(&passed.digest)?;
                if !self.passes.remove(&(to, digest)) {
                    return Err(LostWorkerReason::Garbage(format!("it passed replica {digest} on unasked")));
                }
                let outcome = match passed.outcome() {
                    protocol::worker::PassOutcome::Done => PassOutcome::Done,
                    protocol::worker::PassOutcome::NotHeld => PassOutcome::NotHeld,
                    protocol::worker::PassOutcome::Failed | protocol::worker::PassOutcome::Unspecified => {
                        PassOutcome::Failed
                    }
                };
                (self.tell)(News::Passed { digest, to, outcome, message: passed.message });
            }
            Some(Incoming::Held(held)) => (self.tell)(News::Loaded(replica_of(&held.digest)?)),
            Some(Incoming::Goodbye(Goodbye { reason })) => return Err(LostWorkerReason::Left(reason)),
            Some(Incoming::Hello(_)) | None => {
                return Err(LostWorkerReason::Garbage("a second hello, or an unknown message".into()));
            }
        }
        Ok(())
    }

    fn finished(&self, answer: Checked) {
        let work = &answer.work;
        self.metrics.own.answered(work.rows(), work.rays(), work.busy());
        if work.busy() > LONG_JOB {
            tracing::debug!(job = %work.job(), rows = work.rows(), busy = ?work.busy(), "a long job");
        }
        (self.tell)(News::Finished(answer));
    }

    fn count_sent(&self, bytes: usize) {
        self.bytes_sent.fetch_add(bytes as u64, Ordering::Relaxed);
        self.metrics.all.sent(bytes as u64);
    }

    /// Takes the request of an answered job.
    fn answered(&mut self, job: u64) -> Result<Arc<Request>, LostWorkerReason> {
        self.pulse.worked();
        self.under_way.remove(&JobId(job)).map(|(request, _)| request).ok_or_else(|| {
            LostWorkerReason::Garbage(format!("an answer to job {job}, which it does not hold"))
        })
    }
}
