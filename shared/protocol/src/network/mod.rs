//! The network between coordinator and workers, and between workers: sockets, or a simulation.

mod line;

use std::future::Future;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;

use hyper_util::rt::TokioIo;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpStream, lookup_host};
use tokio::sync::watch;
use tonic::transport::{Endpoint, Error, Uri};
use tower::service_fn;

pub use line::{CallError, Line};
use line::{Counted, CountedStream};

/// Future answer of a [`Network`].
pub type Answer<T> = Pin<Box<dyn Future<Output = io::Result<T>> + Send>>;

/// Bytes in both directions.
pub trait ByteStream: AsyncRead + AsyncWrite + Send + Unpin {}

impl<T: AsyncRead + AsyncWrite + Send + Unpin> ByteStream for T {}

/// Names and connections.
pub trait Network: Send + Sync + 'static {
    /// Resolves `host:port` to all of its present addresses.
    ///
    /// # Errors
    /// When the name is unknown, or no name server answers.
    fn resolve(&self, name: &str) -> Answer<Vec<SocketAddr>>;

    /// Connects to an address.
    ///
    /// # Errors
    /// When no process accepts the connection.
    fn connect(&self, address: SocketAddr) -> Answer<Box<dyn ByteStream>>;
}

/// The network of this machine.
#[derive(Debug, Clone, Copy, Default)]
pub struct Sockets;

impl Network for Sockets {
    fn resolve(&self, name: &str) -> Answer<Vec<SocketAddr>> {
        let name = name.to_owned();
        Box::pin(async move { Ok(lookup_host(name).await?.collect()) })
    }

    fn connect(&self, address: SocketAddr) -> Answer<Box<dyn ByteStream>> {
        Box::pin(async move {
            let stream = TcpStream::connect(address).await?;
            // Messages are written whole: waiting for more gains nothing.
            stream.set_nodelay(true)?;
            Ok(Box::new(stream) as Box<dyn ByteStream>)
        })
    }
}

/// A way to a server: gone each time that a connection is needed.
pub type Way = Arc<dyn Fn() -> Answer<Box<dyn ByteStream>> + Send + Sync>;

/// The way to an address.
pub fn way(network: Arc<dyn Network>, address: SocketAddr) -> Way {
    Arc::new(move || network.connect(address))
}

/// Connects to an endpoint by this way. Boxed, the future is compiled here once, and not wherever it is awaited.
///
/// # Errors
/// When there is no connection.
pub fn connect(
    endpoint: &Endpoint,
    way: Way,
) -> Pin<Box<dyn Future<Output = Result<Line, Error>> + Send + '_>> {
    let (connector, open) = connector(way);
    Box::pin(async move { Ok(Line::new(endpoint.connect_with_connector(connector).await?, open)) })
}

/// The same, when the first call is made.
pub fn connect_lazily(endpoint: &Endpoint, way: Way) -> Line {
    let (connector, open) = connector(way);
    Line::new(endpoint.connect_with_connector_lazy(connector), open)
}

/// One type for all ways: each would have an HTTP/2 client compiled for it. Also returns the number of its
/// connections, and of those on the way.
fn connector(
    way: Way,
) -> (
    impl tower::Service<Uri, Response = Stream, Error = io::Error, Future = Connecting>,
    watch::Receiver<usize>,
) {
    let (sender, open) = watch::channel(0);
    let connector = service_fn(move |_: Uri| -> Connecting {
        let (connecting, counted) = (way(), Counted::new(&sender));
        Box::pin(
            async move { Ok(TokioIo::new(CountedStream { stream: connecting.await?, _counted: counted })) },
        )
    });
    (connector, open)
}

type Stream = TokioIo<CountedStream>;
type Connecting = Answer<Stream>;
