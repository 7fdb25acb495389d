use std::net::SocketAddr;

use anyhow::Context;
use clap::Args;
use cluster::metrics::Metrics;
use prometheus_client::registry::Registry;
use protocol::telemetry::{LogFormat, Logging, LoggingError, LoggingSettings, MetricsAddress, MetricsPage};

/// What a running coordinator shows of itself.
#[derive(Args)]
#[command(next_help_heading = "Telemetry")]
pub struct TelemetryArguments {
    /// Address for Prometheus metrics, under /metrics; port 0 takes a free one [default: none]
    #[arg(long, env = "COORDINATOR_METRICS", value_name = "HOST:PORT")]
    metrics: Option<MetricsAddress>,
    /// Format of logs: text or json
    #[arg(long, env = "COORDINATOR_LOG", value_name = "FORMAT", default_value = "text")]
    pub log: LogFormat,
}

/// Starts logging.
pub fn log(format: Option<LogFormat>) -> Result<Logging, LoggingError> {
    Logging::start(&LoggingSettings {
        program: "coordinator",
        format: format.unwrap_or_default(),
        default_filter: "warn",
        times: false,
    })
}

impl TelemetryArguments {
    /// Serves these metrics until the page is dropped, if an address was given.
    pub fn show(&self, metrics: &Metrics, service: &service::Metrics) -> anyhow::Result<Option<MetricsPage>> {
        let Some(MetricsAddress(Some(address))) = self.metrics else { return Ok(None) };
        page(address, metrics, service).map(Some)
    }
}

fn page(address: SocketAddr, metrics: &Metrics, service: &service::Metrics) -> anyhow::Result<MetricsPage> {
    let mut registry = Registry::default();
    metrics.register(&mut registry);
    service.register(&mut registry);
    MetricsPage::start(address, registry)
        .with_context(|| format!("cannot show metrics at {address}: choose another --metrics address"))
}
