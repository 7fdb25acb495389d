//! From a scene file to a lit file: import, bake, export, report.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use bake::{
    AskedPoints, BakeError, BakeSettings, Baked, Observer, RelightError, RowService, bake_with_points,
    check_groups, occlusion,
};
use cluster::checkpoint::{CheckpointError, CheckpointSummary, Checkpointed, OpenCheckpoint, remove};
use cluster::{Cluster, ClusterError, ClusterSettings, WorkerPart};
use lightmap::LightmapError;
use output::export::{ExportError, ExportSettings, LightmapPages, check_lightmap, export, export_lightmap};
use probes::ProbeError;
use scene::{ImportError, ImportOptions, Scene, import, import_slice};
use serde_json::json;

use crate::files_beside::check_files;
use crate::lightmap_run::{LightmapSettings, lay_out, lit_twice, warnings};
use crate::memory::peak_memory_bytes;
use crate::probes_run::{self, ProbeSettings};
use crate::summary::{Summary, TimeDivision, WorkerMetrics, extras};

/// A scene file.
pub enum SceneSource<'a> {
    /// A file, with the buffers and images beside it.
    File(&'a Path),
    /// The bytes of a file; references to other files are refused.
    Bytes(Vec<u8>),
}

impl SceneSource<'_> {
    /// The file, where it is one.
    pub(crate) fn file(&self) -> Option<PathBuf> {
        match self {
            Self::File(path) => Some(path.to_path_buf()),
            Self::Bytes(_) => None,
        }
    }
}

/// What to bake, and the files to write.
pub struct BakeRequest<'a> {
    /// The scene.
    pub scene: SceneSource<'a>,
    /// How it is read.
    pub import: ImportOptions,
    /// How it is baked.
    pub bake: BakeSettings,
    /// How the lit file is written; its extras are added by the run.
    pub export: ExportSettings,
    /// The lightmap that it gets, if any.
    pub lightmap: Option<LightmapSettings>,
    /// The probes that are written, if any.
    pub probes: Option<ProbeSettings>,
    /// Distance within which things occlude, units of the file, if ambient occlusion is written.
    pub occlusion: Option<f64>,
    /// The lit file.
    pub output: &'a Path,
    /// File for the light of each source, written if the bake keeps it ([`BakeSettings::keep_light`]).
    pub kept_light: Option<&'a Path>,
    /// File for all metrics as JSON.
    pub report: Option<&'a Path>,
    /// File for finished rows.
    pub checkpoint: Option<CheckpointFile<'a>>,
}

/// A file that records finished rows, so that an interrupted bake can resume.
#[derive(Debug, Clone, Copy)]
pub struct CheckpointFile<'a> {
    /// The file.
    pub path: &'a Path,
    /// Largest size in bytes; rows beyond it are not recorded.
    pub max_bytes: u64,
    /// Replace a file that cannot be used instead of failing.
    pub replace: bool,
    /// Leave the file in place when the output is written.
    pub keep: bool,
}

/// A finished bake.
#[derive(Debug)]
pub struct Finished {
    /// Its metrics.
    pub summary: Summary,
    /// The same as JSON.
    pub report_json: String,
    /// Names of the lights that a relight can change; `None` if the light of each source was not kept.
    pub lights: Option<Vec<String>>,
}

