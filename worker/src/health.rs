//! Health (`grpc.health.v1`) and reflection, on the port of the worker itself.

use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use protocol::network::{self, Sockets};
use protocol::security::{ClientSecurity, SecurityError, explain};
use protocol::worker::DESCRIPTORS;
use protocol::worker::worker_server::SERVICE_NAME;
use tokio::net::lookup_host;
use tokio::time::timeout;
use tonic::Status;
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus as Answer;
use tonic_health::pb::health_client::HealthClient;
use tonic_health::pb::health_server::{Health as HealthChecks, HealthServer};
use tonic_health::server::{HealthReporter, health_reporter};
use tonic_health::{ServingStatus, pb};
use tonic_reflection::server::v1::{ServerReflection, ServerReflectionServer};

/// How long a check may take.
const PATIENCE: Duration = Duration::from_secs(5);

/// Names of a health check: the whole worker, and its one service.
const NAMES: [&str; 2] = ["", SERVICE_NAME];

/// Status for health checks.
pub(crate) struct Health(HealthReporter);

impl Health {
    /// Reports that the worker serves.
    pub(crate) async fn new() -> (Self, HealthServer<impl HealthChecks>) {
        let (reporter, service) = health_reporter();
        let health = Self(reporter);
        health.report(ServingStatus::Serving).await;
        (health, service)
    }

    /// The worker finishes what it has, and takes nothing new.
    pub(crate) async fn drain(&self) {
        self.report(ServingStatus::NotServing).await;
    }

    /// Ends the calls of those who watch: they would keep their connections open.
    pub(crate) async fn leave(mut self) {
        for name in NAMES {
            self.0.clear_service_status(name).await;
        }
    }

    async fn report(&self, status: ServingStatus) {
        for name in NAMES {
            self.0.set_service_status(name, status).await;
        }
    }
}

/// Serves reflection to clients such as grpcurl.
pub(crate) fn reflection()
-> Result<ServerReflectionServer<impl ServerReflection>, tonic_reflection::server::Error> {
    tonic_reflection::server::Builder::configure()
        .register_encoded_file_descriptor_set(DESCRIPTORS)
        .register_encoded_file_descriptor_set(pb::FILE_DESCRIPTOR_SET)
        .build_v1()
}

/// Why a server does not count as healthy.
#[derive(Debug, thiserror::Error)]
pub enum HealthError {
    /// It must not be dialled so.
    #[error(transparent)]
    Security(#[from] SecurityError),
    /// The name stands for nothing.
    #[error("{address} cannot be found: {reason}")]
    Name {
        /// As it was given.
        address: String,
        /// What the system says.
        reason: String,
    },
    /// Nobody answers, or somebody else does.
    #[error("no {service} answers at {address}: {reason}")]
    Unreachable {
        /// What was asked for.
        service: &'static str,
        /// As it was given.
        address: String,
        /// Why.
        reason: String,
    },
    /// It finishes what it has, and takes nothing new.
    #[error("{address} does not serve: it is shutting down")]
    Draining {
        /// As it was given.
        address: String,
    },
}

/// Asks a server at `host:port` whether it serves this gRPC service.
///
/// # Errors
/// When it does not, or does not answer within some seconds.
pub fn check<'a>(
    address: &'a str,
    service: &'static str,
    security: &'a ClientSecurity,
) -> Pin<Box<dyn Future<Output = Result<(), HealthError>> + Send + 'a>> {
    // Boxed, it is compiled here once, and not wherever it is awaited.
    Box::pin(check_within_patience(address, service, security))
}

async fn check_within_patience(
    address: &str,
    service: &'static str,
    security: &ClientSecurity,
) -> Result<(), HealthError> {
    let unreachable = |reason: String| HealthError::Unreachable { service, address: address.into(), reason };
    let asking = async {
        let unknown = |reason: String| HealthError::Name { address: address.into(), reason };
        let mut sockets = lookup_host(address).await.map_err(|error| unknown(error.to_string()))?;
        let socket = sockets.next().ok_or_else(|| unknown("it has no address".into()))?;
        let endpoint = security.endpoint(address, socket)?;
        let way = network::way(Arc::new(Sockets), socket);
        let channel = network::connect(&endpoint, way).await.map_err(|error| unreachable(reason(&error)))?;
        let mut client = HealthClient::with_interceptor(channel, security.credentials());
        let request = HealthCheckRequest { service: service.into() };
        let answer = client.check(request).await.map_err(|status| unreachable(words(&status)))?;
        match answer.into_inner().status() {
            Answer::Serving => Ok(()),
            _ => Err(HealthError::Draining { address: address.into() }),
        }
    };
    timeout(PATIENCE, asking).await.unwrap_or_else(|_| Err(unreachable("it takes too long".into())))
}

fn words(status: &Status) -> String {
    explain(status).unwrap_or_else(|| status.message().into())
}

fn reason(error: &(dyn std::error::Error + 'static)) -> String {
    explain(error).unwrap_or_else(|| {
        let mut innermost = error;
        while let Some(source) = innermost.source() {
            innermost = source;
        }
        innermost.to_string()
    })
}
