//! Connections to workers, up to both hellos.

use std::io;
use std::net::SocketAddr;
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Duration;

use kernel::row::ROW_VERSION;
use protocol::network::{self, ByteStream, Line, Network, Way};
use protocol::replicas::client;
use protocol::security::{ClientSecurity, Credentials, SecuredChannel, explain};
use protocol::server;
use protocol::worker::coordinator_message::Body as Outgoing;
use protocol::worker::worker_client::WorkerClient;
use protocol::worker::worker_message::Body as Incoming;
use protocol::worker::{
    CoordinatorHello, CoordinatorMessage, PROTOCOL_VERSION, WorkerHello, WorkerMessage, check_versions,
};
use tokio::io::DuplexStream;
use tokio::sync::mpsc;
use tokio::time::timeout;
use tokio_stream::StreamExt;
use tokio_stream::wrappers::UnboundedReceiverStream;
use tokio_util::sync::CancellationToken;
use tonic::Streaming;
use tonic::transport::Endpoint;
use worker::Settings;

use super::error::{ClusterError, is_refusal, reason, words};

/// Time limit for a worker to accept a connection, and again to say hello.
pub(super) const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// Times that an encrypted connection is tried again if it closes before the worker says hello. With TLS 1.3 a refused certificate is
/// told only then, and the alert may get lost when the connection closes.
const ALERT_RETRIES: u32 = 3;

/// Bytes in flight on one connection.
const CONNECTION_WINDOW: u32 = 16 << 20;

/// Largest HTTP/2 frame from a worker, in bytes: the rows of a job in one frame are copied once less than in many.
const LARGEST_FRAME: u32 = 1 << 20;

/// Buffer of an embedded worker's connection, in bytes.
const MEMORY_BUFFER: usize = 1 << 20;

/// Name of this process's worker in messages.
pub(super) const EMBEDDED: &str = "this process";

/// A worker that said hello.
pub(super) struct Connection {
    /// Its place, for messages.
    pub address: String,
    /// Its first message.
    pub hello: WorkerHello,
    /// Messages from it.
    pub inbound: Streaming<WorkerMessage>,
    /// Messages to it. Unbounded: the jobs that a worker may hold bound them.
    pub outbound: mpsc::UnboundedSender<CoordinatorMessage>,
    /// Connection for uploads, which would hold up other messages on the same one.
    pub uploads: WorkerClient<SecuredChannel>,
    /// Whether it can fall silent while this process lives.
    pub remote: bool,
    /// Where other workers reach it.
    pub peer: Option<Peer>,
}

/// A worker as others dial it.
#[derive(Debug, Clone)]
pub(super) struct Peer {
    /// Name that its certificate must have.
    pub name: String,
    /// Address, as this process dials it.
    pub socket: SocketAddr,
    /// The number in its hello: at the same address another worker may answer, seen from elsewhere.
    pub instance: u64,
}

/// Checks that an address has the form `host:port`.
pub(super) fn check_name(address: &str) -> Result<(), ClusterError> {
    let well_formed = address.rsplit_once(':').is_some_and(|(host, port)| {
        !host.is_empty() && !host.contains('/') && port.parse().is_ok_and(|port: u16| port > 0)
    });
    if well_formed { Ok(()) } else { Err(ClusterError::Address { address: address.into() }) }
}

