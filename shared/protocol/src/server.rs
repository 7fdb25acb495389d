//! Connections, their limits, and shutdown, for all servers.

use std::io;
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
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

/// A connection to a server: sockets, memory or a simulation. One type for all: each would have a server compiled for it.
pub struct Accepted {
    bytes: Box<dyn ByteStream>,
    caller: Caller,
}

impl Accepted {
    /// One whose caller is known.
    pub fn new(bytes: impl ByteStream + 'static, caller: Caller) -> Self {
        Self { bytes: Box::new(bytes), caller }
    }
}

/// Connections as they come.
pub type Incoming = Pin<Box<dyn Stream<Item = io::Result<Accepted>> + Send>>;

/// Connections that are taken as they are, whoever calls.
pub fn unwatched<T: ByteStream + 'static>(
    streams: impl Stream<Item = io::Result<T>> + Send + 'static,
) -> Incoming {
    Box::pin(streams.map(|stream| Ok(Accepted::new(stream?, Caller::new(None)))))
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

impl Connected for Accepted {
    type ConnectInfo = Caller;

    fn connect_info(&self) -> Caller {
        self.caller.clone()
    }
}

impl AsyncRead for Accepted {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.bytes).poll_read(context, buffer)
    }
}

impl AsyncWrite for Accepted {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.bytes).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.bytes).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.bytes).poll_shutdown(context)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.bytes).poll_write_vectored(context, slices)
    }

    fn is_write_vectored(&self) -> bool {
        self.bytes.is_write_vectored()
    }
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
