//! The worker: replicas in, rows out.
//!
//! | module | what lives there |
//! |---|---|
//! | [`engine`] | computes rows: pure |
//! | [`store`] | the replicas that the worker holds |
//! | [`upload`] | checks a replica on its way in |
//! | [`job`] | checks and computes one job |
//! | [`pool`] | the threads that compute |
//! | `session`, `service` | the conversation with a coordinator |
//!
//! [`serve`] runs a worker on whatever connections it is given: sockets in the `worker` binary, memory in a coordinator
//! that starts its own.

pub mod engine;
pub mod job;
pub mod pool;
mod service;
mod session;
pub mod store;
pub mod upload;

use std::num::NonZeroUsize;
use std::time::Duration;

use shared::protocol::MAX_MESSAGE_BYTES;
use shared::protocol::worker_server::WorkerServer;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio_stream::Stream;
use tokio_util::sync::CancellationToken;
use tonic::transport::Server;
use tonic::transport::server::Connected;

use crate::pool::ComputePool;
use crate::service::WorkerService;

/// Bytes that may be on their way to the worker, on one connection: an upload then does not wait for each piece to be
/// acknowledged.
const CONNECTION_WINDOW: u32 = 16 << 20;

/// The same for one call. Smaller, so that an upload cannot use up the window of its whole connection.
const CALL_WINDOW: u32 = 4 << 20;

/// How often a quiet coordinator is asked for a sign of life, and how long it has to give one. It only frees the
/// session's memory, so there is no hurry.
const KEEP_ALIVE: Duration = Duration::from_secs(10);

/// How long a worker that was told to stop waits for the jobs that it computes.
const DRAIN: Duration = Duration::from_secs(20);

/// What a worker is.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Name for the logs.
    pub name: String,
    /// How many jobs are computed at the same time.
    pub threads: NonZeroUsize,
    /// Encoded size of the replicas held at the same time, in bytes; a single one may have a quarter of it.
    pub replica_bytes: u64,
}

impl Settings {
    /// Room for replicas where nobody asks for more or less, in bytes.
    pub const DEFAULT_REPLICA_BYTES: u64 = 4 << 30;
}

/// Why a worker does not serve.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The system refused to start the threads.
    #[error("cannot start the computing threads: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// The server failed.
    #[error("cannot serve: {0}")]
    Transport(#[from] tonic::transport::Error),
}

/// Serves coordinators on these connections until `shutdown` is cancelled. Jobs being computed then are finished and
/// answered, those not yet begun are handed back.
///
/// # Errors
/// When the computing threads cannot be started or the server fails.
pub async fn serve<IO, E>(
    incoming: impl Stream<Item = Result<IO, E>>,
    settings: Settings,
    shutdown: CancellationToken,
) -> Result<(), ServeError>
where
    IO: AsyncRead + AsyncWrite + Connected + Unpin + Send + 'static,
    E: Into<Box<dyn std::error::Error + Send + Sync>>,
{
    let pool = ComputePool::new(settings.threads.get())?;
    let service = WorkerServer::new(WorkerService::new(settings, pool, shutdown.clone()))
        .max_decoding_message_size(MAX_MESSAGE_BYTES)
        .max_encoding_message_size(MAX_MESSAGE_BYTES);
    let serving = Server::builder()
        .initial_connection_window_size(CONNECTION_WINDOW)
        .initial_stream_window_size(CALL_WINDOW)
        .http2_keepalive_interval(Some(KEEP_ALIVE))
        .http2_keepalive_timeout(Some(KEEP_ALIVE))
        .add_service(service)
        .serve_with_incoming_shutdown(incoming, shutdown.clone().cancelled_owned());
    let too_late = async {
        shutdown.cancelled().await;
        tokio::time::sleep(DRAIN).await;
    };
    tokio::select! {
        result = serving => Ok(result?),
        () = too_late => {
            tracing::warn!("leaving although a session is still open");
            Ok(())
        }
    }
}
