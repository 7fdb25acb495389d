use opentelemetry::trace::TracerProvider;
use opentelemetry_otlp::SpanExporter;
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::trace::SdkTracerProvider;
use tokio::runtime::Runtime;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::{Layer, Registry};

/// Variables with the address of the collector; without one of them no span is made.
const ENDPOINTS: [&str; 2] = ["OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_EXPORTER_OTLP_ENDPOINT"];

/// Sends spans in the background, and the remaining ones when dropped.
pub(super) struct Exporter {
    provider: SdkTracerProvider,
    /// The connection lives on it.
    _runtime: Runtime,
}

impl Drop for Exporter {
    fn drop(&mut self) {
        if let Err(error) = self.provider.shutdown() {
            tracing::warn!(%error, "some spans did not reach the collector");
        }
    }
}

type SpanLayer = Box<dyn Layer<Registry> + Send + Sync>;

/// Returns a layer that sends the spans of this workspace, if a collector is configured.
pub(super) fn exporter(program: &'static str) -> Result<Option<(SpanLayer, Exporter)>, String> {
    let is_named = |name: &&str| std::env::var(name).is_ok_and(|value| !value.is_empty());
    if !ENDPOINTS.iter().any(|name| is_named(&name)) {
        return Ok(None);
    }
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .thread_name("spans")
        .enable_all()
        .build()
        .map_err(|error| error.to_string())?;
    let exporter = {
        let _entered = runtime.enter();
        SpanExporter::builder().with_tonic().build().map_err(|error| error.to_string())?
    };
    let provider = SdkTracerProvider::builder()
        .with_batch_exporter(exporter)
        .with_resource(Resource::builder().with_service_name(program).build())
        .build();
    // The libraries below have spans too, those of the exporter among them.
    let ours = ["coordinator", "worker", "shared"].map(|target| (target, LevelFilter::INFO));
    let layer = tracing_opentelemetry::layer()
        .with_tracer(provider.tracer(program))
        .with_filter(Targets::new().with_targets(ours))
        .boxed();
    Ok(Some((layer, Exporter { provider, _runtime: runtime })))
}
