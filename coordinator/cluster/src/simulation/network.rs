use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::{Arc, Mutex};

use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use turmoil::net::{TcpListener, TcpStream};

use protocol::network::{Answer, ByteStream, Network};
use protocol::server::{Incoming, unwatched};

/// Port of every worker.
pub const PORT: u16 = 7070;

/// The name that stands for all workers.
pub const ALL: &str = "workers";

/// Which workers the name server knows.
#[derive(Clone, Default)]
pub struct NameServer {
    listed: Arc<Mutex<Vec<(String, IpAddr)>>>,
}

impl NameServer {
    pub fn list(&self, name: &str, address: IpAddr) {
        self.listed.lock().unwrap().push((name.into(), address));
    }

    pub fn remove(&self, name: &str) {
        self.listed.lock().unwrap().retain(|(listed, _)| listed != name);
    }
}

impl Network for NameServer {
    fn resolve(&self, name: &str) -> Answer<Vec<SocketAddr>> {
        let host = name.rsplit_once(':').map_or(name, |(host, _)| host);
        let listed = self.listed.lock().unwrap();
        let of_name = listed.iter().filter(|(listed, _)| host == ALL || host == listed);
        let found: Vec<_> = of_name.map(|(_, address)| SocketAddr::new(*address, PORT)).collect();
        Box::pin(async move {
            if found.is_empty() { Err(io::Error::other("the name is not known")) } else { Ok(found) }
        })
    }

    fn connect(&self, address: SocketAddr) -> Answer<Box<dyn ByteStream>> {
        Box::pin(async move { Ok(Box::new(TcpStream::connect(address).await?) as Box<dyn ByteStream>) })
    }
}

/// The connections of a worker.
pub async fn listen() -> io::Result<Incoming> {
    let listener = TcpListener::bind((Ipv4Addr::UNSPECIFIED, PORT)).await?;
    let (accepted, connections) = mpsc::channel(1);
    tokio::spawn(async move {
        loop {
            let next = tokio::select! {
                biased;
                () = accepted.closed() => return,
                next = listener.accept() => next,
            };
            // The worker may have stopped meanwhile.
            let _ = accepted.send(next.map(|(stream, _)| stream)).await;
        }
    });
    Ok(unwatched(ReceiverStream::new(connections)))
}
