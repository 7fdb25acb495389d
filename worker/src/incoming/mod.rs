//! Connections from outside, up to the point where HTTP begins: how many, how long they may take, and who they are.
//!
//! | module | what lives there |
//! |---|---|
//! | `connection` | one connection, which ends by itself when nothing comes |
//!
//! Until a connection has proved who it is, it costs a place and the few kilobytes of a handshake, for some seconds.

mod connection;

use std::convert::Infallible;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use protocol::security::Tls;
use tokio::io::{AsyncWriteExt, copy, sink};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};
use tokio::task::spawn_blocking;
use tokio::time::{sleep, timeout};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::server::TlsStream;
use tokio_stream::Stream;
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::either::Either;
use tonic::transport::server::Connected;

pub use connection::Connection;

/// What connections may take, all of them together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConnectionLimits {
    /// Connections at the same time.
    pub connections: usize,
    /// How long one may be silent, in both directions.
    pub silence: Duration,
}

impl ConnectionLimits {
    /// Those of a worker. A coordinator has two connections, so this is more than a worker is ever shared by; and the server asks for
    /// a sign of life three times while one is silent.
    pub const WORKER: Self = Self { connections: 32, silence: Duration::from_secs(30) };
}

/// How long a caller may take to prove who it is.
const HANDSHAKE: Duration = Duration::from_secs(10);

/// How long a caller that was refused may take to hear it.
const FAREWELL: Duration = Duration::from_secs(1);

/// Pause after the system refuses a connection, as when there are no file descriptors left: asking again at once would keep a
/// core busy.
const PAUSE: Duration = Duration::from_millis(100);

/// Takes connections for as long as the stream is held. With certificates, only those that have one of the same authority
/// come out of it; the others are logged. Changed files count for the connections after.
///
/// Must be called within a runtime.
pub fn incoming(
    listener: TcpListener,
    tls: Option<Tls>,
    limits: ConnectionLimits,
) -> impl Stream<Item = Result<Connection, Infallible>> {
    let (admitted, connections) = mpsc::channel(limits.connections);
    tokio::spawn(accept(listener, tls, limits, admitted));
    ReceiverStream::new(connections)
}

type Admitted = mpsc::Sender<Result<Connection, Infallible>>;

async fn accept(listener: TcpListener, tls: Option<Tls>, limits: ConnectionLimits, admitted: Admitted) {
    let places = Arc::new(Semaphore::new(limits.connections));
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            () = admitted.closed() => return,
        };
        match accepted {
            Ok((socket, peer)) => match Arc::clone(&places).try_acquire_owned() {
                Ok(place) => {
                    let (tls, admitted) = (tls.clone(), admitted.clone());
                    tokio::spawn(admit(socket, peer, tls, place, limits.silence, admitted));
                }
                // Closing it tells the caller sooner than letting it wait.
                Err(_) => {
                    tracing::warn!(%peer, most = limits.connections, "too many connections: refused one")
                }
            },
            Err(error) => {
                tracing::warn!(%error, "cannot take a connection");
                sleep(PAUSE).await;
            }
        }
    }
}

async fn admit(
    socket: TcpStream,
    peer: SocketAddr,
    tls: Option<Tls>,
    place: OwnedSemaphorePermit,
    silence: Duration,
    admitted: Admitted,
) {
    // Without it messages wait for each other; a socket that refuses is about to end.
    let _ = socket.set_nodelay(true);
    let info = socket.connect_info();
    let bytes = match tls {
        None => Either::Left(socket),
        Some(tls) => match timeout(HANDSHAKE, shake_hands(tls, socket)).await {
            Ok(Ok(encrypted)) => Either::Right(Box::new(encrypted)),
            Ok(Err((error, socket))) => {
                let reason = protocol::security::explain(&error).unwrap_or_else(|| error.to_string());
                tracing::warn!(%peer, reason, "refused a connection");
                return hang_up(socket).await;
            }
            Err(_) => return tracing::warn!(%peer, "refused a connection: its handshake takes too long"),
        },
    };
    // Nobody takes it where the worker has stopped meanwhile.
    let _ = admitted.send(Ok(Connection::new(bytes, info, place, silence))).await;
}

/// Encrypts a connection with the certificates as their files have them now.
async fn shake_hands(tls: Tls, socket: TcpStream) -> Result<TlsStream<TcpStream>, (io::Error, TcpStream)> {
    // A slow disk holds nobody up but this caller.
    let Ok(server) = spawn_blocking(move || tls.server()).await else {
        return Err((io::Error::other("the certificates cannot be read"), socket));
    };
    TlsAcceptor::from(server).accept(socket).into_fallible().await
}

/// Ends a refused connection so that the caller hears why: closing it with bytes unread would take back what was sent last.
async fn hang_up(mut socket: TcpStream) {
    let listening = async {
        socket.shutdown().await?;
        copy(&mut socket, &mut sink()).await
    };
    // The caller may take its leave as it likes.
    let _ = timeout(FAREWELL, listening).await;
}
