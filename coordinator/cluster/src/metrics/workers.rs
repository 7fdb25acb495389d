//! The connected workers, one by one.

use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::time::Duration;

use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::{Registry, Unit};
use protocol::telemetry::Held;

/// The values that are shown.
#[derive(Debug, Default)]
pub(super) struct WorkerValues {
    workers: Gauge,
    threads: Gauge,
    worker_threads: Family<WorkerLabel, Gauge>,
    worker_jobs: Family<WorkerLabel, Counter>,
    worker_rows: Family<WorkerLabel, Counter>,
    worker_rays: Family<WorkerLabel, Counter>,
    worker_busy: Family<WorkerLabel, Counter<f64, AtomicU64>>,
    worker_round_trip: Family<WorkerLabel, Gauge<f64, AtomicU64>>,
}

/// A connected worker.
#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct WorkerLabel {
    worker: String,
    address: String,
}

impl WorkerValues {
    pub(super) fn register(&self, registry: &mut Registry) {
        let Self {
            workers,
            threads,
            worker_threads,
            worker_jobs,
            worker_rows,
            worker_rays,
            worker_busy,
            worker_round_trip,
        } = self;
        registry.register("workers", "Workers connected", workers.clone());
        registry.register("threads", "Threads of the connected workers", threads.clone());
        registry.register("worker_threads", "Threads of a connected worker", worker_threads.clone());
        registry.register("worker_jobs", "Jobs that it finished", worker_jobs.clone());
        registry.register("worker_rows", "Rows in them", worker_rows.clone());
        registry.register("worker_rays", "Rays cast for them", worker_rays.clone());
        registry.register_with_unit(
            "worker_busy",
            "Computing time for them, summed over its threads",
            Unit::Seconds,
            worker_busy.clone(),
        );
        registry.register_with_unit(
            "worker_round_trip",
            "Time to its answer to the last keep-alive",
            Unit::Seconds,
            worker_round_trip.clone(),
        );
    }

    /// Number of connected workers.
    pub(super) fn count(&self) -> i64 {
        self.workers.get()
    }
}

/// Metrics of one connected worker; its series end with it.
#[derive(Debug)]
pub struct WorkerMetrics {
    label: WorkerLabel,
    threads: usize,
    jobs: Counter,
    rows: Counter,
    rays: Counter,
    busy: Counter<f64, AtomicU64>,
    values: Arc<WorkerValues>,
    _counted: Held,
}

impl WorkerMetrics {
    pub(super) fn new(values: &Arc<WorkerValues>, worker: &str, address: &str, threads: usize) -> Self {
        let label = WorkerLabel { worker: worker.into(), address: address.into() };
        values.threads.inc_by(threads as i64);
        values.worker_threads.get_or_create(&label).set(threads as i64);
        Self {
            jobs: values.worker_jobs.get_or_create_owned(&label),
            rows: values.worker_rows.get_or_create_owned(&label),
            rays: values.worker_rays.get_or_create_owned(&label),
            busy: values.worker_busy.get_or_create_owned(&label),
            threads,
            label,
            values: Arc::clone(values),
            _counted: Held::new(&values.workers),
        }
    }

    /// Counts an answer: its rows, rays and computing time.
    pub fn answered(&self, rows: u64, rays: u64, busy: Duration) {
        self.jobs.inc();
        self.rows.inc_by(rows);
        self.rays.inc_by(rays);
        self.busy.inc_by(busy.as_secs_f64());
    }

    /// Sets the time that an answer to a keep-alive took.
    pub fn round_trip(&self, time: Duration) {
        self.values.worker_round_trip.get_or_create(&self.label).set(time.as_secs_f64());
    }
}

impl Drop for WorkerMetrics {
    fn drop(&mut self) {
        let WorkerValues { worker_threads, worker_jobs, worker_rows, worker_rays, .. } = self.values.as_ref();
        worker_threads.remove(&self.label);
        for family in [worker_jobs, worker_rows, worker_rays] {
            family.remove(&self.label);
        }
        self.values.worker_busy.remove(&self.label);
        self.values.worker_round_trip.remove(&self.label);
        self.values.threads.dec_by(self.threads as i64);
    }
}
