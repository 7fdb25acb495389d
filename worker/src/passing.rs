//! Passes a replica on to another worker, as a coordinator would send it.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use kernel::replica::Digest;
use protocol::network::{self, Network};
use protocol::replicas::{chunks, client};
use protocol::security::ClientSecurity;
use protocol::worker::{PassOutcome, PassReplica, ReplicaPassed};
use tokio::time::timeout;
use tonic::Status;

use crate::store::Parcel;

/// How long another worker may take to take the connection. Where a firewall swallows it, the coordinator sends the replica by then.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(1);

/// Time limit of an upload, plus a second for each [`SLOWEST_BYTES`]. The coordinator gives it up sooner.
const TIMEOUT: Duration = Duration::from_secs(30);
const SLOWEST_BYTES: u64 = 1_000_000;

/// Network and security of calls to other workers.
#[derive(Clone)]
pub struct Passing {
    /// How they are reached.
    pub network: Arc<dyn Network>,
    /// Certificates and token, as a coordinator shows them.
    pub security: ClientSecurity,
}

impl std::fmt::Debug for Passing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Passing").field("security", &self.security).finish_non_exhaustive()
    }
}

/// Why a replica was not passed on.
#[derive(Debug, thiserror::Error)]
enum PassError {
    #[error("{0:?} is not the address of a worker")]
    Address(String),
    #[error(transparent)]
    Insecure(#[from] protocol::security::SecurityError),
    #[error("it does not take the connection: {0}")]
    Unreachable(#[from] tonic::transport::Error),
    #[error("it takes longer than {} s", .0.as_secs())]
    Slow(Duration),
    #[error("{}", .0.message())]
    Refused(#[from] Status),
    #[error("it says that it holds another replica")]
    Mixed,
}

impl Passing {
    /// Passes a replica on, where it is held, and tells how that went.
    pub(crate) async fn pass(self, order: PassReplica, parcel: Option<Parcel>) -> ReplicaPassed {
        let PassReplica { number, digest, .. } = &order;
        let (number, digest) = (*number, digest.clone());
        let answer = |outcome: PassOutcome, message| ReplicaPassed {
            number,
            digest: digest.clone(),
            outcome: outcome.into(),
            message,
        };
        let Some(parcel) = parcel else { return answer(PassOutcome::NotHeld, String::new()) };
        match self.send(&order, parcel).await {
            Ok(()) => answer(PassOutcome::Done, String::new()),
            Err(error) => answer(PassOutcome::Failed, format!("worker at {}: {error}", order.address)),
        }
    }

    async fn send(&self, order: &PassReplica, Parcel { mut header, bytes }: Parcel) -> Result<(), PassError> {
        let address = &order.address;
        let socket: SocketAddr = address.parse().map_err(|_| PassError::Address(address.clone()))?;
        header.passed_to = order.instance;
        let endpoint = self.security.endpoint(&order.name, socket)?;
        let way = network::way(Arc::clone(&self.network), socket);
        let limit = TIMEOUT + Duration::from_secs(header.length / SLOWEST_BYTES);
        let connecting = timeout(CONNECT_TIMEOUT, network::connect(&endpoint, way));
        let channel = connecting.await.map_err(|_| PassError::Slow(CONNECT_TIMEOUT))??;
        let mut client = client(channel, self.security.credentials());
        let loading = client.load_replica(tokio_stream::iter(chunks(header, bytes)));
        let reply = timeout(limit, loading).await.map_err(|_| PassError::Slow(limit))??.into_inner();
        match Digest::try_from(reply.digest.as_ref()) {
            Ok(theirs) if theirs.to_bytes() == order.digest => Ok(()),
            _ => Err(PassError::Mixed),
        }
    }
}
