//! One port for all: gRPC, gRPC-web and HTTP, with reflection and health.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::Request;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::response::IntoResponse;
use protocol::api::radiosity_server::{RadiosityServer, SERVICE_NAME};
use protocol::api::{DESCRIPTORS, MAX_MESSAGE_BYTES};
use protocol::server::ConnectionBounds;
use tokio_stream::Stream;
use tokio_util::sync::CancellationToken;
use tonic::server::NamedService;
use tonic::service::Routes;
use tonic_health::ServingStatus;
use tonic_health::server::health_reporter;
use tonic_web::GrpcWebLayer;
use tower::{Layer, Service as Answers};
use worker::incoming::Connection;

use crate::api::Api;
use crate::clients::Clients;
use crate::guard::{Names, only_by_name, only_own_pages};
use crate::{Service, http};

/// What a client may have: uploads wait for the disk, and a page watches all jobs on one connection.
const BOUNDS: ConnectionBounds = ConnectionBounds {
    connection_window: 8 << 20,
    call_window: 2 << 20,
    calls: 64,
    header_bytes: 32 << 10,
    keep_alive: Duration::from_secs(20),
};

/// How long clients have to take what they are owed when the service ends, and jobs to stop.
const PARTING: Duration = Duration::from_secs(10);

/// Why the service does not serve.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The API cannot be told to those who ask.
    #[error("cannot offer reflection: {0}")]
    Reflection(#[from] tonic_reflection::server::Error),
    /// The server failed.
    #[error("cannot serve: {0}")]
    Transport(#[from] tonic::transport::Error),
}

/// Serves clients on these connections until `shutdown` is cancelled; then jobs stop, to go on at the next start.
///
/// # Errors
/// When the server fails.
pub async fn serve(
    incoming: impl Stream<Item = Result<Connection, Infallible>>,
    service: Service,
    clients: Clients,
    names: Names,
    shutdown: CancellationToken,
) -> Result<(), ServeError> {
    let (health, health_service) = health_reporter();
    for name in ["", SERVICE_NAME] {
        health.set_service_status(name, ServingStatus::Serving).await;
    }
    let described = || {
        tonic_reflection::server::Builder::configure()
            .register_encoded_file_descriptor_set(DESCRIPTORS)
            .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
    };
    let reflection = described().build_v1()?;
    // Python's library asks in the older words.
    let older_reflection = described().build_v1alpha()?;
    let api = RadiosityServer::new(Api::new(service.clone(), clients))
        .max_decoding_message_size(MAX_MESSAGE_BYTES)
        .max_encoding_message_size(MAX_MESSAGE_BYTES);
    let router = http::routes();
    // Browsers speak gRPC-web to the API; what else they ask for is the page.
    let router = with(with(with(router, GrpcWebLayer::new().layer(api)), health_service), reflection);
    service.resume();
    let router = guarded(with(router, older_reflection), names);
    let drained = CancellationToken::new();
    let serving = BOUNDS
        .server()
        .accept_http1(true)
        .add_routes(Routes::from(router))
        .serve_with_incoming_shutdown(incoming, drained.cancelled());
    let ending = async {
        shutdown.cancelled().await;
        for name in ["", SERVICE_NAME] {
            health.set_service_status(name, ServingStatus::NotServing).await;
        }
        drained.cancel();
        if !service.end(PARTING).await {
            tracing::warn!("leaving although a job has not stopped: it goes on from its checkpoint");
        }
        // What is owed to watchers is told meanwhile; whoever is slower than that asks again.
        tokio::time::sleep(Duration::from_millis(200)).await;
    };
    tokio::select! {
        result = serving => result?,
        () = ending => return Ok(()),
    }
    service.end(PARTING).await;
    Ok(())
}

/// A router with a gRPC service beside what it had.
fn with<S>(router: Router, service: S) -> Router
where
    S: Answers<Request, Error = Infallible> + NamedService + Clone + Send + Sync + 'static,
    S::Response: IntoResponse,
    S::Future: Send + 'static,
{
    router.route_service(&format!("/{}/{{*call}}", S::NAME), service)
}

/// The same for nobody whom a page of another site has sent.
fn guarded(router: Router, names: Names) -> Router {
    let router = router.layer(from_fn(only_own_pages));
    match names {
        Names::Any => router,
        Names::These(names) => router.layer(from_fn_with_state(Arc::from(names), only_by_name)),
    }
}
