//! What all servers have in common: how a connection is bounded, and how a process is told to stop.

use std::io;
use std::time::Duration;

use tokio::signal::unix::{SignalKind, signal};
use tokio_util::sync::CancellationToken;
use tonic::transport::Server;

/// Status of a process that a second signal ended, as shells have it for SIGINT.
const INTERRUPTED: i32 = 130;

/// What one connection may have of a server.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConnectionBounds {
    /// Bytes that may be on their way to the server, on one connection: an upload then does not wait for each piece to be
    /// acknowledged.
    pub connection_window: u32,
    /// The same for one call. Smaller, so that an upload cannot use up the window of its whole connection.
    pub call_window: u32,
    /// Calls at the same time.
    pub calls: u32,
    /// Bytes that the headers of a call may have.
    pub header_bytes: u32,
    /// How often a quiet client is asked for a sign of life, and how long it has to give one.
    pub keep_alive: Duration,
}

impl ConnectionBounds {
    /// A server that holds every connection to these bounds.
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

/// A token that the first SIGTERM or SIGINT cancels; `meaning` is logged then. The second one ends the process at once.
///
/// To be called within a runtime.
///
/// # Errors
/// When the system does not tell of signals.
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
