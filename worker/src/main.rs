//! The `worker` binary: computes rows for the coordinators that call.

mod options;

use std::io::Write;
use std::net::SocketAddr;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use clap::Parser;
use options::Options;
use prometheus_client::registry::Registry;
use protocol::network::Sockets;
use protocol::security::ClientSecurity;
use protocol::server::stop_on_signal;
use protocol::telemetry::{Logging, LoggingSettings, MetricsPage};
use protocol::worker::worker_server::SERVICE_NAME;
use rustix::system::uname;
use tokio::net::TcpListener;
use worker::Settings;
use worker::incoming::{ConnectionLimits, incoming};
use worker::metrics::Metrics;
use worker::passing::Passing;

/// How long what is left of sessions may take after the worker is done.
const PARTING: Duration = Duration::from_secs(1);

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    match start(Options::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // There is no other place to say it.
            let _ = writeln!(std::io::stderr(), "error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn start(options: Options) -> anyhow::Result<()> {
    let _logging = Logging::start(&LoggingSettings {
        program: "worker",
        format: options.log,
        default_filter: "info",
        times: true,
    })?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        // The network needs little; the computing threads are others.
        .worker_threads(2)
        .enable_all()
        .build()
        .context("cannot start the network threads")?;
    let outcome = runtime.block_on(run(options));
    // Whatever a session still waits for, a worker that was told to stop stops.
    runtime.shutdown_timeout(PARTING);
    outcome
}

async fn run(options: Options) -> anyhow::Result<()> {
    if let Some(address) = &options.health {
        return Ok(worker::health::check(address, SERVICE_NAME, &options.client()?).await?);
    }
    let transport = options.listening()?;
    let token = options.token()?;
    transport.check_callers(token.is_some()).context("give --token-file or --tls-ca")?;
    transport.allows(options.listen).with_context(|| format!("cannot listen on {}", options.listen))?;
    let listener = TcpListener::bind(options.listen)
        .await
        .with_context(|| format!("cannot listen on {}: choose another --listen address", options.listen))?;
    let address = listener.local_addr().context("cannot read the address of the listener")?;
    let threads = match options.threads {
        Some(threads) => threads,
        None => std::thread::available_parallelism().context("cannot count the cores: give --threads")?,
    };
    // One that cannot show who it is, or check others, passes nothing on.
    let passing = options.client().ok().map(|security| Passing {
        network: Arc::new(Sockets),
        security: ClientSecurity { server_name: None, ..security },
    });
    let metrics = Metrics::default();
    let _page = show(&metrics, options.metrics())?;
    let name = options.name.filter(|name| !name.is_empty()).unwrap_or_else(|| default_name(address));
    let shutdown = stop_on_signal("finishing what is being computed, then leaving")
        .context("cannot listen for signals")?;

    // For scripts: from this line on, coordinators may call. Where nobody reads it, nobody misses it.
    let _ = writeln!(std::io::stdout(), "worker {name} listens on {address} with {threads} threads");
    let limits = ConnectionLimits { token: token.is_some(), ..ConnectionLimits::WORKER };
    let incoming = incoming(listener, transport.tls().cloned(), limits);
    let replica_bytes = options.replica_bytes.0.unwrap_or_else(Settings::default_replica_bytes);
    let settings = Settings { replica_bytes, token, metrics, passing, ..Settings::new(&name, threads) };
    Ok(worker::serve(incoming, settings, shutdown).await?)
}

/// The machine and the port: in a container every worker listens on the same address, and the machine has the name of its pod.
fn default_name(address: SocketAddr) -> String {
    format!("{}:{}", uname().nodename().to_string_lossy(), address.port())
}

/// Serves metrics to Prometheus, if wanted.
fn show(metrics: &Metrics, address: Option<SocketAddr>) -> anyhow::Result<Option<MetricsPage>> {
    let Some(address) = address else { return Ok(None) };
    let mut registry = Registry::default();
    metrics.register(&mut registry);
    let page = MetricsPage::start(address, registry)
        .with_context(|| format!("cannot show metrics at {address}: choose another --metrics address"))?;
    Ok(Some(page))
}
