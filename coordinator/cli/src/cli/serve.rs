use std::io::Write;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context;
use clap::builder::FalseyValueParser;
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, FromArgMatches};
use cluster::{Cluster, ClusterSettings};
use protocol::security::{Tls, Transport};
use protocol::server::stop_on_signal;
use service::clients::Clients;
use service::guard::Names;
use service::queue::Places;
use service::{Limits, Metrics, Service, ServiceSettings, server};
use tokio::net::TcpListener;
use worker::incoming::{ConnectionLimits, incoming};

use super::workers::path;

/// Threads that answer clients. They never compute, and never wait for the disk.
const NETWORK_THREADS: usize = 2;

/// Connections of clients. One that is quiet for so long has been forgotten by its client: those of gRPC show signs of life.
const CONNECTIONS: ConnectionLimits =
    ConnectionLimits { connections: 1024, silence: Duration::from_secs(600) };

/// A mebibyte in bytes.
const MIB: u64 = 1 << 20;

/// A long-running service.
#[derive(Args)]
#[command(next_help_heading = "Service")]
pub struct ServeArguments {
    /// Address to listen on; port 0 takes a free one. Beyond this machine it takes the --listen-tls files, or --listen-plaintext.
    #[arg(long, env = "COORDINATOR_LISTEN", value_name = "HOST:PORT", default_value = "127.0.0.1:7000")]
    listen: SocketAddr,
    /// Folder for scenes, jobs and lit files; made where it is missing. One service at a time uses it.
    #[arg(long, env = "COORDINATOR_DATA", value_name = "FOLDER", default_value = "halflight-data")]
    data: PathBuf,
    /// Jobs that run at once, and share the workers.
    #[arg(long, env = "COORDINATOR_JOBS", default_value_t = 2, value_parser = at_least_one)]
    jobs: usize,
    /// Of these, jobs of one client [default: all].
    #[arg(long, env = "COORDINATOR_JOBS_PER_CLIENT", value_parser = at_least_one)]
    jobs_per_client: Option<usize>,
    /// Who may ask: a file with a line NAME TOKEN for each client [default: everybody who reaches the port, as one client].
    #[arg(long, env = "COORDINATOR_CLIENTS", value_name = "FILE", value_parser = path())]
    clients: Option<PathBuf>,
    /// Certificate authority of the clients' certificates, PEM. With the next two: all traffic is encrypted.
    #[arg(long, env = "COORDINATOR_LISTEN_TLS_CA", value_name = "FILE", value_parser = path())]
    listen_tls_ca: Option<PathBuf>,
    /// Certificate that the service shows to clients, PEM.
    #[arg(long, env = "COORDINATOR_LISTEN_TLS_CERT", value_name = "FILE", value_parser = path())]
    listen_tls_cert: Option<PathBuf>,
    /// Private key of that certificate, PEM.
    #[arg(long, env = "COORDINATOR_LISTEN_TLS_KEY", value_name = "FILE", value_parser = path())]
    listen_tls_key: Option<PathBuf>,
    /// Listen beyond this machine without encryption: for networks in which everybody may read everything.
    #[arg(long, env = "COORDINATOR_LISTEN_PLAINTEXT", value_parser = FalseyValueParser::new(), action = ArgAction::SetTrue)]
    listen_plaintext: bool,
    /// Names that the service answers to, beside localhost and addresses: without tokens and certificates, a page of a site whose name
    /// leads here could ask it otherwise [default: none on loopback without --clients, else any].
    #[arg(long, env = "COORDINATOR_LISTEN_NAMES", value_name = "NAME,...", value_delimiter = ',')]
    listen_names: Option<Vec<String>>,
    /// Jobs of one client that have not ended, at most.
    #[arg(long, default_value_t = Limits::default().jobs_of_a_client, value_name = "JOBS")]
    queue_per_client: usize,
    /// Size of one scene, in MiB, at most.
    #[arg(long, default_value_t = Limits::default().upload_bytes / MIB, value_name = "MIB")]
    upload_size: u64,
    /// Time that one upload may take, in seconds.
    #[arg(long, default_value_t = Limits::default().upload_time.as_secs(), value_name = "SECONDS")]
    upload_time: u64,
    /// Uploads of one client at the same time, at most.
    #[arg(long, default_value_t = Limits::default().uploads_of_a_client, value_name = "UPLOADS")]
    uploads_per_client: usize,
    /// Vertices that a job may ask for, at most.
    #[arg(long, default_value_t = Limits::default().vertices, value_name = "VERTICES")]
    vertices_per_job: u64,
    /// Memory for the rows of one job, in MiB: those that do not fit are computed again.
    #[arg(long, default_value_t = Limits::default().row_cache, value_name = "MIB")]
    memory_per_job: usize,
    /// Room for finished rows of one job on the disk, in MiB: what comes after is computed again by a job that goes on.
    #[arg(long, default_value_t = Limits::default().checkpoint_bytes / MIB, value_name = "MIB")]
    checkpoint_per_job: u64,
    /// Room for the light of each source of one job, in MiB: a job that needs more cannot be lit otherwise.
    #[arg(long, default_value_t = Limits::default().light_bytes / MIB, value_name = "MIB")]
    light_per_job: u64,
    /// Jobs are forgotten when they ended so many days ago.
    #[arg(long, default_value_t = Limits::default().keep_age.as_secs() as f64 / 86400.0, value_name = "DAYS", value_parser = days)]
    keep_days: f64,
    /// Size of the data folder, in MiB: the jobs that ended first are forgotten beyond.
    #[arg(long, default_value_t = Limits::default().keep_bytes / MIB, value_name = "MIB")]
    keep_size: u64,
    /// Room that is left free on the disk, in MiB: nothing is taken in when there is less.
    #[arg(long, default_value_t = Limits::default().free_bytes / MIB, value_name = "MIB")]
    keep_free: u64,
}

