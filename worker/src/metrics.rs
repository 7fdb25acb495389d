//! Metrics of a worker, for Prometheus.

use std::sync::atomic::AtomicU64;

use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::{Registry, Unit};
use protocol::worker::worker_message::Body;
use protocol::worker::{FailureReason, Finished, FinishedTile, PassOutcome, RowStatistics};

/// Counters of a worker. A clone is another handle to the same ones.
#[derive(Debug, Clone, Default)]
pub struct Metrics {
    /// Coordinators in conversation.
    pub sessions: Gauge,
    /// Jobs that wait for a thread.
    pub jobs_queued: Gauge,
    /// Jobs being computed.
    pub jobs_computing: Gauge,
    /// Jobs computed.
    pub jobs: Counter,
    /// Jobs not computed, by reason.
    pub failures: Family<Failure, Counter>,
    /// Rows computed.
    pub rows: Counter,
    /// Tiles in finished jobs.
    pub tiles: Counter,
    /// Rays cast for them.
    pub rays: Counter,
    /// Time spent on them, summed over the threads, in seconds.
    pub busy: Counter<f64, AtomicU64>,
    /// Length of the encoded rows, in bytes.
    pub row_bytes: Counter,
    /// Replicas held.
    pub replicas: Gauge,
    /// Their encoded size in bytes.
    pub replica_bytes: Gauge,
    /// Replicas that arrived whole.
    pub uploads: Counter,
    /// Uploads refused or broken off.
    pub failed_uploads: Counter,
    /// Replicas passed on to other workers.
    pub passes: Counter,
    /// Replicas that could not be passed on.
    pub failed_passes: Counter,
}

/// Why a job was not computed.
#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
pub struct Failure {
    /// The reason, as the protocol calls it: `invalid_job`.
    pub reason: String,
}

impl From<FailureReason> for Failure {
    fn from(reason: FailureReason) -> Self {
        let name = reason.as_str_name();
        Self { reason: name.strip_prefix("FAILURE_REASON_").unwrap_or(name).to_ascii_lowercase() }
    }
}

impl Metrics {
    /// Registers the metrics.
    pub fn register(&self, registry: &mut Registry) {
        let registry = registry.sub_registry_with_prefix("halflight_worker");
        registry.register("sessions", "Coordinators in conversation", self.sessions.clone());
        registry.register("jobs_queued", "Jobs that wait for a thread", self.jobs_queued.clone());
        registry.register("jobs_computing", "Jobs being computed", self.jobs_computing.clone());
        registry.register("jobs", "Jobs computed", self.jobs.clone());
        registry.register("job_failures", "Jobs not computed", self.failures.clone());
        registry.register("rows", "Rows computed", self.rows.clone());
        registry.register("tiles", "Tiles of pictures computed", self.tiles.clone());
        registry.register("rays", "Rays cast", self.rays.clone());
        registry.register_with_unit(
            "busy",
            "Time spent on rows and tiles, summed over the threads",
            Unit::Seconds,
            self.busy.clone(),
        );
        registry.register_with_unit("rows_sent", "Encoded rows", Unit::Bytes, self.row_bytes.clone());
        registry.register("replicas", "Replicas held", self.replicas.clone());
        registry.register_with_unit(
            "replicas_held",
            "Encoded size of the replicas held",
            Unit::Bytes,
            self.replica_bytes.clone(),
        );
        registry.register("uploads", "Replicas that arrived whole", self.uploads.clone());
        registry.register("upload_failures", "Uploads refused or broken off", self.failed_uploads.clone());
        registry.register("passes", "Replicas passed on to other workers", self.passes.clone());
        registry.register("pass_failures", "Replicas not passed on", self.failed_passes.clone());
    }

    /// Counts the answer to a job.
    pub fn count(&self, answer: &Body) {
        match answer {
            Body::Finished(finished) => self.count_rows(finished),
            Body::Tile(finished) => self.count_tile(finished),
            Body::Failed(failed) => {
                self.failures.get_or_create(&failed.reason().into()).inc();
            }
            Body::Hello(_) | Body::KeepAlive(_) | Body::Goodbye(_) | Body::Passed(_) | Body::Held(_) => {}
        }
    }

    /// A replica was passed on, or not.
    pub fn pass_ended(&self, outcome: PassOutcome) {
        if outcome == PassOutcome::Done { &self.passes } else { &self.failed_passes }.inc();
    }

    fn count_tile(&self, finished: &FinishedTile) {
        self.jobs.inc();
        self.tiles.inc();
        self.rays.inc_by(finished.rays);
        self.busy.inc_by(finished.busy_nanoseconds as f64 * 1e-9);
    }

    fn count_rows(&self, finished: &Finished) {
        let sum = |part: fn(&RowStatistics) -> u64| finished.statistics.iter().map(part).sum::<u64>();
        self.jobs.inc();
        self.rows.inc_by(finished.rows.len() as u64);
        self.rays.inc_by(sum(|row| row.rays));
        self.busy.inc_by(sum(|row| row.busy_nanoseconds) as f64 * 1e-9);
        self.row_bytes.inc_by(finished.rows.iter().map(|row| row.len() as u64).sum());
    }
}

#[cfg(test)]
mod tests {
    use prometheus_client::encoding::text::encode;
    use protocol::worker::JobFailed;

    use super::*;

    #[test]
    fn figures_have_names_and_units() {
        let metrics = Metrics::default();
        let mut registry = Registry::default();
        metrics.register(&mut registry);
        metrics.sessions.set(2);
        let cost = RowStatistics { rays: 5, busy_nanoseconds: 1_500_000_000, ..RowStatistics::default() };
        let rows = vec![vec![0; 7].into(), vec![0; 4].into()];
        let finished = Finished { rows, statistics: vec![cost; 2], ..Finished::default() };
        let failed = JobFailed { reason: FailureReason::InvalidJob.into(), ..JobFailed::default() };
        metrics.count(&Body::Finished(finished));
        metrics.count(&Body::Failed(failed));
        let mut text = String::new();
        encode(&mut text, &registry).unwrap();
        for line in [
            "halflight_worker_sessions 2",
            "halflight_worker_jobs_total 1",
            "halflight_worker_rows_total 2",
            "halflight_worker_rays_total 10",
            "halflight_worker_busy_seconds_total 3.0",
            "halflight_worker_rows_sent_bytes_total 11",
            "halflight_worker_job_failures_total{reason=\"invalid_job\"} 1",
        ] {
            assert!(text.lines().any(|found| found == line), "{line} is missing in:\n{text}");
        }
    }
}
