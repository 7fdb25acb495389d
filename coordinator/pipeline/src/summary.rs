//! Metrics of a run for programs, and the extras of a lit file.

use glam::DVec3;
use serde_json::{Value, json};

use bake::{BakeReport, BakeSettings, Relit, TimeParts};
use cluster::checkpoint::CheckpointSummary;
use cluster::{ClusterCounts, WorkerPart, WorkerSummary};
use lightmap::PlanReport;
use output::export::{Exported, Unshared};
use scene::ImportReport;
use scene::Scene;

/// The metrics of a bake.
#[derive(Debug)]
pub struct Summary {
    /// Wall time from the scene file to the lit file.
    pub seconds: f64,
    /// How it divides.
    pub time: TimeDivision,
    /// Unit of the irradiance.
    pub unit: String,
    /// What of the scene file is modelled, and what is ignored.
    pub account: ImportReport,
    /// Triangles without area, dropped on import.
    pub degenerate_triangles: usize,
    /// Largest memory of this process so far; `None` where the system does not say.
    pub peak_memory_bytes: Option<u64>,
    /// The bake.
    pub bake: BakeReport,
    /// The lightmap, if there is one.
    pub lightmap: Option<PlanReport>,
    /// The probes, if there are any.
    pub probes: Option<probes::PlanReport>,
    /// The lit file.
    pub exported: Exported,
    /// The workers.
    pub workers: WorkerMetrics,
    /// The checkpoint, if there was one.
    pub checkpoint: Option<CheckpointSummary>,
}

/// How the wall time of a run divides.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeDivision {
    /// The parts. Import and export are own arithmetic of the coordinator; connecting to workers and taking leave of them is network.
    pub parts: TimeParts,
    /// Seconds of own arithmetic, by steps.
    pub own: Vec<(&'static str, f64)>,
}

impl TimeDivision {
    /// Divides the time of a run, given the seconds from its start to the end of the import, of the bake, and of all.
    #[must_use]
    pub fn new(bake: &BakeReport, [imported, baked, all]: [f64; 3]) -> Self {
        let exporting = all - baked;
        let mut parts = bake.time;
        parts.network += (baked - imported - bake.time.total()).max(0.0);
        parts.own += imported + exporting;
        let mut own = vec![("import", imported)];
        own.extend_from_slice(&bake.own_seconds);
        own.push(("export", exporting));
        Self { parts, own }
    }

    fn to_json(&self) -> Value {
        let mut json = json!(self.parts);
        json["own_steps"] = json!(self.own);
        json
    }
}

/// What the workers of a run did.
#[derive(Debug)]
pub enum WorkerMetrics {
    /// Each worker, and the cluster as a whole, which this run had for itself.
    Exclusive(Vec<WorkerSummary>, ClusterCounts),
    /// The part of each worker in this run, where other runs had the same workers.
    Shared(Vec<WorkerPart>),
}

impl WorkerMetrics {
    /// Each worker, and the cluster as a whole.
    fn to_json(&self) -> (Vec<Value>, Option<Value>) {
        match self {
            Self::Shared(parts) => (parts.iter().map(part).collect(), None),
            Self::Exclusive(workers, counts) => {
                let counts = json!({
                    "duplicates": counts.duplicates, "ignored_answers": counts.ignored_answers,
                    "lost_workers": counts.lost_workers, "passed_replicas": counts.passed_replicas,
                });
                (workers.iter().map(whole).collect(), Some(counts))
            }
        }
    }
}

fn part(worker: &WorkerPart) -> Value {
    json!({
        "name": worker.name, "address": worker.address, "threads": worker.threads, "jobs": worker.jobs, "rows": worker.rows,
        "rays": worker.rays, "busy_seconds": worker.busy.as_secs_f64(), "bytes_received": worker.bytes_received,
    })
}

fn whole(worker: &WorkerSummary) -> Value {
    let mut metrics = part(&worker.part);
    metrics["late"] = json!(worker.late);
    metrics["busy_share"] = json!(busy_share(worker));
    metrics["connected_seconds"] = json!(worker.connected.as_secs_f64());
    metrics["connections"] = json!(worker.connections);
    metrics["bytes_sent"] = json!(worker.bytes_sent);
    metrics["lost"] = json!(worker.lost);
    metrics
}

impl Summary {
    /// Encodes all metrics as JSON.
    ///
    /// # Errors
    /// When a number cannot be expressed in JSON.
    pub fn to_json(&self, settings: &BakeSettings) -> serde_json::Result<String> {
        let (workers, cluster) = self.workers.to_json();
        serde_json::to_string_pretty(&json!({
            "seconds": self.seconds,
            "time": self.time.to_json(),
            "unit": self.unit,
            "exposure": self.exported.exposure,
            "output_vertices": self.exported.vertices,
            "output_triangles": self.exported.triangles,
            "unshared": self.exported.unshared.map(|Unshared { meshes, nodes, vertices }| json!({
                "meshes": meshes, "nodes": nodes, "vertices": vertices,
            })),
            "account": self.account,
            "degenerate_triangles": self.degenerate_triangles,
            "peak_memory_bytes": self.peak_memory_bytes,
            "bake": self.bake,
            "lightmap": self.lightmap,
            "probes": self.probes,
            "settings": settings,
            "workers": workers,
            "checkpoint": self.checkpoint.as_ref().map(|checkpoint| json!({
                "rows_read": checkpoint.rows_read, "rows_written": checkpoint.rows_written,
                "rows_dropped": checkpoint.rows_dropped, "bytes": checkpoint.bytes, "stopped": checkpoint.stopped,
            })),
            "cluster": cluster,
        }))
    }
}

/// Returns the fraction of its thread time that a worker was computing.
#[must_use]
pub fn busy_share(worker: &WorkerSummary) -> f64 {
    let time = worker.connected.as_secs_f64() * worker.part.threads as f64;
    if time > 0.0 { worker.part.busy.as_secs_f64() / time } else { 0.0 }
}

/// The extras of a baked file.
pub(crate) fn extras(scene: &Scene, settings: &BakeSettings, report: &BakeReport) -> Value {
    with_sky(json!({ "energy_balance": report.balance, "settings": settings }), scene)
}

/// The extras of a relit file.
pub(crate) fn relit_extras(relit: &Relit) -> Value {
    with_sky(json!({ "relit": relit.report }), &relit.scene)
}

/// Encodes all metrics of a relight as JSON; `seconds` is the wall time from the files to the lit file.
pub(crate) fn relit_json(relit: &Relit, exported: &Exported, seconds: f64) -> serde_json::Result<String> {
    let metrics = json!({ "seconds": seconds, "relight": relit.report, "exposure": exported.exposure });
    serde_json::to_string_pretty(&metrics)
}

fn with_sky(mut extras: Value, scene: &Scene) -> Value {
    if scene.sky != DVec3::ZERO {
        // `render` shows it where there is no surface.
        extras["sky"] = json!(scene.sky.to_array());
    }
    extras
}
