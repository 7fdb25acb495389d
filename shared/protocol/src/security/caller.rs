use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Who is at the other end of a connection to a server: it stands among the extensions of every request. Clones mean the same
/// connection.
#[derive(Debug, Clone)]
pub struct Caller {
    address: Option<SocketAddr>,
    is_trusted: Arc<AtomicBool>,
}

impl Caller {
    /// A caller that has proved nothing yet.
    #[must_use]
    pub fn new(address: Option<SocketAddr>) -> Self {
        Self { address, is_trusted: Arc::default() }
    }

    /// Where it calls from.
    #[must_use]
    pub fn address(&self) -> Option<SocketAddr> {
        self.address
    }

    /// Takes note that it has shown what is demanded: a token, or a certificate where no token is.
    pub fn trust(&self) {
        self.is_trusted.store(true, Ordering::Relaxed);
    }

    /// Whether it has.
    #[must_use]
    pub fn is_trusted(&self) -> bool {
        self.is_trusted.load(Ordering::Relaxed)
    }
}