/// Why a run failed.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The scene cannot be read.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// A light group names a light that the scene does not have.
    #[error(transparent)]
    Groups(BakeError),
    /// No workers can be had.
    #[error(transparent)]
    Cluster(#[from] ClusterError),
    /// The checkpoint cannot be used.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// A checkpoint that is not needed any more cannot be removed.
    #[error(transparent)]
    CheckpointRemoval(CheckpointError),
    /// The bake failed or was cancelled.
    #[error(transparent)]
    Bake(#[from] BakeError),
    /// The scene can have no such lightmap.
    #[error(transparent)]
    Lightmap(#[from] LightmapError),
    /// The scene can have no such probes.
    #[error(transparent)]
    Probes(#[from] ProbeError),
    /// The lit file cannot be written.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The file of kept light cannot be read or written.
    #[error("kept light {} cannot be used: {error}", path.display())]
    KeptLight {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        error: io::Error,
    },
    /// The scene cannot be relit.
    #[error(transparent)]
    Relight(#[from] RelightError),
    /// The probes cannot be written.
    #[error("probes {} cannot be written: {error}", path.display())]
    ProbeFile {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        error: io::Error,
    },
    /// The report cannot be written.
    #[error("report {} cannot be written: {error}", path.display())]
    Report {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        error: io::Error,
    },
    /// The metrics cannot be expressed in JSON.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
}

/// Observes a run beyond its bake.
pub trait RunObserver: Observer {
    /// Takes warnings for the user, as soon as they are known.
    fn warn(&mut self, warnings: &[String]);

    /// Called when the scene is read and the bake begins.
    fn imported(&mut self, _scene: &Arc<Scene>) {}

    /// Called when the light is known and the output is written next.
    fn exporting(&mut self) {}
}

/// The workers of a run.
pub enum Workers<'a> {
    /// A cluster for this run alone, started when the scene is read.
    Exclusive(&'a ClusterSettings),
    /// Workers that other runs use too.
    Shared(&'a mut dyn SharedRows),
}

/// Rows of workers that other runs use too.
pub trait SharedRows: RowService {
    /// The part of each worker in this run so far.
    fn workers(&self) -> Vec<WorkerPart>;
}

/// Bakes a scene file: writes the lit file and the other files of the request.
///
/// # Errors
/// When a step fails or the observer cancels. An output that was there before is then as it was; the checkpoint stays.
pub fn run(
    request: BakeRequest<'_>,
    workers: Workers<'_>,
    observer: &mut dyn RunObserver,
) -> Result<Finished, RunError> {
    let clock = Instant::now();
    let file = request.scene.file();
    let scene = Arc::new(read_scene(request.scene, &request.import, observer)?);
    let written = [
        ("report", request.report),
        ("kept light", request.kept_light),
        ("checkpoint", request.checkpoint.as_ref().map(|checkpoint| checkpoint.path)),
    ];
    check_groups(&scene, &request.bake.groups).map_err(RunError::Groups)?;
    if observer.is_cancelled() {
        return Err(BakeError::Cancelled.into());
    }
    let (probes, probe_file) = probes_run::lay_out(&scene, request.probes.as_ref(), request.output)?;
    if probes.is_some() {
        observer.warn(&Vec::from_iter(lit_twice(&scene, &request.bake, "the probes")));
    }
    if let Some(path) = &probe_file {
        files::check(path).map_err(ExportError::File)?;
    }
    let probe_written = [("file of probes", probe_file.as_deref())];
    let written: Vec<_> = written.into_iter().chain(probe_written).collect();
    check_files((&scene, file.as_deref()), None, request.output, &written)?;
    let plan = match &request.lightmap {
        Some(settings) => {
            check_lightmap(request.output, 0, settings.format)?;
            let plan = lay_out(&scene, settings.resolution, || observer.is_cancelled());
            let plan = plan.map_err(|error| match error {
                LightmapError::Cancelled => RunError::Bake(BakeError::Cancelled),
                error => RunError::Lightmap(error),
            })?;
            observer.warn(&warnings(&scene, &request.bake, plan.report()));
            let beside = check_lightmap(request.output, plan.report().pages, settings.format)?;
            let pages = beside.iter().map(|path| ("page of the lightmap", Some(&**path)));
            let written: Vec<_> = written.into_iter().chain(pages).collect();
            check_files((&scene, file.as_deref()), None, request.output, &written)?;
            Some(plan)
        }
        None => None,
    };
    observer.imported(&scene);
    let imported = clock.elapsed().as_secs_f64();
    let points = AskedPoints {
        on_surfaces: plan.as_ref().map_or(&[], |plan| plan.points()),
        around: plan.as_ref().map_or(&[], |plan| plan.around()),
        in_space: probes.as_ref().map_or(&[], |probes| probes.receivers()),
        // A lightmap is for the input's own.
        without_mesh: plan.is_some() && request.occlusion.is_none(),
    };
    let wanted = Wanted { settings: &request.bake, points };
    let (mut baked, workers, recorded) =
        bake_on(workers, &scene, &wanted, request.checkpoint.as_ref(), observer)?;
    let done = clock.elapsed().as_secs_f64();
    observer.exporting();
    observer.warn(&baked.report.warnings);
    let mut extras = extras(&scene, &request.bake, &baked.report);
    if let Some(distance) = request.occlusion {
        let found = occlusion(&scene, &baked.lit, distance, || observer.is_cancelled());
        baked.lit.occlusion = found.ok_or(BakeError::Cancelled)?;
        extras["occlusion"] = json!({ "distance": distance });
    }
    let groups: Vec<String> = baked.lit.layers.iter().map(|layer| layer.name.clone()).collect();
    let probes = probes.map(|probes| probes.probes(&baked.at_points.in_space));
    let mut probe_bytes = None;
    if let Some(probes) = &probes {
        let json = probes.to_json(&groups, &request.export.unit);
        probe_bytes =
            probe_file.map(|path| Ok::<_, RunError>((path, serde_json::to_vec(&json)?))).transpose()?;
        extras["probes"] = json;
    }
    let settings = ExportSettings { extras, ..request.export };
    let lightmap = plan.map(|plan| plan.lightmap(&baked.at_points.on_surfaces));
    let exported = match (&lightmap, &request.lightmap) {
        (Some(map), Some(LightmapSettings { format, .. })) => {
            let pages = LightmapPages { map, groups, format: *format };
            export_lightmap(&scene, &baked.lit, &pages, &settings, request.output)?
        }
        _ => export(&scene, &baked.lit, &settings, request.output)?,
    };
    observer.warn(&exported.warnings);
    if let Some((path, bytes)) = probe_bytes {
        files::write(&path, &bytes).map_err(|error| RunError::ProbeFile { path, error })?;
    }
    if let (Some(path), Some(kept)) = (request.kept_light, &baked.kept) {
        files::write(path, &kept.to_bytes())
            .map_err(|error| RunError::KeptLight { path: path.to_owned(), error })?;
    }
    let seconds = clock.elapsed().as_secs_f64();
    let summary = Summary {
        seconds,
        time: TimeDivision::new(&baked.report, [imported, done, seconds]),
        unit: settings.unit,
        account: scene.import_report.clone(),
        degenerate_triangles: scene.degenerate_triangles,
        peak_memory_bytes: peak_memory_bytes(),
        bake: baked.report,
        lightmap: lightmap.map(|map| map.report),
        probes: probes.map(|probes| probes.report()),
        exported,
        workers,
        checkpoint: recorded,
    };
    let report_json = summary.to_json(&request.bake)?;
    write_report(request.report, &report_json)?;
    if let Some(CheckpointFile { path, keep: false, .. }) = request.checkpoint {
        remove(path).map_err(RunError::CheckpointRemoval)?;
    }
    let names = |light: bake::KeptLight| light.lights().into_iter().map(str::to_owned).collect();
    Ok(Finished { summary, report_json, lights: baked.kept.map(names) })
}

/// What a bake is asked for.
#[derive(Clone, Copy)]
struct Wanted<'a> {
    settings: &'a BakeSettings,
    /// Texels of a lightmap, and probes.
    points: AskedPoints<'a>,
}

/// Bakes on these workers, and releases them.
fn bake_on(
    workers: Workers<'_>,
    scene: &Scene,
    wanted: &Wanted<'_>,
    checkpoint: Option<&CheckpointFile<'_>>,
    observer: &mut dyn RunObserver,
) -> Result<(Baked, WorkerMetrics, Option<CheckpointSummary>), RunError> {
    match workers {
        Workers::Exclusive(workers) => {
            let cluster = Cluster::start(workers)?;
            let (baked, recorded) = bake_with(&mut cluster.handle(0), scene, wanted, checkpoint, observer)?;
            Ok((baked, WorkerMetrics::Exclusive(cluster.workers(), cluster.counts()), recorded))
        }
        Workers::Shared(rows) => {
            let (baked, recorded) = bake_with(rows, scene, wanted, checkpoint, observer)?;
            Ok((baked, WorkerMetrics::Shared(rows.workers()), recorded))
        }
    }
}

/// Bakes with these rows, and those of the checkpoint.
fn bake_with(
    rows: &mut dyn RowService,
    scene: &Scene,
    wanted: &Wanted<'_>,
    checkpoint: Option<&CheckpointFile<'_>>,
    observer: &mut dyn RunObserver,
) -> Result<(Baked, Option<CheckpointSummary>), RunError> {
    let Wanted { settings, points } = *wanted;
    let Some(checkpoint) = checkpoint else {
        return Ok((bake_with_points(scene, settings, &points, rows, observer)?, None));
    };
    let mut rows = Checkpointed::new(rows, open_checkpoint(checkpoint)?);
    let baked = bake_with_points(scene, settings, &points, &mut rows, observer);
    let (_, recorded) = rows.finish();
    Ok((baked?, Some(recorded)))
}

/// Reads a scene, and passes on what there is to say of it.
pub(crate) fn read_scene(
    source: SceneSource<'_>,
    options: &ImportOptions,
    observer: &mut dyn RunObserver,
) -> Result<Scene, RunError> {
    let scene = match source {
        SceneSource::File(path) => import(path, options)?,
        SceneSource::Bytes(bytes) => import_slice(&bytes, options)?,
    };
    observer.warn(&scene.warnings);
    Ok(scene)
}

/// Writes the metrics where that is asked for.
pub(crate) fn write_report(path: Option<&Path>, json: &str) -> Result<(), RunError> {
    let Some(path) = path else { return Ok(()) };
    files::write(path, json.as_bytes()).map_err(|error| RunError::Report { path: path.to_owned(), error })
}

fn open_checkpoint(file: &CheckpointFile<'_>) -> Result<OpenCheckpoint, RunError> {
    match OpenCheckpoint::open(file.path, file.max_bytes) {
        Err(error) if file.replace => {
            tracing::warn!(%error, "replacing a checkpoint that cannot be used");
            let removed = fs::remove_file(file.path);
            let path = file.path.to_owned();
            removed.map_err(|error| RunError::CheckpointRemoval(CheckpointError::Io { path, error }))?;
            Ok(OpenCheckpoint::open(file.path, file.max_bytes)?)
        }
        opened => Ok(opened?),
    }
}
