//! Metrics of the cluster and of a bake, for Prometheus.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::{Registry, Unit};
use protocol::telemetry::Held;

use bake::{Phase, Progress};

/// Metrics of the cluster and of the progress of a bake. Clones share their values.
#[derive(Debug, Clone, Default)]
pub struct Metrics {
    values: Arc<Values>,
}

#[derive(Debug, Default)]
struct Values {
    workers: Gauge,
    reconnections: Counter,
    lost_workers: Counter,
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
    phase: Family<PhaseLabel, Gauge>,
    unshot: Gauge<f64, AtomicU64>,
    vertices: Gauge,
    rows_needed: Gauge,
}

/// A step of the bake: 1 for the one under way, 0 for the others.
#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct PhaseLabel {
    phase: &'static str,
}

impl Metrics {
    /// Registers the metrics.
    pub fn register(&self, registry: &mut Registry) {
        let Values {
            workers,
            reconnections,
            lost_workers,
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
            phase,
            unshot,
            vertices,
            rows_needed,
        } = self.values.as_ref();
        let registry = registry.sub_registry_with_prefix("halflight_coordinator");
        registry.register("workers", "Workers connected", workers.clone());
        registry.register("reconnections", "Workers that came back", reconnections.clone());
        registry.register("lost_workers", "Workers that were lost", lost_workers.clone());
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
        registry.register("phase", "1 for the step under way", phase.clone());
        registry.register("unshot_flux_ratio", "Unshot flux over reflected flux", unshot.clone());
        registry.register("vertices", "Vertices of the mesh", vertices.clone());
        registry.register("rows_needed", "Rows known to be needed so far", rows_needed.clone());
    }

    /// Counts a connected worker until it is dropped.
    #[must_use]
    pub fn connected(&self) -> Held {
        Held::new(&self.values.workers)
    }

    /// Number of connected workers.
    #[must_use]
    pub fn workers(&self) -> usize {
        usize::try_from(self.values.workers.get()).unwrap_or_default()
    }

    /// Counts a worker that came back.
    pub fn came_back(&self) {
        self.values.reconnections.inc();
    }

    /// Counts a lost worker.
    pub fn lost(&self) {
        self.values.lost_workers.inc();
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

    /// Sets the progress of the bake.
    pub fn progress(&self, progress: &Progress) {
        for phase in Phase::ALL {
            let is_on = i64::from(phase == progress.phase);
            self.values.phase.get_or_create(&PhaseLabel { phase: phase.name() }).set(is_on);
        }
        self.values.unshot.set(progress.unshot);
        self.values.vertices.set(progress.vertices as i64);
        self.values.rows_needed.set(progress.rows_needed.try_into().unwrap_or(i64::MAX));
    }
}

#[cfg(test)]
mod tests {
    use prometheus_client::encoding::text::encode;

    use super::*;

    #[test]
    fn figures_are_shown_as_they_are_told() {
        let metrics = Metrics::default();
        let mut registry = Registry::default();
        metrics.register(&mut registry);
        let workers = [metrics.connected(), metrics.connected()];
        metrics.came_back();
        let jobs = [metrics.in_flight(), metrics.in_flight()];
        metrics.unfinished(5);
        metrics.answered(true, 2, 10, Duration::from_millis(500), 100);
        metrics.answered(false, 2, 10, Duration::from_millis(500), 100);
        metrics.sent(7);
        metrics.scheduled(1, 1, 3);
        metrics.lost();
        let [left, _stays] = workers;
        drop(left);
        drop(jobs);
        metrics.progress(&Progress {
            phase: Phase::Refine,
            unshot: 0.25,
            error: None,
            rows: 10,
            rows_needed: 20,
            rays: 1,
            vertices: 30,
        });
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
            "phase{phase=\"refine\"} 1",
            "phase{phase=\"shoot\"} 0",
            "unshot_flux_ratio 0.25",
            "vertices 30",
            "rows_needed 20",
        ] {
            let line = format!("halflight_coordinator_{line}");
            assert!(text.lines().any(|found| found == line), "{line} is missing in:\n{text}");
        }
    }
}
