//! One worker's session: commands in, news out. Whatever goes wrong ends it, and is told once: as the loss of the worker.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use shared::protocol::coordinator_message::Body as Outgoing;
use shared::protocol::worker_message::Body as Incoming;
use shared::protocol::{
    CoordinatorMessage, FailureReason, Finished, Goodbye, JobFailed, KeepAlive, ReleaseReplica,
    RowStatistics, WorkerMessage,
};
use shared::replica::{Digest, EncodedReplica};
use shared::row::{Row, RowRequest, decode_row};
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio::time::{MissedTickBehavior, interval};
use tonic::Status;

use super::connect::Connection;
use super::error::words;
use super::upload::upload;
use crate::scheduler::JobId;

/// Time from one keep-alive of the session to the next. The connection has its own below; this one notices a worker whose
/// machine answers but whose session does not.
const KEEP_ALIVE: Duration = Duration::from_secs(1);

/// A worker that says nothing while so many keep-alives go out is lost. Counted rather than timed, so that a coordinator
/// that was stopped for a while does not blame the worker.
const MOST_UNANSWERED: u32 = 4;

/// What a session is to do.
pub(super) enum Command {
    /// Have these rows computed.
    Job(JobId, Arc<RowRequest>),
    /// Load a replica.
    Load(EncodedReplica),
    /// Tell the worker that it may forget a replica.
    Release(Digest),
    /// No more jobs.
    Goodbye,
}

/// What a session tells.
pub(super) enum News {
    /// A replica has arrived.
    Loaded(Digest),
    /// A job is done.
    Finished(Answer),
    /// A job was not done.
    Failed {
        /// The job.
        job: JobId,
        /// Decides what is done next.
        reason: FailureReason,
        /// The worker's words.
        message: String,
    },
    /// The last news: the session is over.
    Lost(LostWorkerReason),
}

/// The answer to a job, decoded and checked.
pub(super) struct Answer {
    pub job: JobId,
    pub rows: Vec<Row>,
    pub statistics: Vec<RowStatistics>,
    /// Length of the rows as they came, in bytes.
    pub bytes: u64,
}

/// Why a worker counts as lost.
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
    #[error("it sends garbage: {0}")]
    Garbage(String),
    #[error("replica {0} could not be loaded: {1}")]
    Upload(Digest, String),
    #[error("the coordinator leaves")]
    Leaving,
}

/// Talks to a worker until it is lost.
pub(super) async fn run(
    connection: Connection,
    mut commands: mpsc::UnboundedReceiver<Command>,
    tell: impl Fn(News),
) {
    let Connection { mut inbound, outbound, uploads: upload_client, remote, .. } = connection;
    let mut session = Session { outbound, under_way: HashMap::new(), tell };
    let mut uploads = JoinSet::new();
    let mut unanswered = 0;
    let mut keep_alive = interval(KEEP_ALIVE);
    keep_alive.set_missed_tick_behavior(MissedTickBehavior::Delay);

    let reason = loop {
        let step = tokio::select! {
            command = commands.recv() => match command {
                Some(Command::Load(replica)) => {
                    uploads.spawn(upload(upload_client.clone(), replica));
                    Ok(())
                }
                Some(command) => session.obey(command),
                None => Err(LostWorkerReason::Leaving),
            },
            message = inbound.message() => {
                unanswered = 0;
                session.hear(message)
            }
            Some(loaded) = uploads.join_next() => match loaded {
                Ok((digest, Ok(()))) => {
                    (session.tell)(News::Loaded(digest));
                    Ok(())
                }
                Ok((digest, Err(status))) => Err(LostWorkerReason::Upload(digest, words(&status))),
                Err(error) => Err(LostWorkerReason::Broken(error.to_string())),
            },
            // A worker in this very process cannot be lost alone.
            _ = keep_alive.tick(), if remote => {
                unanswered += 1;
                if unanswered > MOST_UNANSWERED {
                    Err(LostWorkerReason::Silent)
                } else {
                    session.send(Outgoing::KeepAlive(KeepAlive { number: unanswered.into() }))
                }
            }
        };
        if let Err(reason) = step {
            break reason;
        }
    };
    (session.tell)(News::Lost(reason));
    // Both halves are dropped here, and uploads with them.
}

