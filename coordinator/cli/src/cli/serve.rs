use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context;
use clap::builder::FalseyValueParser;
use clap::{ArgAction, Args};
use cluster::{Cluster, ClusterSettings};
use protocol::security::Transport;
use protocol::server::stop_on_signal;
use service::clients::Clients;
use service::guard::Names;
use service::queue::Places;
use service::{Limits, Metrics, Service, ServiceSettings, server};
use tokio::net::TcpListener;
use worker::incoming::{ConnectionLimits, incoming};
use worker::memory::memory_bytes;

use super::console::print;
use super::job;
use super::telemetry::TelemetryArguments;
use super::workers::{WorkerArguments, path};

/// Threads that answer clients. They never compute, and never wait for the disk.
const NETWORK_THREADS: usize = 2;

/// Connections of clients. One that is quiet for so long has been forgotten by its client: those of gRPC show signs of life.
const CONNECTIONS: ConnectionLimits =
    ConnectionLimits { connections: 1024, silence: Duration::from_secs(600), token: false };

/// A mebibyte in bytes.
const MIB: u64 = 1 << 20;

/// A long-running service.
#[derive(Args)]
#[command(next_help_heading = "Service")]
pub struct ServeArguments {
    /// Address to listen on; port 0 takes a free one
    ///
    /// An address that other machines reach needs the --listen-tls files, or --listen-plaintext.
    #[arg(long, env = "COORDINATOR_LISTEN", value_name = "HOST:PORT", default_value = "127.0.0.1:7000")]
    listen: SocketAddr,
    /// Folder for scenes, jobs and lit files, created if missing
    ///
    /// One service at a time may use it.
    #[arg(long, env = "COORDINATOR_DATA", value_name = "FOLDER", default_value = "halflight-data")]
    data: PathBuf,
    /// Jobs that run at the same time and share the workers
    #[arg(long, env = "COORDINATOR_JOBS", value_name = "N", default_value_t = 2, value_parser = at_least_one)]
    jobs: usize,
    /// Jobs of one client that run at the same time [default: --jobs]
    #[arg(long, env = "COORDINATOR_JOBS_PER_CLIENT", value_name = "N", value_parser = at_least_one)]
    jobs_per_client: Option<usize>,
    #[command(flatten)]
    access: AccessArguments,
    #[command(flatten)]
    limits: LimitArguments,
    #[command(flatten)]
    pub workers: WorkerArguments,
    #[command(flatten)]
    pub telemetry: TelemetryArguments,
}

/// Who may use the service, and how its traffic is protected.
#[derive(Args)]
#[command(next_help_heading = "Access")]
struct AccessArguments {
    /// Clients: a file with a line NAME TOKEN each [default: everybody who reaches the port, as one client]
    #[arg(long, env = "COORDINATOR_CLIENTS", value_name = "FILE", value_parser = path())]
    clients: Option<PathBuf>,
    /// CA certificate of the clients, PEM [default: they show a token of --clients instead]
    #[arg(long, env = "COORDINATOR_LISTEN_TLS_CA", value_name = "FILE", value_parser = path())]
    listen_tls_ca: Option<PathBuf>,
    /// Certificate of the service, PEM; with --listen-tls-key all traffic is encrypted
    #[arg(long, env = "COORDINATOR_LISTEN_TLS_CERT", value_name = "FILE", value_parser = path())]
    listen_tls_cert: Option<PathBuf>,
    /// Private key of --listen-tls-cert, PEM
    #[arg(long, env = "COORDINATOR_LISTEN_TLS_KEY", value_name = "FILE", value_parser = path())]
    listen_tls_key: Option<PathBuf>,
    /// Names of clients: only certificates that have one of them are taken [default: all of the authority]
    #[arg(long, env = "COORDINATOR_LISTEN_TLS_CALLERS", value_name = "NAME,...", value_delimiter = ',')]
    listen_tls_callers: Vec<String>,
    /// Listen for other machines without encryption, in trusted networks only
    #[arg(long, env = "COORDINATOR_LISTEN_PLAINTEXT", value_parser = FalseyValueParser::new(), action = ArgAction::SetTrue)]
    listen_plaintext: bool,
    /// Host names that the service answers to, beside localhost and addresses
    ///
    /// Protects a service without tokens and certificates from pages of sites whose name resolves to it. The default is none on
    /// loopback without --clients, else any.
    #[arg(long, env = "COORDINATOR_LISTEN_NAMES", value_name = "NAME,...", value_delimiter = ',')]
    listen_names: Option<Vec<String>>,
}

