//! One port for all: gRPC, gRPC-web and HTTP, with reflection and health.

use std::convert::Infallible;
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::Request;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::response::IntoResponse;
use protocol::api::radiosity_server::{RadiosityServer, SERVICE_NAME};
use protocol::api::{DESCRIPTORS, MAX_MESSAGE_BYTES};
use protocol::server::{self, ConnectionBounds, Incoming};
use tokio_util::sync::CancellationToken;
use tonic::server::NamedService;
use tonic::service::Routes;
use tonic_health::ServingStatus;
use tonic_health::server::health_reporter;
use tonic_web::GrpcWebLayer;
use tower::{Layer, Service as Answers};

use crate::api::Api;
use crate::clients::Clients;
use crate::guard::{Names, only_by_name, only_own_pages};
use crate::{Service, http};

/// Bounds of one connection: uploads wait for the disk, and a page makes all its calls on one connection.
const BOUNDS: ConnectionBounds = ConnectionBounds {
    connection_window: 8 << 20,
    call_window: 2 << 20,
    calls: 64,
    header_bytes: 32 << 10,
    keep_alive: Duration::from_secs(20),
};

/// How long calls may take to end, and jobs to stop, when the service ends.
const PARTING: Duration = Duration::from_secs(10);

/// Why the service does not serve.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The reflection service cannot be built.
    #[error("cannot offer reflection: {0}")]
    Reflection(#[from] tonic_reflection::server::Error),
    /// The server failed.
    #[error("cannot serve: {0}")]
    Transport(#[from] tonic::transport::Error),
}

/// Serves these connections until `shutdown` is cancelled; then jobs stop, to resume at the next start.
///
/// # Errors
/// When the server fails.
pub fn serve(
    incoming: Incoming,
    service: Service,
    clients: Clients,
    names: Names,
    shutdown: CancellationToken,
) -> Pin<Box<dyn Future<Output = Result<(), ServeError>> + Send>> {
    // Boxed, it is compiled here once, and not wherever it is awaited.
    Box::pin(serve_until(incoming, service, clients, names, shutdown))
}

async fn serve_until(
    incoming: Incoming,
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
    // Python's gRPC library uses v1alpha.
    let older_reflection = described().build_v1alpha()?;
    let api = RadiosityServer::new(Api::new(service.clone(), clients))
        .max_decoding_message_size(MAX_MESSAGE_BYTES)
        .max_encoding_message_size(MAX_MESSAGE_BYTES);
    let router = http::routes();
    // Browsers call the API by gRPC-web and load the page by HTTP.
    let router = with(with(with(router, GrpcWebLayer::new().layer(api)), health_service), reflection);
    service.resume();
    let router = guarded(with(router, older_reflection), names);
    let drained = CancellationToken::new();
    let server = BOUNDS.server().accept_http1(true);
    let serving = server::serve(server, Routes::from(router), incoming, drained.clone());
    let ending = async {
        shutdown.cancelled().await;
        for name in ["", SERVICE_NAME] {
            health.set_service_status(name, ServingStatus::NotServing).await;
        }
        drained.cancel();
        if !service.end(PARTING).await {
            tracing::warn!("leaving although a job has not stopped: it goes on from its checkpoint");
        }
        // Lets watchers receive their last message; slower ones call again.
        tokio::time::sleep(Duration::from_millis(200)).await;
    };
    tokio::select! {
        result = serving => result?,
        () = ending => return Ok(()),
    }
    service.end(PARTING).await;
    Ok(())
}

/// Adds a gRPC service to a router.
fn with<S>(router: Router, service: S) -> Router
where
    S: Answers<Request, Error = Infallible> + NamedService + Clone + Send + Sync + 'static,
    S::Response: IntoResponse,
    S::Future: Send + 'static,
{
    router.route_service(&format!("/{}/{{*call}}", S::NAME), service)
}

/// Refuses requests that come from pages of other sites.
fn guarded(router: Router, names: Names) -> Router {
    let router = router.layer(from_fn(only_own_pages));
    match names {
        Names::Any => router,
        Names::These(names) => router.layer(from_fn_with_state(Arc::from(names), only_by_name)),
    }
}
