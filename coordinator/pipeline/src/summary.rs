//! What comes out of a bake beside the lit mesh: figures for programs, and what the lit file says of itself.

use glam::DVec3;
use serde_json::{Value, json};

use bake::{BakeReport, BakeSettings, Relit};
use cluster::checkpoint::CheckpointSummary;
use cluster::{ClusterCounts, WorkerPart, WorkerSummary};
use output::export::Exported;
use scene::ImportReport;
use scene::Scene;

/// All figures of a bake.
pub struct Summary<'a> {
    /// Wall time from the file to the lit file.
    pub seconds: f64,
    /// Unit of the irradiance.
    pub unit: &'a str,
    /// What of the file counts, and what is passed over.
    pub account: &'a ImportReport,
    /// Triangles dropped on import.
    pub degenerate_triangles: usize,
    /// Largest memory of this process so far; none where the system does not say, or the process does other things too.
    pub peak_memory_bytes: Option<u64>,
    /// Of the bake.
    pub bake: &'a BakeReport,
    /// Of the output.
    pub exported: &'a Exported,
    /// Of each worker, and of the cluster as a whole.
    pub workers: Computed<'a>,
    /// Of the checkpoint, where there was one.
    pub checkpoint: Option<&'a CheckpointSummary>,
}

/// Who computed the rows.
pub enum Computed<'a> {
    /// Workers that had nothing else to do.
    Alone(&'a [WorkerSummary], ClusterCounts),
    /// Workers that others had as well: what they did for this bake. How long they were connected, and what was sent to them, is
    /// nobody's alone.
    Shared(&'a [WorkerPart]),
}

impl Computed<'_> {
    /// The figures of each worker, and of the cluster as a whole.
    fn to_json(&self) -> (Vec<Value>, Option<Value>) {
        match self {
            Self::Shared(parts) => (parts.iter().map(part).collect(), None),
            Self::Alone(workers, counts) => {
                let counts = json!({
                    "duplicates": counts.duplicates, "ignored_answers": counts.ignored_answers,
                    "lost_workers": counts.lost_workers,
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
    let mut figures = part(&worker.part);
    figures["late"] = json!(worker.late);
    figures["busy_share"] = json!(busy_share(worker));
    figures["connected_seconds"] = json!(worker.connected.as_secs_f64());
    figures["connections"] = json!(worker.connections);
    figures["bytes_sent"] = json!(worker.bytes_sent);
    figures["lost"] = json!(worker.lost);
    figures
}

impl Summary<'_> {
    /// All figures as JSON.
    ///
    /// # Errors
    /// When a figure cannot be written.
    pub fn to_json(&self, settings: &BakeSettings) -> serde_json::Result<String> {
        let (workers, cluster) = self.workers.to_json();
        serde_json::to_string_pretty(&json!({
            "seconds": self.seconds,
            "unit": self.unit,
            "exposure": self.exported.exposure,
            "output_vertices": self.exported.vertices,
            "output_triangles": self.exported.triangles,
            "account": self.account,
            "degenerate_triangles": self.degenerate_triangles,
            "peak_memory_bytes": self.peak_memory_bytes,
            "bake": self.bake,
            "settings": settings,
            "workers": workers,
            "checkpoint": self.checkpoint.map(|checkpoint| json!({
                "rows_read": checkpoint.rows_read, "rows_written": checkpoint.rows_written,
                "rows_dropped": checkpoint.rows_dropped, "bytes": checkpoint.bytes, "stopped": checkpoint.stopped,
            })),
            "cluster": cluster,
        }))
    }
}

/// Part of the time of its threads that a worker computed.
#[must_use]
pub fn busy_share(worker: &WorkerSummary) -> f64 {
    let time = worker.connected.as_secs_f64() * worker.part.threads as f64;
    if time > 0.0 { worker.part.busy.as_secs_f64() / time } else { 0.0 }
}

/// What a lit file says of the bake that it came from.
#[must_use]
pub fn extras(scene: &Scene, settings: &BakeSettings, report: &BakeReport) -> Value {
    with_sky(json!({ "energy_balance": report.balance, "settings": settings }), scene)
}

/// The same of a file that was lit otherwise.
#[must_use]
pub fn relit_extras(relit: &Relit) -> Value {
    with_sky(json!({ "relit": relit.report }), &relit.scene)
}

/// All figures of a relight as JSON; `seconds` are those from the file to the lit file.
///
/// # Errors
/// When a figure cannot be written.
pub fn relit_json(relit: &Relit, exported: &Exported, seconds: f64) -> serde_json::Result<String> {
    let figures = json!({ "seconds": seconds, "relight": relit.report, "exposure": exported.exposure });
    serde_json::to_string_pretty(&figures)
}

fn with_sky(mut extras: Value, scene: &Scene) -> Value {
    if scene.sky != DVec3::ZERO {
        // What a picture shows where there is no surface.
        extras["sky"] = json!(scene.sky.to_array());
    }
    extras
}
