//! The command line.

use std::net::SocketAddr;
use std::num::{NonZeroUsize, ParseIntError};
use std::path::PathBuf;
use std::str::FromStr;

use clap::builder::{FalseyValueParser, OsStringValueParser, TypedValueParser};
use clap::{ArgAction, Parser};
use protocol::security::{ClientSecurity, SecurityError, Token, Transport};
use protocol::telemetry::{LogFormat, MetricsAddress};
use worker::MOST_THREADS;

/// Compute rows of form factors for a coordinator. Stateless: stop it at any time.
#[derive(Parser)]
#[command(version)]
pub struct Options {
    /// Address to listen on; port 0 takes a free one. Other machines need the --tls files or --plaintext.
    #[arg(long, env = "WORKER_LISTEN", default_value = "127.0.0.1:7070")]
    pub listen: SocketAddr,
    /// Jobs computed at the same time [default: one for each core].
    #[arg(long, env = "WORKER_THREADS", value_parser = threads)]
    pub threads: Option<NonZeroUsize>,
    /// Name in the coordinator's table [default: HOST:PORT of this machine].
    #[arg(long, env = "WORKER_NAME")]
    pub name: Option<String>,
    /// Room for replicas of scenes, in bytes; one may have a quarter of it [default: an eighth of the memory].
    #[arg(
        long,
        env = "WORKER_REPLICA_BYTES",
        value_name = "BYTES",
        default_value = "",
        hide_default_value = true
    )]
    pub replica_bytes: ReplicaBytes,
    /// Certificate of the authority that signs certificates of coordinators, PEM [default: --token-file is enough].
    #[arg(long, env = "WORKER_TLS_CA", value_name = "FILE", value_parser = path())]
    tls_ca: Option<PathBuf>,
    /// This worker's certificate, PEM; valid for the name that coordinators dial.
    #[arg(long, env = "WORKER_TLS_CERT", value_name = "FILE", value_parser = path())]
    tls_cert: Option<PathBuf>,
    /// Private key of the certificate, PEM.
    #[arg(long, env = "WORKER_TLS_KEY", value_name = "FILE", value_parser = path())]
    tls_key: Option<PathBuf>,
    /// Names of coordinators: only certificates that have one of them are taken [default: all of the authority].
    #[arg(long, env = "WORKER_TLS_CALLERS", value_name = "NAME,...", value_delimiter = ',')]
    tls_callers: Vec<String>,
    /// Serve other machines without encryption, in a trusted network.
    #[arg(long, env = "WORKER_PLAINTEXT", value_parser = FalseyValueParser::new(), action = ArgAction::SetTrue)]
    plaintext: bool,
    /// File with the token of coordinators: one word of 16 characters or more.
    #[arg(long, env = "WORKER_TOKEN_FILE", value_name = "FILE", value_parser = path())]
    token_file: Option<PathBuf>,
    /// Address of metrics for Prometheus, under /metrics; port 0 takes a free one [default: none].
    #[arg(long, env = "WORKER_METRICS", value_name = "HOST:PORT")]
    metrics: Option<MetricsAddress>,
    /// Format of logs: text or json.
    #[arg(long, env = "WORKER_LOG", value_name = "FORMAT", default_value = "text")]
    pub log: LogFormat,
    /// Check the health of the worker at this address instead of serving; exit code 0 if it serves.
    #[arg(long, value_name = "HOST:PORT")]
    pub health: Option<String>,
    /// Name in the worker's certificate, for --health [default: its host].
    #[arg(long, env = "WORKER_TLS_NAME", value_name = "NAME")]
    tls_name: Option<String>,
}

impl Options {
    /// Security of incoming connections.
    pub fn listening(&self) -> Result<Transport, SecurityError> {
        let names: Vec<String> = self.tls_callers.iter().filter(|name| !name.is_empty()).cloned().collect();
        let Self { tls_ca, tls_cert, tls_key, plaintext, .. } = self;
        let (ca, certificate, key) = (tls_ca.clone(), tls_cert.clone(), tls_key.clone());
        Transport::of_server(ca, certificate, key, *plaintext)?.accepting(&names)
    }

    /// The token that calls must carry.
    pub fn token(&self) -> Result<Option<Token>, SecurityError> {
        Token::from_option(self.token_file.as_deref())
    }

    /// Security of health checks.
    pub fn client(&self) -> Result<ClientSecurity, SecurityError> {
        let server_name = self.tls_name.clone().filter(|name| !name.is_empty());
        let Self { tls_ca, tls_cert, tls_key, plaintext, .. } = self;
        let (ca, certificate, key) = (tls_ca.clone(), tls_cert.clone(), tls_key.clone());
        let transport = Transport::of_caller(ca, certificate, key, *plaintext)?;
        Ok(ClientSecurity { transport, server_name, token: self.token()? })
    }

    /// Address of the metrics.
    pub fn metrics(&self) -> Option<SocketAddr> {
        self.metrics.and_then(|MetricsAddress(address)| address)
    }
}

/// A number of threads that a system can start.
fn threads(text: &str) -> Result<NonZeroUsize, String> {
    text.parse().ok().filter(|threads: &NonZeroUsize| threads.get() <= MOST_THREADS).ok_or_else(|| {
        format!("must be a whole number from 1 to {MOST_THREADS}: more threads than cores gain nothing")
    })
}

/// A number of bytes, or none if a variable of a compose file is empty.
#[derive(Debug, Clone, Copy)]
pub struct ReplicaBytes(pub Option<u64>);

impl FromStr for ReplicaBytes {
    type Err = ParseIntError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text.is_empty() { Ok(Self(None)) } else { text.parse().map(|bytes| Self(Some(bytes))) }
    }
}

/// A path that may be empty, as variables of compose files are.
fn path() -> impl TypedValueParser<Value = PathBuf> {
    OsStringValueParser::new().map(PathBuf::from)
}
