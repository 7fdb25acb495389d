//! Limits of connections and shutdown, for all servers.

use std::io;
use std::time::Duration;

use tokio::signal::unix::{SignalKind, signal};
use tokio_util::sync::CancellationToken;
use tonic::transport::Server;

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
