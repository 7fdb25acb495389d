//! The gRPC service: sessions with coordinators, and uploads of replicas.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use shared::protocol::worker_server::Worker;
use shared::protocol::{
    CoordinatorMessage, LoadReplicaReply, ReplicaChunk, WorkerMessage, replica_chunk::Body,
};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;
use tonic::{Request, Response, Status, Streaming};

use crate::pool::ComputePool;
use crate::store::ReplicaStore;
use crate::upload::{Upload, UploadError};
use crate::{Settings, session};

/// Answers that may wait for the network before a session stops taking messages in.
const ANSWERS_AHEAD: usize = 16;

/// What all sessions of a worker share. A clone is another handle to the same worker.
#[derive(Clone)]
pub(crate) struct WorkerService {
    pub(crate) settings: Arc<Settings>,
    pub(crate) pool: ComputePool,
    pub(crate) shutdown: CancellationToken,
    store: Arc<Mutex<ReplicaStore>>,
}

impl WorkerService {
    pub(crate) fn new(settings: Settings, pool: ComputePool, shutdown: CancellationToken) -> Self {
        let store = Arc::new(Mutex::new(ReplicaStore::new(settings.replica_bytes)));
        Self { settings: Arc::new(settings), pool, shutdown, store }
    }

    /// The replicas; hold them for a look-up, never across work.
    pub(crate) fn store(&self) -> MutexGuard<'_, ReplicaStore> {
        // No code that holds the lock leaves the store half changed.
        self.store.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[tonic::async_trait]
impl Worker for WorkerService {
    type SessionStream = ReceiverStream<Result<WorkerMessage, Status>>;

    async fn session(
        &self,
        request: Request<Streaming<CoordinatorMessage>>,
    ) -> Result<Response<Self::SessionStream>, Status> {
        let coordinator = request.remote_addr();
        let (outbound, answers) = mpsc::channel(ANSWERS_AHEAD);
        let worker = self.clone();
        // The answers' stream goes back before anything is read: the coordinator's call returns with it.
        tokio::spawn(async move {
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
        let mut chunks = request.into_inner();
        let Some(ReplicaChunk { body: Some(Body::Header(header)) }) = chunks.message().await? else {
            return Err(refusal(&UploadError::Order));
        };
        let largest = self.store().largest();
        let mut upload = Upload::begin(&header, largest).map_err(|error| refusal(&error))?;
        let (digest, length) = (upload.digest(), upload.length());
        if self.store().get(digest).is_some() {
            return Ok(Response::new(LoadReplicaReply { already_held: true }));
        }
        while let Some(chunk) = chunks.message().await? {
            let Some(Body::Data(data)) = chunk.body else { return Err(refusal(&UploadError::Order)) };
            upload.push(&data).map_err(|error| refusal(&error))?;
        }
        let replica = self
            .pool
            .run(|| upload.finish())
            .await
            .map_err(|panicked| Status::internal(format!("replica {digest}: {panicked}")))?
            .map_err(|error| refusal(&error))?;
        self.store().insert(digest, replica, length);
        tracing::info!(replica = %digest, bytes = length, "replica loaded");
        Ok(Response::new(LoadReplicaReply { already_held: false }))
    }
}

fn refusal(error: &UploadError) -> Status {
    match error {
        UploadError::TooLarge { .. } => Status::resource_exhausted(error.to_string()),
        _ => Status::invalid_argument(error.to_string()),
    }
}
