//! Connections from outside, up to the point where HTTP begins: how many, how long they may take, and who they are.
//!
//! | module | what lives there |
//! |---|---|
//! | `connection` | one connection, which ends by itself when nothing comes |
//! | `places` | how many there may be, and who gives way |
//!
//! Until a connection has proved who it is, it costs a place that it loses to the next who needs it, and the few kilobytes of a
//! handshake, for some seconds.

mod connection;
mod places;

use std::io;
use std::net::SocketAddr;
use std::time::Duration;

use protocol::security::{Caller, Tls};
use protocol::server::{Accepted, Incoming};
use tokio::io::{AsyncWriteExt, copy, sink};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::mpsc;
use tokio::task::spawn_blocking;
use tokio::time::{sleep, timeout};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::server::TlsStream;
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::either::Either;

use connection::Connection;
use places::{Place, Places};

/// What connections may take, all of them together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConnectionLimits {
    /// Connections at the same time.
    pub connections: usize,
    /// How long one may be silent, in both directions.
    pub silence: Duration,
    /// Whether callers show a token; else a certificate is enough, and without encryption all are trusted.
    pub token: bool,
}

impl ConnectionLimits {
    /// Those of a worker. A coordinator has two connections, so this is more than a worker is ever shared by; and the server asks for
    /// a sign of life three times while one is silent.
    pub const WORKER: Self = Self { connections: 32, silence: Duration::from_secs(30), token: false };
}

/// How long a caller may take to prove who it is.
const HANDSHAKE: Duration = Duration::from_secs(2);

/// How long a caller that was refused may take to hear it.
const FAREWELL: Duration = Duration::from_secs(1);

/// Pause after the system refuses a connection, as when there are no file descriptors left: asking again at once would keep a
/// core busy.
const PAUSE: Duration = Duration::from_millis(100);

/// Takes connections for as long as the stream is held. Where certificates are demanded, only those that have one of the same
/// authority come out of it; the others are logged. Changed files count for the connections after.
///
/// Must be called within a runtime.
pub fn incoming(listener: TcpListener, tls: Option<Tls>, limits: ConnectionLimits) -> Incoming {
    let (admitted, connections) = mpsc::channel(limits.connections);
    tokio::spawn(accept(listener, tls, limits, admitted));
    Box::pin(ReceiverStream::new(connections))
}

type Admitted = mpsc::Sender<io::Result<Box<dyn Accepted>>>;

async fn accept(listener: TcpListener, tls: Option<Tls>, limits: ConnectionLimits, admitted: Admitted) {
    let places = Places::new(limits.connections);
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            () = admitted.closed() => return,
        };
        match accepted {
            Ok((socket, peer)) => {
                let caller = Caller::new(Some(peer));
                if tls.is_none() && !limits.token {
                    caller.trust();
                }
                // Closing it tells the caller sooner than letting it wait.
                let Some(place) = places.take(&caller) else {
                    tracing::warn!(%peer, most = limits.connections, "too many connections: refused one");
                    continue;
                };
                let (tls, admitted) = (tls.clone(), admitted.clone());
                let lost = place.lost();
                let arrival = Arrival { socket, peer, caller, place };
                tokio::spawn(async move {
                    tokio::select! {
                        () = admit(arrival, tls, limits, admitted) => {}
                        () = lost => tracing::warn!(%peer, "refused a connection: others need its place"),
                    }
                });
            }
            Err(error) => {
                tracing::warn!(%error, "cannot take a connection");
                sleep(PAUSE).await;
            }
        }
    }
}

/// A connection of which nothing has been read.
struct Arrival {
    socket: TcpStream,
    peer: SocketAddr,
    caller: Caller,
    place: Place,
}

async fn admit(arrival: Arrival, tls: Option<Tls>, limits: ConnectionLimits, admitted: Admitted) {
    let Arrival { socket, peer, caller, place } = arrival;
    // Without it messages wait for each other; a socket that refuses is about to end.
    let _ = socket.set_nodelay(true);
    let bytes = match tls {
        None => Either::Left(socket),
        Some(tls) => match timeout(HANDSHAKE, shake_hands(tls, socket)).await {
            Ok(Ok(encrypted)) => {
                if !limits.token {
                    caller.trust();
                }
                Either::Right(Box::new(encrypted))
            }
            Ok(Err((error, socket))) => {
                let reason = protocol::security::explain(&error).unwrap_or_else(|| error.to_string());
                tracing::warn!(%peer, reason, "refused a connection");
                return hang_up(socket).await;
            }
            Err(_) => return tracing::warn!(%peer, "refused a connection: its handshake takes too long"),
        },
    };
    // Nobody takes it where the worker has stopped meanwhile.
    let _ = admitted.send(Ok(Box::new(Connection::new(bytes, caller, place, limits.silence)))).await;
}

/// Encrypts a connection with the certificates as their files have them now.
async fn shake_hands(tls: Tls, socket: TcpStream) -> Result<TlsStream<TcpStream>, (io::Error, TcpStream)> {
    // A slow disk holds nobody up but this caller.
    let server = match spawn_blocking(move || tls.server()).await {
        Ok(Ok(server)) => server,
        Ok(Err(error)) => return Err((io::Error::other(error), socket)),
        Err(_) => return Err((io::Error::other("the certificates cannot be read"), socket)),
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
