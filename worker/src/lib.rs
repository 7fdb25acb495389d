//! The worker: computes rows of form factors and tiles of pictures for coordinators, and keeps nothing.
//!
//! In: replicas of scenes, receivers and pictures, and jobs that name them. Out: encoded rows and tiles. It must not know meshes,
//! energies, files, or other workers but those that it is told to pass a replica on to. Begin reading at [`engine`], then [`job`] and `session`.
//!
//! | module | contents |
//! |---|---|
//! | [`engine`] | computes rows; pure |
//! | [`store`] | the replicas held |
//! | [`upload`] | checks a replica on its way in |
//! | [`passing`] | passes a replica on to another worker |
//! | [`job`] | checks and computes one job |
//! | [`tile`] | checks and computes one tile of a picture |
//! | [`pool`] | the threads that compute |
//! | [`metrics`] | metrics for Prometheus |
//! | [`memory`] | memory of the machine |
//! | [`incoming`] | connections from outside, up to the point where HTTP/2 begins |
//! | [`health`] | health checks and reflection |
//! | `session`, `service`, `shared` | the conversation with a coordinator |
//!
//! [`serve`] runs a worker on any stream of connections: sockets in the `worker` binary, memory in a coordinator with local workers.

pub mod engine;
pub mod health;
pub mod incoming;
pub mod job;
pub mod memory;
pub mod metrics;
pub mod passing;
pub mod pool;
mod service;
mod session;
mod shared;
pub mod store;
pub mod tile;
pub mod upload;

use std::convert::Infallible;
use std::future::pending;
use std::hash::{BuildHasher, RandomState};
use std::num::NonZeroUsize;
use std::pin::Pin;
use std::time::Duration;

use protocol::security::{Guard, Token};
use protocol::server::{self, ConnectionBounds, Incoming};
use protocol::worker::MAX_MESSAGE_BYTES;
use protocol::worker::worker_server::WorkerServer;
use tokio_util::sync::CancellationToken;
use tonic::service::{InterceptorLayer, Routes};

use crate::health::Health;
use crate::metrics::Metrics;
use crate::passing::Passing;
use crate::pool::{Compute, ComputePool};
use crate::service::WorkerService;

/// What a coordinator may have: a session, and the few replicas of a bake. A quiet one only has the session's memory, so there is no
/// hurry to find that it is gone.
const BOUNDS: ConnectionBounds = ConnectionBounds {
    connection_window: 16 << 20,
    call_window: 4 << 20,
    calls: 16,
    // Those of a coordinator have some hundred.
    header_bytes: 16 << 10,
    keep_alive: Duration::from_secs(10),
};

/// How long a stopping worker waits for the jobs that it computes.
const DRAIN: Duration = Duration::from_secs(20);

/// Most threads that may be asked for: systems start no more than some thousands.
pub const MOST_THREADS: usize = 1024;

/// Settings of a worker.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Name for the logs.
    pub name: String,
    /// Random number that identifies this worker, whatever its address.
    pub instance: u64,
    /// Number of jobs computed at the same time.
    pub threads: NonZeroUsize,
    /// Encoded size of the replicas held at the same time, in bytes; a single one may have a quarter of it.
    pub replica_bytes: u64,
    /// Token that every call must carry.
    pub token: Option<Token>,
    /// How other workers are called to pass replicas on; `None` for never.
    pub passing: Option<Passing>,
    /// Metrics.
    pub metrics: Metrics,
    /// How jobs are computed.
    pub compute: Compute,
}

impl Settings {
    /// Default room for replicas, in encoded bytes: an eighth of the memory. Decoded they take half of it at most.
    #[must_use]
    pub fn default_replica_bytes() -> u64 {
        memory::memory_bytes() / 8
    }

    /// Default settings with this name, without a token, and without other workers.
    #[must_use]
    pub fn new(name: &str, threads: NonZeroUsize) -> Self {
        Self {
            name: name.into(),
            instance: Self::random_instance(),
            threads,
            replica_bytes: Self::default_replica_bytes(),
            token: None,
            passing: None,
            metrics: Metrics::default(),
            compute: Compute::Threads,
        }
    }

    /// A number for [`Settings::instance`], another one with each call.
    #[must_use]
    pub fn random_instance() -> u64 {
        // Seeded by the system, for each state anew.
        RandomState::new().hash_one(())
    }
}

/// Error of [`serve`].
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The system refused to start the threads.
    #[error("cannot start the computing threads: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// Reflection failed.
    #[error("cannot offer reflection: {0}")]
    Reflection(#[from] tonic_reflection::server::Error),
    /// The server failed.
    #[error("cannot serve: {0}")]
    Transport(#[from] tonic::transport::Error),
}

/// Serves coordinators on these connections until `shutdown` is cancelled. Jobs being computed then are finished and
/// answered, those not yet begun are handed back; meanwhile no session is taken, and health checks say so.
///
/// # Errors
/// When the computing threads cannot be started or the server fails.
pub fn serve(
    incoming: Incoming,
    settings: Settings,
    shutdown: CancellationToken,
) -> Pin<Box<dyn Future<Output = Result<(), ServeError>> + Send>> {
    // Boxed, it is compiled here once, and not wherever it is awaited.
    Box::pin(serve_until(incoming, settings, shutdown))
}

async fn serve_until(
    incoming: Incoming,
    settings: Settings,
    shutdown: CancellationToken,
) -> Result<(), ServeError> {
    let pool = ComputePool::of(settings.compute, settings.threads)?;
    let guard = Guard::new(settings.token.clone());
    let worker = WorkerService::new(settings, pool, shutdown.clone());
    let sessions = worker.sessions.clone();
    let service = WorkerServer::new(worker)
        .max_decoding_message_size(MAX_MESSAGE_BYTES)
        .max_encoding_message_size(MAX_MESSAGE_BYTES);
    let (health, health_service) = Health::new().await;
    let drained = CancellationToken::new();
    let draining = async {
        shutdown.cancelled().await;
        health.drain().await;
        sessions.close();
        sessions.wait().await;
        health.leave().await;
        drained.cancel();
        // Connections end with their calls.
        pending::<Infallible>().await
    };
    let routes = Routes::new(service).add_service(health_service).add_service(health::reflection()?);
    let guarded = routes.into_axum_router().layer(InterceptorLayer::new(guard)).into();
    let serving = server::serve(BOUNDS.server(), guarded, incoming, drained.clone());
    let too_late = async {
        shutdown.cancelled().await;
        tokio::time::sleep(DRAIN).await;
    };
    tokio::select! {
        result = serving => Ok(result?),
        never = draining => match never {},
        () = too_late => {
            tracing::warn!("leaving although a session is still open");
            Ok(())
        }
    }
}