/// The same where no command is given: before another command they would be without effect, and are refused.
///
/// `args_conflicts_with_subcommands` is not for this: it would refuse the options that belong to all commands too.
pub struct WithoutCommand(pub ServeArguments);

impl FromArgMatches for WithoutCommand {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let arguments = ServeArguments::from_arg_matches(matches).map(Self)?;
        let Some(command) = matches.subcommand_name() else { return Ok(arguments) };
        let options = ServeArguments::augment_args(clap::Command::new("serve"));
        // Variables of the environment are for whoever needs them.
        let is_given =
            |option: &&Arg| matches.value_source(option.get_id().as_str()) == Some(ValueSource::CommandLine);
        let Some(given) = options.get_arguments().find(is_given) else { return Ok(arguments) };
        let name = given.get_long().unwrap_or(given.get_id().as_str());
        let message = match command {
            "serve" => {
                format!("the option '--{name}' is without effect before `serve`: give it after `serve`")
            }
            _ => format!(
                "the option '--{name}' is for the service, and `{command}` is not: leave it out, or give it to \
                 `serve`, or without any command"
            ),
        };
        Err(clap::Error::raw(ErrorKind::ArgumentConflict, message))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Args for WithoutCommand {
    fn augment_args(command: clap::Command) -> clap::Command {
        ServeArguments::augment_args(command)
    }

    fn augment_args_for_update(command: clap::Command) -> clap::Command {
        ServeArguments::augment_args_for_update(command)
    }
}

impl ServeArguments {
    fn settings(&self) -> ServiceSettings {
        let limits = Limits {
            jobs_of_a_client: self.queue_per_client,
            upload_bytes: self.upload_size.saturating_mul(MIB),
            uploads_of_a_client: self.uploads_per_client,
            upload_time: Duration::from_secs(self.upload_time),
            vertices: self.vertices_per_job,
            row_cache: self.memory_per_job,
            checkpoint_bytes: self.checkpoint_per_job.saturating_mul(MIB),
            light_bytes: self.light_per_job.saturating_mul(MIB),
            keep_age: Duration::from_secs_f64(self.keep_days * 86400.0),
            keep_bytes: self.keep_size.saturating_mul(MIB),
            free_bytes: self.keep_free.saturating_mul(MIB),
            ..Limits::default()
        };
        let places = Places { all: self.jobs, of_a_client: self.jobs_per_client.unwrap_or(self.jobs) };
        ServiceSettings { data: self.data.clone(), places, limits }
    }

    fn transport(&self) -> anyhow::Result<Transport> {
        let Self { listen_tls_ca: ca, listen_tls_cert: certificate, listen_tls_key: key, .. } = self;
        let transport =
            Transport::from_options(ca.clone(), certificate.clone(), key.clone(), self.listen_plaintext)
                .context(
                    "the options --listen-tls-ca, --listen-tls-cert, --listen-tls-key and --listen-plaintext",
                )?;
        transport.allows(self.listen).with_context(|| {
            format!("cannot listen on {}: the options of the service begin with --listen-", self.listen)
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
    let transport = arguments.transport()?;
    let clients = match arguments.clients.as_ref().filter(|path| !path.as_os_str().is_empty()) {
        Some(path) => Clients::read(path)?,
        None => Clients::default(),
    };
    // Workers that are not there now come later, and jobs wait for them, unless this process may take their place.
    let grace = if workers.fallback.is_none() { ClusterSettings::ENDLESS_GRACE } else { workers.grace };
    let workers = Cluster::start_in_background(&ClusterSettings { grace, ..workers })?;
    let service = Service::open(&arguments.settings(), workers, metrics)?;
    let listener = TcpListener::bind(arguments.listen)
        .await
        .with_context(|| format!("cannot listen on {}: choose another --listen address", arguments.listen))?;
    let address = listener.local_addr().context("cannot tell the address")?;
    let shutdown =
        stop_on_signal("jobs stop, and go on at the next start").context("cannot listen for signals")?;
    // For scripts: from this line on, clients may call. Where nobody reads it, nobody misses it.
    let _ =
        writeln!(std::io::stdout(), "coordinator serves on {address}, data in {}", arguments.data.display());
    let incoming = incoming(listener, transport.tls().map(Tls::server), CONNECTIONS);
    let is_open = arguments.clients.is_none() && transport == Transport::default();
    let names = match &arguments.listen_names {
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
