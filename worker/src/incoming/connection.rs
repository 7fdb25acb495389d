use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use protocol::security::Caller;
use protocol::server::Accepted;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::time::{Instant, Sleep, sleep};
use tokio_rustls::server::TlsStream;
use tokio_util::either::Either;
use tokio_util::sync::WaitForCancellationFutureOwned;

use super::places::Place;

/// Length of the words that every HTTP/2 connection begins with; no request of HTTP/1 is shorter.
const PREFACE_BYTES: u64 = 24;

/// How long a caller may take to say them, and to say anything more as long as it has not shown who it is.
const STRANGER: Duration = Duration::from_secs(2);

/// The bytes of a connection.
pub(super) type Bytes = Either<TcpStream, Box<TlsStream<TcpStream>>>;

/// A connection that ends by itself when the caller does not speak soon, or falls silent; gives its place back when it
/// is dropped.
pub(super) struct Connection {
    bytes: Bytes,
    caller: Caller,
    received: u64,
    patience: Pin<Box<Sleep>>,
    /// Whether patience is that with a caller which has shown who it is.
    is_trusting: bool,
    silence: Duration,
    /// Ends when another caller has taken its place.
    lost: Pin<Box<WaitForCancellationFutureOwned>>,
    _place: Place,
}

impl Connection {
    pub(super) fn new(bytes: Bytes, caller: Caller, place: Place, silence: Duration) -> Self {
        let (patience, lost) = (Box::pin(sleep(STRANGER)), Box::pin(place.lost()));
        Self { bytes, caller, received: 0, patience, is_trusting: false, silence, lost, _place: place }
    }

    /// Bytes went in one of the directions.
    fn be_patient(&mut self) {
        // A caller that says its first words letter by letter gains no time with it.
        if self.received >= PREFACE_BYTES {
            self.is_trusting = self.caller.is_trusted();
            let silence = if self.is_trusting { self.silence } else { STRANGER };
            self.patience.as_mut().reset(Instant::now() + silence);
        }
    }
}

impl Accepted for Connection {
    fn caller(&self) -> Caller {
        self.caller.clone()
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        if self.lost.as_mut().poll(context).is_ready() {
            return Poll::Ready(Err(io::Error::new(
                io::ErrorKind::ConnectionAborted,
                "others need its place",
            )));
        }
        let before = buffer.filled().len();
        match Pin::new(&mut self.bytes).poll_read(context, buffer) {
            Poll::Ready(outcome) => {
                self.received += (buffer.filled().len() - before) as u64;
                self.be_patient();
                Poll::Ready(outcome)
            }
            Poll::Pending => {
                ready!(self.patience.as_mut().poll(context));
                // The bytes that showed who it is were the last that came: they have been understood since.
                if !self.is_trusting && self.caller.is_trusted() {
                    self.be_patient();
                    if self.is_trusting {
                        ready!(self.patience.as_mut().poll(context));
                    }
                }
                Poll::Ready(Err(io::Error::new(io::ErrorKind::TimedOut, "nothing came in time")))
            }
        }
    }
}

impl AsyncWrite for Connection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let written = ready!(Pin::new(&mut self.bytes).poll_write(context, bytes));
        self.be_patient();
        Poll::Ready(written)
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
        let written = ready!(Pin::new(&mut self.bytes).poll_write_vectored(context, slices));
        self.be_patient();
        Poll::Ready(written)
    }

    fn is_write_vectored(&self) -> bool {
        self.bytes.is_write_vectored()
    }
}
