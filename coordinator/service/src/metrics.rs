//! Metrics of a service, for Prometheus.

use std::sync::Arc;

use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::{Registry, Unit};
use protocol::api::State;
use protocol::telemetry::Held;

/// Counters and gauges of a service. A clone is another handle to the same metrics.
#[derive(Debug, Clone, Default)]
pub struct Metrics {
    inner: Arc<Inner>,
}

#[derive(Debug, Default)]
struct Inner {
    queued: Gauge,
    running: Gauge,
    ended: Family<StateLabel, Counter>,
    submitted: Counter,
    received: Counter,
    fetched: Counter,
    watchers: Gauge,
    uploads: Gauge,
    stored: Gauge,
    free: Gauge,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct StateLabel {
    state: &'static str,
}

impl Metrics {
    /// Registers the metrics.
    pub fn register(&self, registry: &mut Registry) {
        let Inner { queued, running, ended, submitted, received, fetched, watchers, uploads, stored, free } =
            self.inner.as_ref();
        let registry = registry.sub_registry_with_prefix("halflight_service");
        registry.register("jobs_queued", "Queued jobs", queued.clone());
        registry.register("jobs_running", "Running jobs", running.clone());
        registry.register("jobs_ended", "Ended jobs, by state", ended.clone());
        registry.register("jobs_submitted", "Accepted jobs", submitted.clone());
        registry.register_with_unit(
            "uploads_received",
            "Received bytes of scenes",
            Unit::Bytes,
            received.clone(),
        );
        registry.register_with_unit("results_sent", "Sent bytes of lit files", Unit::Bytes, fetched.clone());
        registry.register("watchers", "Clients watching a job", watchers.clone());
        registry.register("uploads", "Uploads in progress", uploads.clone());
        registry.register_with_unit("data", "Size of the data folder", Unit::Bytes, stored.clone());
        registry.register_with_unit("disk_free", "Free space of its disk", Unit::Bytes, free.clone());
    }

    /// Sets the numbers of queued and running jobs.
    pub fn load(&self, (waiting, running): (usize, usize)) {
        self.inner.queued.set(waiting as i64);
        self.inner.running.set(running as i64);
    }

    /// Counts an accepted job.
    pub fn submitted(&self) {
        self.inner.submitted.inc();
    }

    /// Counts a job that ended in this state.
    pub fn ended(&self, state: State) {
        let state = match state {
            State::Done => "done",
            State::Failed => "failed",
            _ => "cancelled",
        };
        self.inner.ended.get_or_create(&StateLabel { state }).inc();
    }

    /// Counts received bytes of scenes.
    pub fn received(&self, bytes: usize) {
        self.inner.received.inc_by(bytes as u64);
    }

    /// Counts sent bytes of lit files.
    pub fn fetched(&self, bytes: usize) {
        self.inner.fetched.inc_by(bytes as u64);
    }

    /// Counts a watcher while the result is held.
    #[must_use]
    pub fn watching(&self) -> Held {
        Held::new(&self.inner.watchers)
    }

    /// Counts an upload while the result is held.
    #[must_use]
    pub fn uploading(&self) -> Held {
        Held::new(&self.inner.uploads)
    }

    /// Sets the size of the data folder and the free space of its disk, in bytes.
    pub fn room(&self, taken: u64, free: u64) {
        self.inner.stored.set(taken as i64);
        self.inner.free.set(free as i64);
    }
}
