use std::net::SocketAddr;

use anyhow::Context;
use clap::Args;
use cluster::metrics::Metrics;
use prometheus_client::registry::Registry;
use protocol::telemetry::{LogFormat, Logging, LoggingError, LoggingSettings, MetricsAddress, MetricsPage};

/// What is seen of a running coordinator.
#[derive(Args)]
pub struct TelemetryArguments {
    /// Figures for Prometheus at this address, under /metrics, while the program works; port 0 takes a free one
    /// [default: none].
    #[arg(long, env = "COORDINATOR_METRICS", value_name = "HOST:PORT", global = true)]
    metrics: Option<MetricsAddress>,
    /// How logs are written: text or json.
    #[arg(long, env = "COORDINATOR_LOG", value_name = "FORMAT", default_value = "text", global = true)]
    log: LogFormat,
}

impl TelemetryArguments {
    /// Begins to log.
    pub fn log(&self) -> Result<Logging, LoggingError> {
        Logging::start(&LoggingSettings {
            program: "coordinator",
            format: self.log,
            default_filter: "warn",
            times: false,
        })
    }

    /// Shows these figures, for as long as the page is held, where that is asked for.
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