/// Dials one of the machines behind the name `given`.
pub(super) async fn dial(
    network: &Arc<dyn Network>,
    security: &ClientSecurity,
    given: &str,
    socket: SocketAddr,
) -> Result<Connection, ClusterError> {
    let address = place(given, socket);
    let endpoint = security
        .endpoint(given, socket)
        .map_err(|error| ClusterError::Insecure { address: address.clone(), reason: error.to_string() })?;
    let endpoint = with_limits(endpoint);
    let way = network::way(Arc::clone(network), socket);
    let unreachable = |reason| ClusterError::Unreachable { address: address.clone(), reason };
    let plain = security.transport.tls().is_none();
    let mut retries = ALERT_RETRIES;
    loop {
        let connect = || network::connect(&endpoint, Arc::clone(&way));
        // Uploads connect now, too: at the first upload the certificates of this endpoint may have been replaced.
        let connecting = async { tokio::try_join!(connect(), connect()) };
        let (channel, uploads) = timeout(CONNECT_TIMEOUT, connecting)
            .await
            .map_err(|_| unreachable("it does not take the connection in time".into()))?
            .map_err(|error| match explain(&error) {
                Some(reason) => ClusterError::Insecure { address: address.clone(), reason },
                None => unreachable(reason(&error)),
            })?;
        let greeting = greet(address.clone(), channel, uploads, security.credentials(), true);
        let answer = match timeout(CONNECT_TIMEOUT, greeting).await {
            // The next connection may last until its alert is read. A silent worker sends none.
            Ok(Err(ClusterError::Unreachable { .. })) if !plain && retries > 0 => {
                retries -= 1;
                continue;
            }
            Ok(answer) => answer,
            Err(_) => Err(silent(&address)),
        };
        let answer = answer.map(|connection| {
            let name = security.server_name.as_deref().unwrap_or(given).into();
            let passes = connection.hello.passes_replicas;
            let peer = passes.then_some(Peer { name, socket, instance: connection.hello.instance });
            Connection { peer, ..connection }
        });
        return if plain { answer.map_err(with_certificates_in_mind) } else { answer };
    }
}

/// A worker with certificates hangs up on plain text, and its alert may be lost on the way.
fn with_certificates_in_mind(error: ClusterError) -> ClusterError {
    match error {
        ClusterError::Unreachable { address, reason } => {
            let reason = format!("{reason} (one with certificates takes --tls-ca, --tls-cert and --tls-key)");
            ClusterError::Unreachable { address, reason }
        }
        other => other,
    }
}

/// The worker does not say hello in time.
fn silent(address: &str) -> ClusterError {
    ClusterError::Unreachable { address: address.into(), reason: "it does not say hello in time".into() }
}

/// Name of a worker in messages: as the user gave it, with the machine's address.
pub(super) fn place(given: &str, socket: SocketAddr) -> String {
    let socket = socket.to_string();
    if socket == given { socket } else { format!("{given} ({socket})") }
}

/// Whether a [`place`] is a name or one of the machines behind it.
pub(super) fn is_at(place: &str, name: &str) -> bool {
    place.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with(" ("))
}

/// Starts a worker in this process, which serves until `shutdown` is cancelled, and connects to it through memory.
pub(super) async fn embed(
    threads: NonZeroUsize,
    shutdown: CancellationToken,
) -> Result<Connection, ClusterError> {
    let (dialled, accepted) = mpsc::unbounded_channel::<DuplexStream>();
    let settings = Settings { replica_bytes: u64::MAX, ..Settings::new("embedded", threads) };
    let incoming = server::unwatched(UnboundedReceiverStream::new(accepted).map(Ok));
    let serving = tokio::spawn(worker::serve(incoming, settings, shutdown));

    let way: Way = Arc::new(move || {
        let (near, far) = tokio::io::duplex(MEMORY_BUFFER);
        let accepted = dialled.send(far).map_err(|_| io::Error::other("the embedded worker has ended"));
        Box::pin(async move { accepted.map(|()| Box::new(near) as Box<dyn ByteStream>) })
    });
    // The address is never looked up: the way leads to only one place.
    let endpoint = with_limits(Endpoint::from_static("http://embedded"));
    let channel = network::connect_lazily(&endpoint, Arc::clone(&way));
    let uploads = network::connect_lazily(&endpoint, way);
    let greeting = greet(EMBEDDED.into(), channel, uploads, Credentials::default(), false);
    tokio::select! {
        answer = timeout(CONNECT_TIMEOUT, greeting) => answer.unwrap_or_else(|_| Err(silent(EMBEDDED))),
        // Before its shutdown it ends only when it cannot start.
        Ok(Err(error)) = serving => Err(ClusterError::Start(error.to_string())),
    }
}

fn with_limits(endpoint: Endpoint) -> Endpoint {
    endpoint
        .initial_connection_window_size(CONNECTION_WINDOW)
        .initial_stream_window_size(CONNECTION_WINDOW)
        .max_frame_size(LARGEST_FRAME)
}