struct Session<T> {
    outbound: mpsc::UnboundedSender<CoordinatorMessage>,
    /// What the worker was asked and has not answered.
    under_way: HashMap<JobId, Arc<RowRequest>>,
    tell: T,
}

impl<T: Fn(News)> Session<T> {
    fn send(&self, body: Outgoing) -> Result<(), LostWorkerReason> {
        self.outbound
            .send(CoordinatorMessage { body: Some(body) })
            .map_err(|_| LostWorkerReason::Broken("nothing can be sent any more".into()))
    }

    fn obey(&mut self, command: Command) -> Result<(), LostWorkerReason> {
        match command {
            Command::Job(job, request) => {
                let message = request.to_job(job.0);
                self.under_way.insert(job, request);
                self.send(Outgoing::Job(message))
            }
            Command::Release(digest) => {
                self.send(Outgoing::Release(ReleaseReplica { digest: digest.to_bytes() }))
            }
            Command::Goodbye => self.send(Outgoing::Goodbye(Goodbye { reason: "the work is done".into() })),
            // Uploads are started where they are awaited.
            Command::Load(_) => Ok(()),
        }
    }

    /// Takes in what the worker says. Any end of its stream, whatever its code, is the loss of the worker.
    fn hear(&mut self, message: Result<Option<WorkerMessage>, Status>) -> Result<(), LostWorkerReason> {
        let message = message
            .map_err(|status| LostWorkerReason::Broken(words(&status)))?
            .ok_or(LostWorkerReason::Closed)?;
        match message.body {
            Some(Incoming::Finished(finished)) => {
                let request = self.answered(finished.job_id)?;
                let answer = decode(&request, &finished).map_err(LostWorkerReason::Garbage)?;
                (self.tell)(News::Finished(answer));
            }
            Some(Incoming::Failed(JobFailed { job_id, reason, message })) => {
                self.answered(job_id)?;
                let reason = FailureReason::try_from(reason).unwrap_or_default();
                (self.tell)(News::Failed { job: JobId(job_id), reason, message });
            }
            Some(Incoming::KeepAlive(_)) => {}
            Some(Incoming::Goodbye(Goodbye { reason })) => return Err(LostWorkerReason::Left(reason)),
            Some(Incoming::Hello(_)) | None => {
                return Err(LostWorkerReason::Garbage("a second hello, or an unknown message".into()));
            }
        }
        Ok(())
    }

    /// What an answered job asked for.
    fn answered(&mut self, job: u64) -> Result<Arc<RowRequest>, LostWorkerReason> {
        self.under_way.remove(&JobId(job)).ok_or_else(|| {
            LostWorkerReason::Garbage(format!("an answer to job {job}, which it does not hold"))
        })
    }
}

/// Decodes the rows of a job and checks that they are what was asked for.
fn decode(request: &RowRequest, finished: &Finished) -> Result<Answer, String> {
    let job = JobId(finished.job_id);
    let (expected, found) = (request.shooters.len(), finished.rows.len());
    if found != expected {
        return Err(format!("{found} rows for job {job}, which asks for {expected}"));
    }
    let costs = finished.statistics.len();
    if costs != expected {
        return Err(format!("statistics of {costs} rows for job {job}, which asks for {expected}"));
    }
    let decode = |bytes: &tonic::codegen::Bytes| decode_row(bytes, request.receiver_count as usize);
    let rows: Result<_, _> = finished.rows.iter().map(decode).collect();
    Ok(Answer {
        job,
        rows: rows.map_err(|error| format!("job {job}: {error}"))?,
        statistics: finished.statistics.clone(),
        bytes: finished.rows.iter().map(|row| row.len() as u64).sum(),
    })
}
