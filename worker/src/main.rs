//! The `worker` binary: computes rows for any coordinator that calls.

use std::io::Write;
use std::net::SocketAddr;
use std::num::NonZeroUsize;

use anyhow::Context;
use clap::Parser;
use tokio::net::TcpListener;
use tokio::signal::unix::{SignalKind, signal};
use tokio_util::sync::CancellationToken;
use tonic::transport::server::TcpIncoming;
use tracing_subscriber::EnvFilter;
use worker::Settings;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Computes rows of form factors for a coordinator. Keeps nothing: stop it at any time.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Address to listen on; port 0 takes a free one. There is no password: listen only where coordinators are.
    #[arg(long, env = "WORKER_LISTEN", default_value = "127.0.0.1:7070")]
    listen: SocketAddr,
    /// Jobs computed at the same time [default: one for each core].
    #[arg(long, env = "WORKER_THREADS")]
    threads: Option<NonZeroUsize>,
    /// Name in the coordinator's table [default: the address].
    #[arg(long, env = "WORKER_NAME")]
    name: Option<String>,
    /// Room for replicas of scenes, in bytes.
    #[arg(long, env = "WORKER_REPLICA_BYTES", default_value_t = Settings::DEFAULT_REPLICA_BYTES)]
    replica_bytes: u64,
}

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("info"));
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
    tokio::runtime::Builder::new_multi_thread()
        // The network needs little; the computing threads are others.
        .worker_threads(2)
        .enable_all()
        .build()
        .context("cannot start the network threads")?
        .block_on(run(arguments))
}

async fn run(arguments: Arguments) -> anyhow::Result<()> {
    let listener = TcpListener::bind(arguments.listen)
        .await
        .with_context(|| format!("cannot listen on {}: choose another --listen address", arguments.listen))?;
    let address = listener.local_addr().context("cannot tell the address")?;
    let threads = match arguments.threads {
        Some(threads) => threads,
        None => std::thread::available_parallelism().context("cannot count the cores: give --threads")?,
    };
    let name = arguments.name.unwrap_or_else(|| address.to_string());
    let shutdown = stop_on_signal()?;

    // For scripts: from this line on, coordinators may call. Where nobody reads it, nobody misses it.
    let _ = writeln!(std::io::stdout(), "worker {name} listens on {address} with {threads} threads");
    let incoming = TcpIncoming::from(listener).with_nodelay(Some(true));
    let settings = Settings { name, threads, replica_bytes: arguments.replica_bytes };
    Ok(worker::serve(incoming, settings, shutdown).await?)
}

/// A token that the first SIGTERM or SIGINT cancels; the second one ends the process at once.
fn stop_on_signal() -> anyhow::Result<CancellationToken> {
    let mut terminate = signal(SignalKind::terminate()).context("cannot listen for SIGTERM")?;
    let mut interrupt = signal(SignalKind::interrupt()).context("cannot listen for SIGINT")?;
    let shutdown = CancellationToken::new();
    let cancelled = shutdown.clone();
    tokio::spawn(async move {
        for last in [false, true] {
            tokio::select! {
                _ = terminate.recv() => {}
                _ = interrupt.recv() => {}
            }
            if last {
                std::process::exit(130);
            }
            tracing::info!("finishing what is being computed, then leaving");
            cancelled.cancel();
        }
    });
    Ok(shutdown)
}
