//! The gRPC service: sessions with coordinators, and uploads of replicas.

use std::sync::Arc;
use std::time::Duration;

use kernel::replica::Digest;
use protocol::security::Caller;
use protocol::worker::worker_server::Worker;
use protocol::worker::{
    CoordinatorMessage, LoadReplicaReply, ReplicaChunk, WorkerMessage, replica_chunk::Body,
};
use tokio::sync::{Semaphore, mpsc};
use tokio::time::timeout;
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;
use tonic::{Request, Response, Status, Streaming};

use crate::pool::ComputePool;
use crate::shared::Shared;
use crate::upload::{Upload, UploadError};
use crate::{Settings, session};

/// Answers that may wait for the network before a session stops taking messages in.
const ANSWERS_AHEAD: usize = 16;

/// Uploads at the same time, of coordinators and of other workers. Each may be of a quarter of the room for replicas: those under way
/// take no more than twice what those held do.
const UPLOADS: usize = 4;

/// How long an upload may pause before it is broken off.
const STALL: Duration = Duration::from_secs(30);

/// The service of a worker. A clone is another handle to it.
#[derive(Clone)]
pub(crate) struct WorkerService {
    shared: Shared,
    /// Sessions that are not over yet.
    pub(crate) sessions: TaskTracker,
    uploads: Arc<Semaphore>,
    /// The same for those of other workers: where one is slow, no coordinator's upload waits for it.
    passed: Arc<Semaphore>,
}

impl WorkerService {
    pub(crate) fn new(settings: Settings, pool: ComputePool, shutdown: CancellationToken) -> Self {
        let shared = Shared::new(settings, pool, shutdown);
        let [uploads, passed] = [(); 2].map(|()| Arc::new(Semaphore::new(UPLOADS)));
        Self { shared, sessions: TaskTracker::new(), uploads, passed }
    }

    /// Takes a replica in.
    async fn load(&self, mut chunks: Streaming<ReplicaChunk>) -> Result<LoadReplicaReply, Status> {
        let Some(ReplicaChunk { body: Some(Body::Header(header)) }) = next(&mut chunks).await? else {
            return Err(refusal(&UploadError::Order));
        };
        let largest = self.shared.store().largest();
        let mut upload = Upload::begin(&header, largest).map_err(|error| refusal(&error))?;
        let (digest, length) = (upload.digest(), upload.length());
        let Settings { instance, passing, .. } = &*self.shared.settings;
        let is_passed = header.passed_to != 0;
        if is_passed && header.passed_to != *instance {
            return Err(Status::failed_precondition(
                "the replica is for another worker: its address leads here",
            ));
        }
        if self.shared.store().get(digest).is_some() {
            self.tell_of(digest, is_passed);
            return Ok(LoadReplicaReply { already_held: true, digest: digest.to_bytes() });
        }
        // They are never closed.
        let _place = if is_passed {
            let place = self.passed.try_acquire();
            place.map_err(|_| Status::unavailable("too many replicas come from other workers at once"))
        } else {
            let place = self.uploads.acquire().await;
            place.map_err(|_| Status::unavailable("the worker takes no uploads any more"))
        }?;
        while let Some(chunk) = next(&mut chunks).await? {
            let Some(Body::Data(data)) = chunk.body else { return Err(refusal(&UploadError::Order)) };
            upload.push(&data).map_err(|error| refusal(&error))?;
            self.shared.uploads.came(data.len());
        }
        let preparing = self.shared.uploads.preparing();
        let (replica, parcel) = self
            .shared
            .pool
            .run(|| upload.finish_and_keep())
            .await
            .map_err(|panicked| Status::internal(format!("replica {digest}: {panicked}")))?
            .map_err(|error| refusal(&error))?;
        drop(preparing);
        self.shared.change_store(|store| {
            store.insert(digest, replica, length);
            if passing.is_some() {
                store.keep_parcel(digest, parcel);
            }
        });
        self.tell_of(digest, is_passed);
        self.shared.settings.metrics.uploads.inc();
        tracing::info!(replica = %digest, bytes = length, "replica loaded");
        Ok(LoadReplicaReply { already_held: false, digest: digest.to_bytes() })
    }

    /// Tells all coordinators of a replica that another worker passed on.
    fn tell_of(&self, digest: Digest, is_passed: bool) {
        if is_passed {
            // Where no coordinator is left, nobody waits for it.
            let _ = self.shared.arrivals.send(digest);
        }
    }
}

/// The next chunk of an upload, if it comes in time.
async fn next(chunks: &mut Streaming<ReplicaChunk>) -> Result<Option<ReplicaChunk>, Status> {
    timeout(STALL, chunks.message()).await.unwrap_or_else(|_| {
        Err(Status::deadline_exceeded(format!("the upload paused for {} seconds", STALL.as_secs())))
    })
}

#[tonic::async_trait]
impl Worker for WorkerService {
    type SessionStream = ReceiverStream<Result<WorkerMessage, Status>>;

    async fn session(
        &self,
        request: Request<Streaming<CoordinatorMessage>>,
    ) -> Result<Response<Self::SessionStream>, Status> {
        if self.shared.shutdown.is_cancelled() {
            return Err(Status::unavailable("the worker was told to stop"));
        }
        let coordinator = request.extensions().get::<Caller>().and_then(Caller::address);
        let (outbound, answers) = mpsc::channel(ANSWERS_AHEAD);
        let worker = self.shared.clone();
        // The answers' stream goes back before anything is read: the coordinator's call returns with it.
        self.sessions.spawn(async move {
            match session::run(&worker, request.into_inner(), &outbound).await {
                Ok(()) => tracing::info!(?coordinator, "session over"),
                Err(status) => {
                    tracing::warn!(?coordinator, error = status.message(), "session broken off");
                    // Where the coordinator is gone, nobody is left to be told.
                    let _ = outbound.send(Err(status)).await;
                }
            }
        });
        Ok(Response::new(ReceiverStream::new(answers)))
    }

    async fn load_replica(
        &self,
        request: Request<Streaming<ReplicaChunk>>,
    ) -> Result<Response<LoadReplicaReply>, Status> {
        let loaded = self.load(request.into_inner()).await;
        if let Err(status) = &loaded {
            self.shared.settings.metrics.failed_uploads.inc();
            tracing::warn!(error = status.message(), "upload broken off");
        }
        loaded.map(Response::new)
    }
}

fn refusal(error: &UploadError) -> Status {
    match error {
        UploadError::TooLarge { .. } => Status::resource_exhausted(error.to_string()),
        _ => Status::invalid_argument(error.to_string()),
    }
}
