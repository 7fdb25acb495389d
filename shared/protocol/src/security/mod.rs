//! Who may talk to whom, and what a listener on the way learns: the same rules for both ends of a connection.
//!
//! | module | what lives there |
//! |---|---|
//! | `tls` | certificates of both ends, read once and checked against each other |
//! | `token` | the bearer token: a secret that both ends know |
//! | `transport` | encrypted or plain, and where plain text may go |
//! | `client` | what a coordinator needs to dial |
//! | `guard` | the token, demanded of every call |
//! | `explain` | words for a refused handshake, with the cure |
//!
//! Certificates are mutual: a worker demands one of its own authority from whoever calls, and the coordinator verifies the
//! worker's. A token may stand in for that between programs of one machine, or be demanded on top.

mod client;
mod error;
mod explain;
mod guard;
mod tls;
mod token;
mod transport;

pub use client::{ClientSecurity, Credentials, SecuredChannel};
pub use error::SecurityError;
pub use explain::explain;
pub use guard::Guard;
pub use tls::{Tls, TlsFiles};
pub use token::Token;
pub use transport::Transport;
