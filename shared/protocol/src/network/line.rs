use std::future::Future;
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::sync::watch;
use tokio::time::timeout;
use tonic::body::Body;
use tonic::codegen::{Service, http};
use tonic::transport::Channel;

use super::ByteStream;

/// How long a call still waits once there is neither a connection nor an attempt at one. Its answer or its error, if there is one, comes
/// sooner.
const GRACE: Duration = Duration::from_secs(1);

/// A channel on which no call waits for an answer much longer than its connection lasts. Streams that have begun end by themselves.
///
/// A request that is handed to an HTTP/2 client at the very moment its connection ends can get lost between the two, and its call would
/// wait for ever (hyper issue 4122). With TLS 1.3 that moment is the usual one: a server refuses a certificate when the caller, for whom the
/// handshake has ended, makes its first call.
#[derive(Debug, Clone)]
pub struct Line {
    channel: Channel,
    open: watch::Receiver<usize>,
}

impl Line {
    /// A channel whose connections `open` counts.
    pub(super) fn new(channel: Channel, open: watch::Receiver<usize>) -> Self {
        Self { channel, open }
    }
}

/// Why a call has no answer.
#[derive(Debug, thiserror::Error)]
pub enum CallError {
    /// The channel's own reason.
    #[error(transparent)]
    Transport(#[from] tonic::transport::Error),
    /// The connection has ended, and the call with it.
    #[error("the connection was closed during the call")]
    Lost,
}

impl Service<http::Request<Body>> for Line {
    type Response = http::Response<Body>;
    type Error = CallError;
    type Future = Pin<Box<dyn Future<Output = Result<Self::Response, CallError>> + Send>>;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), CallError>> {
        Service::poll_ready(&mut self.channel, context).map_err(CallError::from)
    }

    fn call(&mut self, request: http::Request<Body>) -> Self::Future {
        let answer = Service::call(&mut self.channel, request);
        let lost = lost(self.open.clone());
        Box::pin(async move {
            tokio::select! {
                biased;
                answer = answer => Ok(answer?),
                () = lost => Err(CallError::Lost),
            }
        })
    }
}

/// Waits until there has been no connection for a while, or none can be any more.
async fn lost(mut open: watch::Receiver<usize>) {
    while open.wait_for(|open| *open == 0).await.is_ok() {
        match timeout(GRACE, open.wait_for(|open| *open > 0)).await {
            Ok(Ok(_)) => {}
            Ok(Err(_)) | Err(_) => return,
        }
    }
}

/// A connection, or an attempt at one, as long as it is counted.
pub(super) struct Counted {
    open: watch::Sender<usize>,
}

impl Counted {
    pub fn new(open: &watch::Sender<usize>) -> Self {
        open.send_modify(|open| *open += 1);
        Self { open: open.clone() }
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.open.send_modify(|open| *open -= 1);
    }
}

/// A connection that is counted until it is dropped.
pub(super) struct CountedStream {
    pub stream: Box<dyn ByteStream>,
    pub _counted: Counted,
}

impl AsyncRead for CountedStream {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(context, buffer)
    }
}

impl AsyncWrite for CountedStream {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write_vectored(context, slices)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }
}

#[cfg(test)]
mod tests {
    use tokio::time::{Instant, sleep};

    use super::*;

    #[tokio::test(start_paused = true)]
    async fn a_call_is_lost_a_while_after_the_last_connection() {
        let (sender, open) = watch::channel(0);
        let begun = Instant::now();
        lost(open.clone()).await;
        assert_eq!(begun.elapsed(), GRACE);

        // Connections that follow soon enough keep it.
        let connection = Counted::new(&sender);
        let watching = tokio::spawn(lost(open.clone()));
        sleep(GRACE * 9).await;
        drop(connection);
        sleep(GRACE / 2).await;
        let connection = Counted::new(&sender);
        sleep(GRACE * 9).await;
        assert!(!watching.is_finished());
        drop(connection);
        let begun = Instant::now();
        watching.await.unwrap();
        assert_eq!(begun.elapsed(), GRACE);

        drop(sender);
        lost(open).await;
    }
}
