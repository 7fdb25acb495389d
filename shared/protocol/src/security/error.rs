use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Why a connection would not be safe, or cannot be made so.
#[derive(Debug, thiserror::Error)]
pub enum SecurityError {
    /// Only some of the files are given.
    #[error(
        "{} missing: a server needs --tls-cert and --tls-key, a caller --tls-ca; with all three, each end proves who it is",
        missing.join(" and ")
    )]
    Incomplete {
        /// The options that are not given.
        missing: Vec<&'static str>,
    },
    /// Encryption alone, for callers who prove nothing.
    #[error("everybody could call: demand a token, or certificates with --tls-ca")]
    Anybody,
    /// Names of certificates that nobody shows.
    #[error("names of callers are those in their certificates: give --tls-ca, --tls-cert and --tls-key, too")]
    CallersWithoutTls,
    /// Encryption and plain text are both asked for.
    #[error("--plaintext and the --tls-* files contradict each other: give either")]
    Contradiction,
    /// Traffic would leave the machine in plain text.
    #[error(
        "{address} is beyond this machine, and the traffic would be in plain text: give --tls-ca, --tls-cert and \
         --tls-key, or ask for plain text by name with --plaintext"
    )]
    Plaintext {
        /// The address to listen on or to dial.
        address: SocketAddr,
    },
    /// A file cannot be read.
    #[error("{option} {} cannot be read: {error}", path.display())]
    Read {
        /// The option that names it.
        option: &'static str,
        /// The file.
        path: PathBuf,
        /// Error of the system.
        error: io::Error,
    },
    /// A file does not contain what its option needs.
    #[error("{option} {} is not {expected}: {reason}", path.display())]
    Content {
        /// The option that names it.
        option: &'static str,
        /// The file.
        path: PathBuf,
        /// Expected content.
        expected: &'static str,
        /// The problem.
        reason: String,
    },
    /// The key does not fit the certificate.
    #[error(
        "the key {} does not fit the certificate {}: {reason}",
        key.display(),
        certificate.display()
    )]
    Mismatch {
        /// File of the certificate.
        certificate: PathBuf,
        /// File of the key.
        key: PathBuf,
        /// The problem.
        reason: String,
    },
    /// A name that no certificate can have.
    #[error(
        "{name:?} is not a name that a certificate can have: give --tls-name or --tls-callers one that is in the other end's, such as a host name"
    )]
    Name {
        /// The name.
        name: String,
    },
    /// A token is too easy to guess, or has characters that cannot travel.
    #[error("--token-file {} has no usable token: {reason}", path.display())]
    Token {
        /// The file.
        path: PathBuf,
        /// The problem.
        reason: &'static str,
    },
    /// The connection cannot be set up.
    #[error("cannot set up the connection to {address}: {reason}")]
    Endpoint {
        /// The address to dial.
        address: SocketAddr,
        /// Error of the library.
        reason: String,
    },
}
