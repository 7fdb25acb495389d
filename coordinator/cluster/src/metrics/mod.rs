//! Metrics of the cluster, its workers and bakes, for Prometheus.
//!
//! | module | contents |
//! |---|---|
//! | `workers` | the connected workers, one by one |
//! | `bakes` | progress of bakes |

mod bakes;
mod workers;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::{Registry, Unit};
use protocol::telemetry::Held;

use bakes::BakeValues;
use workers::WorkerValues;

pub use bakes::BakeMetrics;
pub use workers::WorkerMetrics;

/// Metrics of the cluster and of the progress of bakes. Clones share their values.
#[derive(Debug, Clone, Default)]
pub struct Metrics {
    values: Arc<Values>,
}

#[derive(Debug, Default)]
struct Values {
    workers: Arc<WorkerValues>,
    reconnections: Counter,
    lost_workers: Counter,
    left_workers: Counter,
    jobs_in_flight: Gauge,
    jobs_waiting: Gauge,
    jobs: Counter,
    rows: Counter,
    rays: Counter,
    busy: Counter<f64, AtomicU64>,
    bytes_received: Counter,
    bytes_sent: Counter,
    duplicates_sent: Counter,
    duplicates_dropped: Counter,
    ignored_answers: Counter,
    bakes: Arc<BakeValues>,
}

impl Metrics {
    /// Registers the metrics.
    pub fn register(&self, registry: &mut Registry) {
        let Values {
            workers,
            reconnections,
            lost_workers,
            left_workers,
            jobs_in_flight,
            jobs_waiting,
            jobs,
            rows,
            rays,
            busy,
            bytes_received,
            bytes_sent,
            duplicates_sent,
            duplicates_dropped,
            ignored_answers,
            bakes,
        } = self.values.as_ref();
        let registry = registry.sub_registry_with_prefix("halflight_coordinator");
        workers.register(registry);
        registry.register("reconnections", "Workers that came back", reconnections.clone());
        registry.register("lost_workers", "Workers that were lost", lost_workers.clone());
        registry.register("left_workers", "Workers that said goodbye", left_workers.clone());
        registry.register("jobs_in_flight", "Jobs that workers hold, duplicates too", jobs_in_flight.clone());
        registry.register("jobs_waiting", "Jobs that no worker holds", jobs_waiting.clone());
        registry.register("jobs", "Jobs finished", jobs.clone());
        registry.register("rows", "Rows in them", rows.clone());
        registry.register("rays", "Rays cast for them", rays.clone());
        registry.register_with_unit(
            "busy",
            "Computing time, summed over threads",
            Unit::Seconds,
            busy.clone(),
        );
        registry.register_with_unit("received", "Encoded rows", Unit::Bytes, bytes_received.clone());
        registry.register_with_unit("sent", "Replicas and jobs", Unit::Bytes, bytes_sent.clone());
        registry.register("duplicates_sent", "Jobs sent to a second worker as well", duplicates_sent.clone());
        registry.register(
            "duplicates_dropped",
            "Answers dropped because another worker had answered before",
            duplicates_dropped.clone(),
        );
        registry.register("ignored_answers", "Answers that came late or twice", ignored_answers.clone());
        bakes.register(registry);
    }

    /// Shows a connected worker, by its own name and its address, until it is dropped.
    #[must_use]
    pub fn connected(&self, worker: &str, address: &str, threads: usize) -> WorkerMetrics {
        WorkerMetrics::new(&self.values.workers, worker, address, threads)
    }

    /// Number of connected workers.
    #[must_use]
    pub fn workers(&self) -> usize {
        usize::try_from(self.values.workers.count()).unwrap_or_default()
    }

    /// Counts a worker that came back.
    pub fn came_back(&self) {
        self.values.reconnections.inc();
    }

    /// Counts a lost worker; `orderly` if it said goodbye.
    pub fn lost(&self, orderly: bool) {
        if orderly { &self.values.left_workers } else { &self.values.lost_workers }.inc();
    }

    /// Counts a job that a worker holds until it is dropped.
    #[must_use]
    pub fn in_flight(&self) -> Held {
        Held::new(&self.values.jobs_in_flight)
    }

    /// Sets the number of jobs that are not finished, whether a worker holds them or not.
    pub fn unfinished(&self, jobs: usize) {
        let waiting = jobs as i64 - self.values.jobs_in_flight.get();
        self.values.jobs_waiting.set(waiting.max(0));
    }

    /// Counts an answer to a job: its rows, rays, computing time and bytes. Rows and rays count for the first answer only.
    pub fn answered(&self, is_first: bool, rows: u64, rays: u64, busy: Duration, bytes: u64) {
        if is_first {
            self.values.jobs.inc();
            self.values.rows.inc_by(rows);
            self.values.rays.inc_by(rays);
        }
        self.values.busy.inc_by(busy.as_secs_f64());
        self.values.bytes_received.inc_by(bytes);
    }

