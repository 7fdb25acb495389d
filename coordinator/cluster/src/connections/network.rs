//! The network that workers are reached through: sockets in earnest, something else in simulations.

use std::future::Future;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;

use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpStream, lookup_host};

/// What a [`Network`] answers with, later.
pub type Answer<T> = Pin<Box<dyn Future<Output = io::Result<T>> + Send>>;

/// Bytes in both directions.
pub trait ByteStream: AsyncRead + AsyncWrite + Send + Unpin {}

impl<T: AsyncRead + AsyncWrite + Send + Unpin> ByteStream for T {}

/// Names and connections.
pub trait Network: Send + Sync + 'static {
    /// All addresses that `host:port` stands for now.
    ///
    /// # Errors
    /// When the name is not known, or nobody can be asked.
    fn resolve(&self, name: &str) -> Answer<Vec<SocketAddr>>;

    /// Connects to an address.
    ///
    /// # Errors
    /// When nobody answers there.
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
            // Messages are whole when they are written: nothing is gained by waiting for more.
            stream.set_nodelay(true)?;
            Ok(Box::new(stream) as Box<dyn ByteStream>)
        })
    }
}
