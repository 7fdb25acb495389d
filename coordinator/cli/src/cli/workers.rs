use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context;
use clap::builder::{FalseyValueParser, OsStringValueParser, TypedValueParser};
use clap::{ArgAction, Args, ValueEnum};
use cluster::metrics::Metrics;
use cluster::{ClusterSettings, Schedule, Workers};
use protocol::security::{ClientSecurity, Token, Transport};

/// Where the rows are computed.
#[derive(Args)]
#[command(next_help_heading = "Workers")]
pub struct WorkerArguments {
    /// Workers, as HOST:PORT separated by commas [default: this process]
    ///
    /// A name stands for all addresses that it resolves to, and is resolved again while the work goes on.
    #[arg(long, env = "COORDINATOR_WORKERS", value_name = "HOST:PORT,...", value_delimiter = ',')]
    workers: Vec<String>,
    #[command(flatten)]
    pub(super) threads: ThreadArguments,
    /// When jobs are sent to workers
    #[arg(long, value_enum, default_value_t = ScheduleArgument::Finished)]
    schedule: ScheduleArgument,
    /// Period of the periodic schedule, in milliseconds
    #[arg(long, value_name = "MS", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..))]
    period_ms: u64,
    /// Time to wait for a worker when there is none, in seconds
    ///
    /// Counts at the start, and whenever all workers are lost.
    #[arg(long, env = "COORDINATOR_WORKER_GRACE", value_name = "SECONDS",
        default_value_t = ClusterSettings::DEFAULT_GRACE.as_secs_f64(), value_parser = seconds)]
    worker_grace: f64,
    /// What to do when no worker came in that time
    #[arg(long, env = "COORDINATOR_FALLBACK", value_enum, default_value_t = FallbackArgument::None)]
    fallback: FallbackArgument,
    #[command(flatten)]
    pub(super) security: SecurityArguments,
}

/// How many threads compute.
#[derive(Args)]
pub struct ThreadArguments {
    /// Threads of this process that compute [default: one per core]
    #[arg(long, env = "COORDINATOR_THREADS", value_name = "N", value_parser = threads)]
    threads: Option<NonZeroUsize>,
}

impl ThreadArguments {
    /// The number of threads.
    pub fn count(&self) -> anyhow::Result<NonZeroUsize> {
        match self.threads {
            Some(threads) => Ok(threads),
            None => std::thread::available_parallelism().context("cannot count the cores: give --threads"),
        }
    }
}

/// A number of threads that a system can start.
fn threads(text: &str) -> Result<NonZeroUsize, String> {
    text.parse().ok().filter(|threads: &NonZeroUsize| threads.get() <= worker::MOST_THREADS).ok_or_else(
        || {
            format!(
                "must be a whole number from 1 to {}: more threads than cores gain nothing",
                worker::MOST_THREADS
            )
        },
    )
}

/// Encryption and authentication of connections to workers, or to a service.
#[derive(Args)]
#[command(next_help_heading = "Security")]
pub struct SecurityArguments {
    /// CA certificate of the other side, PEM; all traffic is encrypted
    #[arg(long, env = "COORDINATOR_TLS_CA", value_name = "FILE", value_parser = path())]
    tls_ca: Option<PathBuf>,
    /// Certificate to present, PEM [default: none; --token-file is enough where the other side has no --tls-ca]
    #[arg(long, env = "COORDINATOR_TLS_CERT", value_name = "FILE", value_parser = path())]
    tls_cert: Option<PathBuf>,
    /// Private key of --tls-cert, PEM
    #[arg(long, env = "COORDINATOR_TLS_KEY", value_name = "FILE", value_parser = path())]
    tls_key: Option<PathBuf>,
    /// Name in the other side's certificate [default: the name that is dialled]
    #[arg(long, env = "COORDINATOR_TLS_NAME", value_name = "NAME")]
    tls_name: Option<String>,
    /// File with the token to send
    #[arg(long, env = "COORDINATOR_TOKEN_FILE", value_name = "FILE", value_parser = path())]
    token_file: Option<PathBuf>,
    /// Connect to other machines without encryption, for trusted networks only
    #[arg(long, env = "COORDINATOR_PLAINTEXT", action = ArgAction::SetTrue, value_parser = FalseyValueParser::new())]
    plaintext: bool,
}

/// Reads a path, also an empty one: compose files have those.
pub(super) fn path() -> impl TypedValueParser<Value = PathBuf> {
    OsStringValueParser::new().map(PathBuf::from)
}

impl SecurityArguments {
    /// The files that are read, with their names in words.
    pub fn files(&self) -> [(&'static str, Option<&Path>); 4] {
        let files = [
            ("CA certificate", &self.tls_ca),
            ("certificate", &self.tls_cert),
            ("private key", &self.tls_key),
            ("file of the token", &self.token_file),
        ];
        // Compose files have empty names.
        files.map(|(name, path)| (name, path.as_deref().filter(|path| !path.as_os_str().is_empty())))
    }

    /// The settings of a connection.
    pub fn security(&self) -> anyhow::Result<ClientSecurity> {
        let (ca, certificate, key) = (self.tls_ca.clone(), self.tls_cert.clone(), self.tls_key.clone());
        Ok(ClientSecurity {
            transport: Transport::of_caller(ca, certificate, key, self.plaintext)?,
            server_name: self.tls_name.clone().filter(|name| !name.is_empty()),
            token: Token::from_option(self.token_file.as_deref())?,
        })
    }
}

/// When jobs are sent.
#[derive(Clone, Copy, ValueEnum)]
enum ScheduleArgument {
    /// As soon as a worker has finished one
    Finished,
    /// Whenever a timer fires, for comparison
    Periodic,
}

/// What to do without workers.
#[derive(Clone, Copy, ValueEnum)]
enum FallbackArgument {
    /// Fail
    None,
    /// Compute in this process
    Embedded,
}

impl WorkerArguments {
    /// The settings of the cluster, which counts in `metrics`.
    pub fn cluster(&self, metrics: &Metrics) -> anyhow::Result<ClusterSettings> {
        // An empty variable, as compose files have it, names no worker.
        let named: Vec<String> = self.workers.iter().filter(|worker| !worker.is_empty()).cloned().collect();
        let workers = if named.is_empty() {
            Workers::Embedded { threads: self.threads.count()?.get() }
        } else {
            Workers::Remote(named)
        };
        Ok(ClusterSettings {
            workers,
            schedule: match self.schedule {
                ScheduleArgument::Finished => Schedule::Finished,
                ScheduleArgument::Periodic => {
                    Schedule::Periodic { period: Duration::from_millis(self.period_ms) }
                }
            },
            grace: Duration::from_secs_f64(self.worker_grace),
            forgives: None,
            fallback: match self.fallback {
                FallbackArgument::None => None,
                FallbackArgument::Embedded => Some(self.threads.count()?),
            },
            security: self.security.security()?,
            metrics: metrics.clone(),
        })
    }
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1e6).contains(&value) => Ok(value),
        _ => Err("must be a number of seconds from 0 to 1000000".into()),
    }
}