/// What jobs and clients may use.
#[derive(Args)]
#[command(next_help_heading = "Limits")]
struct LimitArguments {
    /// Unfinished jobs of one client
    #[arg(long, default_value_t = Limits::default().jobs_of_a_client, value_name = "JOBS")]
    queue_per_client: usize,
    /// Size of one scene, in MiB
    #[arg(long, default_value_t = Limits::default().upload_bytes / MIB, value_name = "MIB")]
    upload_size: u64,
    /// Time of one upload, in seconds
    #[arg(long, default_value_t = Limits::default().upload_time.as_secs(), value_name = "SECONDS")]
    upload_time: u64,
    /// Uploads of one client at the same time
    #[arg(long, default_value_t = Limits::default().uploads_of_a_client, value_name = "UPLOADS")]
    uploads_per_client: usize,
    /// Vertices of one job
    #[arg(long, default_value_t = Limits::default().vertices, value_name = "VERTICES")]
    vertices_per_job: u64,
    /// Memory of one job, in MiB; one that needs more fails [default: 3/4 of the machine's / --jobs]
    ///
    /// Half of it, but no more than 2048 MiB, is for rows: others are computed again.
    #[arg(long, env = "COORDINATOR_MEMORY_PER_JOB", value_name = "MIB", value_parser = at_least_one)]
    memory_per_job: Option<usize>,
    /// Disk space for the checkpoint of one job, in MiB; later rows are computed again after a restart
    #[arg(long, default_value_t = Limits::default().checkpoint_bytes / MIB, value_name = "MIB")]
    checkpoint_per_job: u64,
    /// Disk space for the light sources of one job, in MiB; a job that needs more cannot be relit
    #[arg(long, default_value_t = Limits::default().light_bytes / MIB, value_name = "MIB")]
    light_per_job: u64,
    /// Time after which finished jobs are deleted, in days
    #[arg(long, default_value_t = Limits::default().keep_age.as_secs() as f64 / 86400.0, value_name = "DAYS", value_parser = days)]
    keep_days: f64,
    /// Size of the data folder, in MiB; beyond it the jobs that ended first are deleted
    #[arg(long, default_value_t = Limits::default().keep_bytes / MIB, value_name = "MIB")]
    keep_size: u64,
    /// Disk space to leave free, in MiB; with less, no job is accepted
    #[arg(long, default_value_t = Limits::default().free_bytes / MIB, value_name = "MIB")]
    keep_free: u64,
}

impl ServeArguments {
    fn settings(&self) -> ServiceSettings {
        let limits = Limits {
            jobs_of_a_client: self.limits.queue_per_client,
            upload_bytes: self.limits.upload_size.saturating_mul(MIB),
            uploads_of_a_client: self.limits.uploads_per_client,
            upload_time: Duration::from_secs(self.limits.upload_time),
            vertices: self.limits.vertices_per_job,
            memory: self.memory_of_a_job(),
            checkpoint_bytes: self.limits.checkpoint_per_job.saturating_mul(MIB),
            light_bytes: self.limits.light_per_job.saturating_mul(MIB),
            keep_age: Duration::from_secs_f64(self.limits.keep_days * 86400.0),
            keep_bytes: self.limits.keep_size.saturating_mul(MIB),
            free_bytes: self.limits.keep_free.saturating_mul(MIB),
            ..Limits::default()
        };
        let places = Places { all: self.jobs, of_a_client: self.jobs_per_client.unwrap_or(self.jobs) };
        ServiceSettings {
            job_command: job::command(self.telemetry.log),
            data: self.data.clone(),
            places,
            limits,
        }
    }

