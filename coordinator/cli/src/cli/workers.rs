use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context;
use clap::builder::{FalseyValueParser, OsStringValueParser, TypedValueParser};
use clap::{ArgAction, Args, ValueEnum};
use cluster::metrics::Metrics;
use cluster::{ClusterSettings, Schedule, Workers};
use protocol::security::{ClientSecurity, Token, Transport};

/// Who computes the rows.
#[derive(Args)]
pub struct WorkerArguments {
    /// Workers that compute the rows, as host:port, separated by commas. A name stands for all machines that it resolves to, and is
    /// looked up again while the work goes on [default: this process].
    #[arg(long, env = "COORDINATOR_WORKERS", value_delimiter = ',', global = true)]
    workers: Vec<String>,
    /// Jobs computed at the same time when this process computes the rows [default: one for each core].
    #[arg(long, env = "COORDINATOR_THREADS", global = true)]
    threads: Option<NonZeroUsize>,
    /// When jobs are sent: as soon as a worker has finished one, or, to measure against, whenever a timer rings.
    #[arg(long, value_enum, default_value_t = ScheduleArgument::Finished, global = true)]
    schedule: ScheduleArgument,
    /// Time from one ring of the periodic schedule's timer to the next, in milliseconds.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..), global = true)]
    period_ms: u64,
    /// Without any worker, wait so many seconds for one, at the start and whenever all are lost.
    #[arg(long, env = "COORDINATOR_WORKER_GRACE", default_value_t = ClusterSettings::DEFAULT_GRACE.as_secs_f64(), value_parser = seconds, global = true)]
    worker_grace: f64,
    /// What to do when no worker came in that time: fail, or go on in this process.
    #[arg(long, env = "COORDINATOR_FALLBACK", value_enum, default_value_t = FallbackArgument::None, global = true)]
    fallback: FallbackArgument,
    #[command(flatten)]
    security: SecurityArguments,
}

/// How workers are talked to.
#[derive(Args)]
struct SecurityArguments {
    /// Certificate authority of the workers' certificates, PEM. With the next two: all traffic is encrypted.
    #[arg(long, env = "COORDINATOR_TLS_CA", value_name = "FILE", value_parser = path(), global = true)]
    tls_ca: Option<PathBuf>,
    /// Certificate that this coordinator shows to workers, PEM.
    #[arg(long, env = "COORDINATOR_TLS_CERT", value_name = "FILE", value_parser = path(), global = true)]
    tls_cert: Option<PathBuf>,
    /// Private key of that certificate, PEM.
    #[arg(long, env = "COORDINATOR_TLS_KEY", value_name = "FILE", value_parser = path(), global = true)]
    tls_key: Option<PathBuf>,
    /// Name in the workers' certificates, where it is not the one that they are dialled by.
    #[arg(long, env = "COORDINATOR_TLS_NAME", value_name = "NAME", global = true)]
    tls_name: Option<String>,
    /// File with the token that the workers demand.
    #[arg(long, env = "COORDINATOR_TOKEN_FILE", value_name = "FILE", value_parser = path(), global = true)]
    token_file: Option<PathBuf>,
    /// Talk to workers on other machines without encryption: only in a network where everybody is trusted.
    #[arg(long, env = "COORDINATOR_PLAINTEXT", action = ArgAction::SetTrue, value_parser = FalseyValueParser::new(), global = true)]
    plaintext: bool,
}

/// Reads a path; an empty one, as compose files have it, too.
pub(super) fn path() -> impl TypedValueParser<Value = PathBuf> {
    OsStringValueParser::new().map(PathBuf::from)
}

impl SecurityArguments {
    fn security(&self) -> anyhow::Result<ClientSecurity> {
        let (ca, certificate, key) = (self.tls_ca.clone(), self.tls_cert.clone(), self.tls_key.clone());
        Ok(ClientSecurity {
            transport: Transport::from_options(ca, certificate, key, self.plaintext)?,
            server_name: self.tls_name.clone().filter(|name| !name.is_empty()),
            token: Token::from_option(self.token_file.as_deref())?,
        })
    }
}

/// When jobs are sent.
#[derive(Clone, Copy, ValueEnum)]
enum ScheduleArgument {
    /// As soon as a worker has finished one.
    Finished,
    /// Whenever a timer rings.
    Periodic,
}

/// What to do without workers.
#[derive(Clone, Copy, ValueEnum)]
enum FallbackArgument {
    /// Fail.
    None,
    /// Go on in this process.
    Embedded,
}

impl WorkerArguments {
    /// The cluster that is asked for, which counts what it does in `metrics`.
    pub fn cluster(&self, metrics: &Metrics) -> anyhow::Result<ClusterSettings> {
        // An empty variable, as compose files have it, names no worker.
        let named: Vec<String> = self.workers.iter().filter(|worker| !worker.is_empty()).cloned().collect();
        let workers = if named.is_empty() {
            Workers::Embedded { threads: self.threads()?.get() }
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
            fallback: match self.fallback {
                FallbackArgument::None => None,
                FallbackArgument::Embedded => Some(self.threads()?),
            },
            security: self.security()?,
            metrics: metrics.clone(),
        })
    }

    /// How remote workers are talked to, and services.
    pub fn security(&self) -> anyhow::Result<ClientSecurity> {
        self.security.security()
    }

    /// How many threads of this process compute.
    pub fn threads(&self) -> anyhow::Result<NonZeroUsize> {
        match self.threads {
            Some(threads) => Ok(threads),
            None => std::thread::available_parallelism().context("cannot count the cores: give --threads"),
        }
    }
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1e6).contains(&value) => Ok(value),
        _ => Err("must be a number of seconds from 0 to 1000000".into()),
    }
}
