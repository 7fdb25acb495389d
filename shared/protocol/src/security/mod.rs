//! Authentication and encryption: the same rules for both ends of a connection.
//!
//! | module | contents |
//! |---|---|
//! | `tls` | certificates of both ends, checked against each other, read again for each connection |
//! | `token` | the bearer token: a secret that both ends know |
//! | `transport` | encrypted or plain, and where plain text may go |
//! | `caller` | the other end of a connection to a server |
//! | `callers` | which certificates of the authority a server takes |
//! | `client` | settings of a coordinator to dial workers |
//! | `guard` | checks the token of every call |
//! | `explain` | messages for refused handshakes, with the cure |
//!
//! Certificates are mutual: a worker demands a certificate of its own authority from every caller, and the coordinator verifies the
//! worker's. A token can replace that of the caller, or both between programs of one machine, or be demanded in addition.

mod caller;
mod callers;
mod client;
mod error;
mod explain;
mod guard;
mod tls;
mod token;
mod transport;

pub use caller::Caller;
pub use client::{ClientSecurity, Credentials, SecuredChannel};
pub use error::SecurityError;
pub use explain::explain;
pub use guard::Guard;
pub use tls::{Tls, TlsFiles};
pub use token::Token;
pub use transport::Transport;