/// Opens the session and exchanges hellos. Callers limit its time.
async fn greet(
    address: String,
    channel: Line,
    uploads: Line,
    credentials: Credentials,
    remote: bool,
) -> Result<Connection, ClusterError> {
    let (outbound, messages) = mpsc::unbounded_channel();
    let hello = CoordinatorHello {
        protocol_version: PROTOCOL_VERSION,
        name: format!("coordinator {}", std::process::id()),
        row_version: ROW_VERSION,
    };
    // The receiving end is in scope.
    let _ = outbound.send(CoordinatorMessage { body: Some(Outgoing::Hello(hello)) });
    let unreachable = |reason: String| ClusterError::Unreachable { address: address.clone(), reason };
    let refused = |reason: String| ClusterError::Refused { address: address.clone(), reason };
    let failed = |status: tonic::Status| match explain(&status) {
        Some(reason) => ClusterError::Insecure { address: address.clone(), reason },
        None if is_refusal(&status) => refused(words(&status)),
        None => unreachable(words(&status)),
    };
    let session = client(channel, credentials.clone()).session(UnboundedReceiverStream::new(messages)).await;
    let mut inbound = session.map_err(failed)?.into_inner();
    let hello = match inbound.message().await.map_err(failed)?.map(|message| message.body) {
        Some(Some(Incoming::Hello(hello))) => hello,
        Some(_) => return Err(refused("it does not say hello".into())),
        None => return Err(unreachable("it ends the session before its hello".into())),
    };
    if let Err(mismatch) = check_versions("coordinator", hello.protocol_version, hello.row_version) {
        return Err(ClusterError::Version { address, mismatch });
    }
    if hello.threads == 0 {
        return Err(refused("it has no threads".into()));
    }
    let uploads = client(uploads, credentials);
    Ok(Connection { address, hello, inbound, outbound, uploads, remote, peer: None })
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use protocol::security::{Tls, TlsFiles, Transport};
    use tokio_rustls::TlsAcceptor;

    use super::*;
    use protocol::network::Answer;

    /// A worker that shakes hands and then hangs up or stays silent.
    struct Mute {
        tls: Tls,
        hangs_up: bool,
        connections: Mutex<u32>,
    }

    impl Network for Mute {
        fn resolve(&self, _: &str) -> Answer<Vec<SocketAddr>> {
            unreachable!("a socket address is dialled")
        }

        fn connect(&self, _: SocketAddr) -> Answer<Box<dyn ByteStream>> {
            *self.connections.lock().unwrap() += 1;
            let (near, far) = tokio::io::duplex(MEMORY_BUFFER);
            let (acceptor, hangs_up) = (TlsAcceptor::from(self.tls.server().unwrap()), self.hangs_up);
            tokio::spawn(async move {
                let _stream = acceptor.accept(far).await.unwrap();
                if !hangs_up {
                    std::future::pending::<()>().await;
                }
            });
            Box::pin(async move { Ok(Box::new(near) as Box<dyn ByteStream>) })
        }
    }

    /// Dials a mute worker: the connections that it takes, and the error.
    async fn dial_mute(hangs_up: bool) -> (u32, String) {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: String| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let own = rcgen::generate_simple_self_signed(["worker".into()]).unwrap();
        let certificate = write("certificate", own.cert.pem());
        let key = write("key", own.signing_key.serialize_pem());
        let tls = TlsFiles { ca: certificate.clone(), certificate, key }.load().unwrap();
        let security = ClientSecurity { transport: Transport::Tls(tls.clone()), ..ClientSecurity::default() };
        let worker = Arc::new(Mute { tls, hangs_up, connections: Mutex::default() });
        let network: Arc<dyn Network> = Arc::<Mute>::clone(&worker);
        let socket = "127.0.0.1:7070".parse().unwrap();
        let error = dial(&network, &security, "worker:7070", socket).await.err().unwrap();
        (*worker.connections.lock().unwrap(), error.to_string())
    }

    #[tokio::test(start_paused = true)]
    async fn only_a_closed_connection_is_tried_again() {
        let (connections, error) = dial_mute(false).await;
        // One for the session and one for uploads.
        assert!(connections == 2 && error.contains("hello in time"), "{connections} connections: {error}");
        let (connections, error) = dial_mute(true).await;
        assert!(
            connections > 2 * ALERT_RETRIES && error.contains("closed"),
            "{connections} connections: {error}"
        );
    }
}
