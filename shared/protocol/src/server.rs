//! Connections, their limits, and shutdown, for all servers.

use std::io;
use std::pin::Pin;
use std::time::Duration;

use tokio::signal::unix::{SignalKind, signal};
use tokio_stream::{Stream, StreamExt};
use tokio_util::sync::CancellationToken;
use tonic::service::Routes;
use tonic::transport::server::Connected;
use tonic::transport::{Error, Server};

use crate::network::ByteStream;
use crate::security::Caller;

/// Exit status after a second signal, as shells have it for SIGINT.
const INTERRUPTED: i32 = 130;

/// Limits of one connection to a server.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConnectionBounds {
    /// Bytes that may be on their way to the server, on one connection: an upload then does not wait for each piece to be
    /// acknowledged.
    pub connection_window: u32,
    /// The same for one call. Smaller, so that an upload cannot use up the window of its whole connection.
    pub call_window: u32,
    /// Calls at the same time.
    pub calls: u32,
    /// Largest headers of a call, in bytes.
    pub header_bytes: u32,
    /// Interval of keep-alives to a quiet client, and the time it has to answer.
    pub keep_alive: Duration,
}

impl ConnectionBounds {
    /// Builds a server with these limits.
    #[must_use]
    pub fn server(&self) -> Server {
        Server::builder()
            .initial_connection_window_size(self.connection_window)
            .initial_stream_window_size(self.call_window)
            .http2_keepalive_interval(Some(self.keep_alive))
            .http2_keepalive_timeout(Some(self.keep_alive))
            .http2_max_header_list_size(self.header_bytes)
            .max_concurrent_streams(self.calls)
    }
}

/// A connection to a server: a socket, memory or a simulation. Servers take it boxed, whatever it is: each type would have a server
/// compiled for it.
pub trait Accepted: ByteStream {
    /// Who is at the other end.
    fn caller(&self) -> Caller;
}

/// One of which nothing is known.
impl Accepted for Box<dyn ByteStream> {
    fn caller(&self) -> Caller {
        Caller::new(None)
    }
}

impl Connected for Box<dyn Accepted> {
    type ConnectInfo = Caller;

    fn connect_info(&self) -> Caller {
        self.caller()
    }
}

/// Connections as they come.
pub type Incoming = Pin<Box<dyn Stream<Item = io::Result<Box<dyn Accepted>>> + Send>>;

/// Connections of callers of whom nothing is known.
pub fn unwatched<T: ByteStream + 'static>(
    streams: impl Stream<Item = io::Result<T>> + Send + 'static,
) -> Incoming {
    let accepted = |stream| Box::new(Box::new(stream) as Box<dyn ByteStream>) as Box<dyn Accepted>;
    Box::pin(streams.map(move |stream| stream.map(accepted)))
}

/// Serves these connections until the token is cancelled and their calls have ended. Boxed, the future is compiled here once, and not
/// wherever it is awaited.
///
/// # Errors
/// When the server fails.
pub fn serve(
    mut server: Server,
    routes: Routes,
    incoming: Incoming,
    drained: CancellationToken,
) -> Pin<Box<dyn Future<Output = Result<(), Error>> + Send>> {
    Box::pin(server.add_routes(routes).serve_with_incoming_shutdown(incoming, drained.cancelled_owned()))
}

/// Returns a token that the first SIGTERM or SIGINT cancels; `meaning` is logged then. A second one ends the process at once.
///
/// Call it within a runtime.
///
/// # Errors
/// When signals cannot be listened for.
pub fn stop_on_signal(meaning: &'static str) -> io::Result<CancellationToken> {
    let mut terminate = signal(SignalKind::terminate())?;
    let mut interrupt = signal(SignalKind::interrupt())?;
    let shutdown = CancellationToken::new();
    let cancelled = shutdown.clone();
    tokio::spawn(async move {
        for last in [false, true] {
            tokio::select! {
                _ = terminate.recv() => {}
                _ = interrupt.recv() => {}
            }
            if last {
                std::process::exit(INTERRUPTED);
            }
            tracing::info!("{meaning}");
            cancelled.cancel();
        }
    });
    Ok(shutdown)
}
