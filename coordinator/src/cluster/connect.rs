//! Connections to workers, up to both hellos.

use std::io;
use std::net::SocketAddr;
use std::num::NonZeroUsize;
use std::time::Duration;

use hyper_util::rt::TokioIo;
use shared::protocol::coordinator_message::Body as Outgoing;
use shared::protocol::worker_client::WorkerClient;
use shared::protocol::worker_message::Body as Incoming;
use shared::protocol::{
    CoordinatorHello, CoordinatorMessage, MAX_MESSAGE_BYTES, PROTOCOL_VERSION, WorkerHello, WorkerMessage,
};
use tokio::io::DuplexStream;
use tokio::net::lookup_host;
use tokio::sync::mpsc;
use tokio::time::timeout;
use tokio_stream::StreamExt;
use tokio_stream::wrappers::UnboundedReceiverStream;
use tokio_util::sync::CancellationToken;
use tonic::Streaming;
use tonic::transport::{Channel, Endpoint, Uri};
use tower::service_fn;
use worker::Settings;

use super::ClusterError;
use super::error::{innermost, words};

/// How long a worker may take from the first packet to its hello.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// A machine that vanishes is noticed after about the sum of the two.
const KEEP_ALIVE_INTERVAL: Duration = Duration::from_secs(1);
const KEEP_ALIVE_TIMEOUT: Duration = Duration::from_secs(2);

/// Bytes of rows that may be on their way on one connection.
const CONNECTION_WINDOW: u32 = 16 << 20;

/// Bytes that an embedded worker's connection holds.
const MEMORY_BUFFER: usize = 1 << 20;

/// A worker that said hello.
pub(super) struct Connection {
    /// Where it is, for messages.
    pub address: String,
    /// What it said.
    pub hello: WorkerHello,
    /// Its half of the session.
    pub inbound: Streaming<WorkerMessage>,
    /// Our half of the session. Unbounded: what it holds is bounded by the jobs that a worker may have under way.
    pub outbound: mpsc::UnboundedSender<CoordinatorMessage>,
    /// Uploads have a connection of their own: an upload that the worker is slow to read would hold up all other messages.
    pub uploads: WorkerClient<Channel>,
    /// Whether the worker can fall silent while this process lives on.
    pub remote: bool,
}

/// Dials a worker. A name stands for all the machines that it resolves to: each is a worker.
pub(super) async fn dial(address: &str) -> Result<Vec<Connection>, ClusterError> {
    let unreachable = |reason: String| ClusterError::Unreachable { address: String::from(address), reason };
    let well_formed = address.rsplit_once(':').is_some_and(|(host, port)| {
        !host.is_empty() && !host.contains('/') && port.parse().is_ok_and(|port: u16| port > 0)
    });
    if !well_formed {
        return Err(ClusterError::Address { address: address.into() });
    }
    let resolved = timeout(CONNECT_TIMEOUT, lookup_host(address))
        .await
        .map_err(|_| unreachable("the name server does not answer".into()))?
        .map_err(|error| unreachable(error.to_string()))?;
    let (v4, v6): (Vec<SocketAddr>, Vec<SocketAddr>) = resolved.partition(SocketAddr::is_ipv4);
    let mut first_error = None;
    // A machine often has an address of both kinds, and is one worker all the same.
    for family in [v4, v6].into_iter().filter(|family| !family.is_empty()) {
        match dial_all(address, &family).await {
            Err(error @ ClusterError::Unreachable { .. }) => {
                first_error.get_or_insert(error);
            }
            outcome => return outcome,
        }
    }
    Err(first_error.unwrap_or_else(|| unreachable("the name has no address".into())))
}

async fn dial_all(given: &str, family: &[SocketAddr]) -> Result<Vec<Connection>, ClusterError> {
    let mut connections = vec![];
    for socket in family {
        let socket = socket.to_string();
        let address = if socket == given { socket.clone() } else { format!("{given} ({socket})") };
        // A socket address is a valid authority.
        let endpoint = Endpoint::from_shared(format!("http://{socket}"))
            .map_err(|_| ClusterError::Address { address: given.into() })?
            .tcp_nodelay(true)
            .http2_keep_alive_interval(KEEP_ALIVE_INTERVAL)
            .keep_alive_timeout(KEEP_ALIVE_TIMEOUT)
            .keep_alive_while_idle(true);
        let endpoint = with_limits(endpoint);
        let channel = endpoint.connect().await.map_err(|error| ClusterError::Unreachable {
            address: address.clone(),
            reason: innermost(&error),
        })?;
        connections.push(greet(address, channel, endpoint.connect_lazy(), true).await?);
    }
    Ok(connections)
}

