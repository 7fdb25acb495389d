//! The network between coordinator and workers, and between workers: sockets, or a simulation.

use std::future::Future;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;

use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpStream, lookup_host};

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