    /// Counts bytes of replicas and jobs sent to a worker.
    pub fn sent(&self, bytes: u64) {
        self.values.bytes_sent.inc_by(bytes);
    }

    /// Sets the counts of the scheduler: jobs sent twice, answers dropped because another worker was first, answers to jobs that the
    /// worker did not hold.
    pub fn scheduled(&self, duplicates_sent: u64, duplicates_dropped: u64, ignored_answers: u64) {
        let set = |counter: &Counter, value| counter.inner().store(value, Ordering::Relaxed);
        set(&self.values.duplicates_sent, duplicates_sent);
        set(&self.values.duplicates_dropped, duplicates_dropped);
        set(&self.values.ignored_answers, ignored_answers);
    }

    /// Shows the progress of one more bake until it is dropped.
    #[must_use]
    pub fn bake(&self) -> BakeMetrics {
        BakeMetrics::new(&self.values.bakes)
    }
}

#[cfg(test)]
mod tests {
    use bake::{Phase, Progress, TimeParts};
    use prometheus_client::encoding::text::encode;

    use super::*;

    #[test]
    fn figures_are_shown_as_they_are_told() {
        let metrics = Metrics::default();
        let mut registry = Registry::default();
        metrics.register(&mut registry);
        let workers =
            [metrics.connected("a", "10.0.0.1:7070", 3), metrics.connected("b", "10.0.0.2:7070", 4)];
        workers.iter().for_each(|worker| worker.answered(2, 10, Duration::from_millis(500)));
        workers.iter().for_each(|worker| worker.round_trip(Duration::from_millis(250)));
        metrics.came_back();
        let jobs = [metrics.in_flight(), metrics.in_flight()];
        metrics.unfinished(5);
        metrics.answered(true, 2, 10, Duration::from_millis(500), 100);
        metrics.answered(false, 2, 10, Duration::from_millis(500), 100);
        metrics.sent(7);
        metrics.scheduled(1, 1, 3);
        metrics.lost(false);
        metrics.lost(true);
        metrics.lost(true);
        let [left, _stays] = workers;
        drop(left);
        drop(jobs);
        let progress = Progress {
            phase: Phase::Refine,
            unshot: 0.25,
            error: None,
            rows: 10,
            rows_needed: 20,
            rays: 1,
            vertices: 30,
            time: TimeParts { rows: 2.0, own: 0.5, ..TimeParts::default() },
        };
        let [first, second, over] = [metrics.bake(), metrics.bake(), metrics.bake()];
        first.progress(&Progress { phase: Phase::Shoot, unshot: 0.5, ..progress });
        first.progress(&progress);
        let time = TimeParts { rows: 3.0, own: 0.25, ..TimeParts::default() };
        first.progress(&Progress { time, ..progress });
        second.progress(&Progress { unshot: 0.125, vertices: 7, ..progress });
        over.progress(&Progress { phase: Phase::Shoot, unshot: 1.0, ..progress });
        drop(over);
        let mut text = String::new();
        encode(&mut text, &registry).unwrap();
        for line in [
            "workers 1",
            "reconnections_total 1",
            "lost_workers_total 1",
            "jobs_in_flight 0",
            "jobs_waiting 3",
            "jobs_total 1",
            "rows_total 2",
            "rays_total 10",
            "busy_seconds_total 1.0",
            "received_bytes_total 200",
            "sent_bytes_total 7",
            "duplicates_sent_total 1",
            "duplicates_dropped_total 1",
            "ignored_answers_total 3",
            "left_workers_total 2",
            "threads 4",
            "worker_threads{worker=\"b\",address=\"10.0.0.2:7070\"} 4",
            "worker_jobs_total{worker=\"b\",address=\"10.0.0.2:7070\"} 1",
            "worker_rows_total{worker=\"b\",address=\"10.0.0.2:7070\"} 2",
            "worker_rays_total{worker=\"b\",address=\"10.0.0.2:7070\"} 10",
            "worker_busy_seconds_total{worker=\"b\",address=\"10.0.0.2:7070\"} 0.5",
            "worker_round_trip_seconds{worker=\"b\",address=\"10.0.0.2:7070\"} 0.25",
            "phase{phase=\"refine\"} 2",
            "phase{phase=\"shoot\"} 0",
            "unshot_flux_ratio 0.25",
            "vertices 37",
            "rows_needed 40",
            "bake_seconds_total{part=\"rows\"} 7.0",
            "bake_seconds_total{part=\"own\"} 1.5",
        ] {
            let line = format!("halflight_coordinator_{line}");
            assert!(text.lines().any(|found| found == line), "{line} is missing in:\n{text}");
        }
        assert!(!text.contains("10.0.0.1:7070"), "one that is gone is not shown");
    }
}