/// Starts a worker in this process, which serves until `shutdown` is cancelled, and connects to it through memory.
pub(super) async fn embed(
    threads: NonZeroUsize,
    shutdown: CancellationToken,
) -> Result<Connection, ClusterError> {
    let (dialled, accepted) = mpsc::unbounded_channel::<DuplexStream>();
    let settings = Settings { name: "embedded".into(), threads, replica_bytes: u64::MAX };
    let incoming = UnboundedReceiverStream::new(accepted).map(Ok::<_, io::Error>);
    let serving = tokio::spawn(worker::serve(incoming, settings, shutdown));

    let connector = move |_: Uri| {
        let (near, far) = tokio::io::duplex(MEMORY_BUFFER);
        let accepted = dialled.send(far).map_err(|_| io::Error::other("the embedded worker has ended"));
        async move { accepted.map(|()| TokioIo::new(near)) }
    };
    // The address is never looked up: the connector knows only one place.
    let endpoint = with_limits(Endpoint::from_static("http://embedded"));
    let channel = endpoint.connect_with_connector_lazy(service_fn(connector.clone()));
    let uploads = endpoint.connect_with_connector_lazy(service_fn(connector));
    tokio::select! {
        connection = greet("this process".into(), channel, uploads, false) => connection,
        // Before its shutdown it ends only when it cannot start.
        Ok(Err(error)) = serving => Err(ClusterError::Start(error.to_string())),
    }
}

fn with_limits(endpoint: Endpoint) -> Endpoint {
    endpoint
        .connect_timeout(CONNECT_TIMEOUT)
        .initial_connection_window_size(CONNECTION_WINDOW)
        .initial_stream_window_size(CONNECTION_WINDOW)
}

fn client(channel: Channel) -> WorkerClient<Channel> {
    WorkerClient::new(channel)
        .max_decoding_message_size(MAX_MESSAGE_BYTES)
        .max_encoding_message_size(MAX_MESSAGE_BYTES)
}

/// Opens the session and exchanges hellos.
async fn greet(
    address: String,
    channel: Channel,
    uploads: Channel,
    remote: bool,
) -> Result<Connection, ClusterError> {
    let (outbound, messages) = mpsc::unbounded_channel();
    let hello = CoordinatorHello {
        protocol_version: PROTOCOL_VERSION,
        name: format!("coordinator {}", std::process::id()),
    };
    // The receiving end is in scope.
    let _ = outbound.send(CoordinatorMessage { body: Some(Outgoing::Hello(hello)) });
    let refused = |reason: String| ClusterError::Refused { address: address.clone(), reason };
    let opening = async {
        let session = client(channel).session(UnboundedReceiverStream::new(messages)).await;
        let mut inbound = session.map_err(|status| refused(words(&status)))?.into_inner();
        let first = inbound.message().await.map_err(|status| refused(words(&status)))?;
        let Some(Incoming::Hello(hello)) = first.and_then(|message| message.body) else {
            return Err(refused("it does not say hello".into()));
        };
        Ok((inbound, hello))
    };
    let (inbound, hello) = timeout(CONNECT_TIMEOUT, opening).await.map_err(|_| {
        ClusterError::Unreachable { address: address.clone(), reason: "it does not say hello in time".into() }
    })??;
    if hello.protocol_version != PROTOCOL_VERSION {
        let (theirs, ours) = (hello.protocol_version, PROTOCOL_VERSION);
        return Err(ClusterError::Version { address, theirs, ours });
    }
    if hello.threads == 0 {
        return Err(refused("it has no threads".into()));
    }
    Ok(Connection { address, hello, inbound, outbound, uploads: client(uploads), remote })
}