    /// Memory of a job, in bytes.
    fn memory_of_a_job(&self) -> u64 {
        let share = || memory_bytes() / 4 * 3 / self.jobs as u64;
        self.limits.memory_per_job.map_or_else(share, |mebibytes| (mebibytes as u64).saturating_mul(MIB))
    }

    fn transport(&self) -> anyhow::Result<Transport> {
        let AccessArguments { listen_tls_ca: ca, listen_tls_cert: certificate, listen_tls_key: key, .. } =
            &self.access;
        let transport =
            Transport::of_server(ca.clone(), certificate.clone(), key.clone(), self.access.listen_plaintext)
                .and_then(|transport| {
                    let names = self.access.listen_tls_callers.iter().filter(|name| !name.is_empty());
                    transport.accepting(&names.cloned().collect::<Vec<_>>())
                })
                .context(
                    "the options --listen-tls-ca, --listen-tls-cert, --listen-tls-key and --listen-plaintext",
                )?;
        transport.allows(self.listen).with_context(|| {
            format!("cannot listen on {}: give the --listen-tls files, or --listen-plaintext", self.listen)
        })?;
        Ok(transport)
    }
}

/// Serves until SIGTERM or SIGINT.
pub fn run(arguments: &ServeArguments, workers: ClusterSettings, metrics: Metrics) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(NETWORK_THREADS)
        .thread_name("clients")
        .enable_all()
        .build()
        .context("cannot start the network threads")?;
    let outcome = runtime.block_on(serve(arguments, workers, metrics));
    // What clients still wait for, they ask for again.
    runtime.shutdown_background();
    outcome
}

async fn serve(arguments: &ServeArguments, workers: ClusterSettings, metrics: Metrics) -> anyhow::Result<()> {
    // First: process 1 of a container would not notice a signal while the data folder is read.
    let shutdown =
        stop_on_signal("jobs stop, and go on at the next start").context("cannot listen for signals")?;
    let transport = arguments.transport()?;
    let clients = match arguments.access.clients.as_ref().filter(|path| !path.as_os_str().is_empty()) {
        Some(path) => Clients::read(path)?,
        None => Clients::default(),
    };
    transport.check_callers(clients.are_named()).context("give --clients or --listen-tls-ca")?;
    // Workers that are not there now come later, and jobs wait for them, unless this process may take their place.
    let grace = if workers.fallback.is_none() { ClusterSettings::ENDLESS_GRACE } else { workers.grace };
    let forgives = Some(ClusterSettings::FORGIVES);
    let workers = Cluster::start_in_background(&ClusterSettings { grace, forgives, ..workers })?;
    let service = Service::open(&arguments.settings(), workers, metrics)?;
    let listener = TcpListener::bind(arguments.listen)
        .await
        .with_context(|| format!("cannot listen on {}: choose another --listen address", arguments.listen))?;
    let address = listener.local_addr().context("cannot tell the address")?;
    // For scripts: from this line on, clients may call. Where nobody reads it, nobody misses it.
    let _ = print(format_args!("coordinator serves on {address}, data in {}", arguments.data.display()));
    let limits = ConnectionLimits { token: clients.are_named(), ..CONNECTIONS };
    let incoming = incoming(listener, transport.tls().cloned(), limits);
    let is_open = arguments.access.clients.is_none() && transport == Transport::default();
    let names = match &arguments.access.listen_names {
        Some(names) => Names::These(names.clone()),
        None if is_open => Names::These(vec![]),
        None => Names::Any,
    };
    Ok(server::serve(incoming, service, clients, names, shutdown).await?)
}

fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) | Err(_) => Err("must be a whole number from 1".into()),
        Ok(value) => Ok(value),
    }
}

fn days(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=100_000.0).contains(&value) => Ok(value),
        _ => Err("must be a number of days from 0 to 100000".into()),
    }
}
