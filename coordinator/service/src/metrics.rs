//! Figures of a service, for Prometheus.

use std::sync::Arc;

use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::{Registry, Unit};
use protocol::api::State;
use protocol::telemetry::Held;

/// What the service counts. A clone is another handle to the same figures.
#[derive(Debug, Clone, Default)]
pub struct Metrics {
    figures: Arc<Figures>,
}

#[derive(Debug, Default)]
struct Figures {
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
    /// Shows the figures in a registry.
    pub fn register(&self, registry: &mut Registry) {
        let Figures { queued, running, ended, submitted, received, fetched, watchers, uploads, stored, free } =
            self.figures.as_ref();
        let registry = registry.sub_registry_with_prefix("halflight_service");
        registry.register("jobs_queued", "Jobs that wait", queued.clone());
        registry.register("jobs_running", "Jobs that run", running.clone());
        registry.register("jobs_ended", "Jobs that ended, by how", ended.clone());
        registry.register("jobs_submitted", "Jobs taken in", submitted.clone());
        registry.register_with_unit("uploads_received", "Bytes of scenes", Unit::Bytes, received.clone());
        registry.register_with_unit("results_sent", "Bytes of lit files", Unit::Bytes, fetched.clone());
        registry.register("watchers", "Clients that watch a job", watchers.clone());
        registry.register("uploads", "Uploads under way", uploads.clone());
        registry.register_with_unit("data", "Files of the data folder", Unit::Bytes, stored.clone());
        registry.register_with_unit("disk_free", "Room on its disk", Unit::Bytes, free.clone());
    }

    /// How many jobs wait and run.
    pub fn load(&self, (waiting, running): (usize, usize)) {
        self.figures.queued.set(waiting as i64);
        self.figures.running.set(running as i64);
    }

    /// A job was taken in.
    pub fn submitted(&self) {
        self.figures.submitted.inc();
    }

    /// A job has ended so.
    pub fn ended(&self, state: State) {
        let state = match state {
            State::Done => "done",
            State::Failed => "failed",
            _ => "cancelled",
        };
        self.figures.ended.get_or_create(&StateLabel { state }).inc();
    }

    /// So many bytes of a scene came.
    pub fn received(&self, bytes: usize) {
        self.figures.received.inc_by(bytes as u64);
    }

    /// So many bytes of a file were taken.
    pub fn fetched(&self, bytes: usize) {
        self.figures.fetched.inc_by(bytes as u64);
    }

    /// Somebody watches, for as long as this is held.
    #[must_use]
    pub fn watching(&self) -> Held {
        Held::new(&self.figures.watchers)
    }

    /// An upload is under way, for as long as this is held.
    #[must_use]
    pub fn uploading(&self) -> Held {
        Held::new(&self.figures.uploads)
    }

    /// Bytes of the data folder, and those that its disk has left.
    pub fn room(&self, taken: u64, free: u64) {
        self.figures.stored.set(taken as i64);
        self.figures.free.set(free as i64);
    }
}
