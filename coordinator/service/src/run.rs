//! One job, in a thread of its own: import, bake or light otherwise, export.

use std::fs::File;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use protocol::api::{self, Outcome};
use sha2::{Digest, Sha256};

use crate::job::Record;
use crate::present::Stage;
use crate::progress::{Live, Watched};
use crate::refusal::is_full;
use crate::relight::relight_baked;
use crate::settings::Limits;
use crate::store::Store;
use bake::lit::LitMesh;
use bake::{BakeError, BakeSettings, KeptLight, RelightError, bake, check_groups};
use cluster::checkpoint::Checkpointed;
use cluster::{Cluster, ClusterError};
use output::export::{ExportError, ExportSettings, Exported, export};
use pipeline::options::{LONGEST_TEXT, MOST_NAMES, Violations, Wanted, wanted};
use pipeline::summary::{Computed, Summary, extras};
use scene::Scene;
use scene::{ImportOptions, import_slice};

/// How a job ended.
#[derive(Debug)]
pub enum Ending {
    /// The lit file is in its place.
    Done(Box<Outcome>),
    /// It cannot be baked.
    Failed(String),
    /// It was told to.
    Stopped,
    /// It can go on later: there are no workers, or there is no room on the disk.
    Later(String),
}

/// What jobs need.
pub struct Means<'a> {
    /// Where the files are.
    pub store: &'a Store,
    /// Who computes.
    pub workers: &'a Cluster,
    /// How much a job may have.
    pub limits: &'a Limits,
}

/// Runs one job to its end, whatever that is. Finished rows are kept on the disk, so that it goes on where it was.
pub fn run(means: &Means<'_>, record: &Record, live: &Live) -> Ending {
    // What a panic leaves half done is the job's alone.
    let outcome = catch_unwind(AssertUnwindSafe(|| attempt(means, record, live)));
    match outcome {
        Ok(Ok(outcome)) => Ending::Done(Box::new(outcome)),
        Ok(Err(_)) if live.is_stopped() => Ending::Stopped,
        Ok(Err(ending)) => ending,
        Err(_) => {
            tracing::error!(job = %record.id, "the bake panicked");
            Ending::Failed("the bake failed for a fault of this program: please report the scene".into())
        }
    }
}

fn attempt(means: &Means<'_>, record: &Record, live: &Live) -> Result<Outcome, Ending> {
    live.enter(api::Phase::Import);
    let mut wrong = Violations::default();
    let wanted = wanted(&record.header, &mut wrong);
    wrong.check().map_err(|refusal| Ending::Failed(refusal.to_string()))?;
    match &record.relit {
        None => bake_whole(means, record, wanted, live),
        Some(relit) => relight_baked(means, record, relit, wanted, live),
    }
}

/// The scene of a job.
pub(super) fn scene_of(means: &Means<'_>, record: &Record, options: &ImportOptions) -> Result<Scene, Ending> {
    let bytes =
        std::fs::read(means.store.scene(record.scene)).map_err(of_disk("its scene cannot be read"))?;
    // Without a folder: a file that names others is refused, whatever it names.
    import_slice(&bytes, options).map_err(|error| Ending::Failed(error.to_string()))
}

fn bake_whole(means: &Means<'_>, record: &Record, wanted: Wanted, live: &Live) -> Result<Outcome, Ending> {
    let clock = Instant::now();
    let settings = BakeSettings {
        row_cache: means.limits.row_cache,
        keep_light: Some(means.limits.light_bytes),
        ..wanted.bake
    };
    let scene = scene_of(means, record, &wanted.import)?;
    check_groups(&scene, &settings.groups).map_err(|error| Ending::Failed(error.to_string()))?;
    if live.is_stopped() {
        return Err(Ending::Stopped);
    }
    let scene = Arc::new(scene);
    live.present.begin(Stage { scene: Arc::clone(&scene), export: wanted.export.clone() });
    let limit = means.limits.checkpoint_bytes;
    let path = means.store.checkpoint(record.id);
    let rows = || means.workers.handle(record.header.priority);
    let mut service = Checkpointed::open(rows(), &path, limit).or_else(|error| {
        // Rows of another release, or damaged: they are made again.
        tracing::warn!(job = %record.id, %error, "the checkpoint is of no use");
        std::fs::remove_file(&path).map_err(of_disk("its checkpoint cannot be removed"))?;
        Checkpointed::open(rows(), &path, limit).map_err(|error| Ending::Later(error.to_string()))
    })?;
    let mut watched = Watched { live, workers: means.workers };
    let baked = bake(&scene, &settings, &mut service, &mut watched);
    let (handle, recorded) = service.finish();
    let baked = baked.map_err(of_bake)?;

    live.enter(api::Phase::Export);
    let export_settings =
        ExportSettings { extras: extras(&scene, &settings, &baked.report), ..wanted.export };
    let (exported, written) = write_result(means, record, &scene, &baked.lit, &export_settings)?;
    if let Some(kept) = &baked.kept {
        kept.write(&means.store.light(record.id)).map_err(of_light)?;
    }
    let workers = handle.workers();
    let summary = Summary {
        seconds: clock.elapsed().as_secs_f64(),
        unit: &export_settings.unit,
        account: &scene.import_report,
        degenerate_triangles: scene.degenerate_triangles,
        // Other jobs have their part in it.
        peak_memory_bytes: None,
        bake: &baked.report,
        exported: &exported,
        workers: Computed::Shared(&workers),
        checkpoint: Some(&recorded),
    };
    let report_json = summary.to_json(&settings).map_err(|error| Ending::Failed(error.to_string()))?;
    let warnings = [&scene.warnings, &baked.report.warnings, &exported.warnings];
    Ok(Outcome {
        report_json,
        warnings: warnings.into_iter().flatten().cloned().collect(),
        took: clock.elapsed().try_into().ok(),
        can_be_relit: baked.kept.is_some(),
        lights: baked.kept.map(|kept| names_of_lights(&kept)).unwrap_or_default(),
        ..written
    })
}

/// Writes the lit file. What it says, and the outcome as far as it is about the file.
pub(super) fn write_result(
    means: &Means<'_>,
    record: &Record,
    scene: &Scene,
    lit: &LitMesh,
    settings: &ExportSettings,
) -> Result<(Exported, Outcome), Ending> {
    let path = means.store.result(record);
    let exported = export(scene, lit, settings, &path).map_err(|error| of_export(error, &path))?;
    let (size, sha256) = digest(&path).map_err(of_disk("its lit file cannot be read"))?;
    Ok((exported, Outcome { size, sha256: sha256.to_vec().into(), ..Outcome::default() }))
}

/// The lights that clients can change: those that they can name.
pub(super) fn names_of_lights(kept: &KeptLight) -> Vec<String> {
    let can_be_named = |name: &&str| name.chars().count() <= LONGEST_TEXT && !name.contains(char::is_control);
    kept.lights().into_iter().filter(can_be_named).take(MOST_NAMES).map(str::to_owned).collect()
}

/// What a job does whose bake ended so.
fn of_bake(error: BakeError) -> Ending {
    match &error {
        BakeError::Cancelled => Ending::Stopped,
        // A job that kills whoever computes it would do so again.
        BakeError::Rows(rows) if !matches!(rows.downcast_ref(), Some(ClusterError::Abandoned { .. })) => {
            Ending::Later(error.to_string())
        }
        _ => Ending::Failed(error.to_string()),
    }
}

/// What a job that met this error of the disk does.
fn of_disk(what: &'static str) -> impl Fn(io::Error) -> Ending {
    move |error| {
        if is_full(&error) {
            return Ending::Later("there is no room on the service's disk".into());
        }
        tracing::error!(%error, what, "the disk fails");
        Ending::Failed(format!("{what}: the service's log says more"))
    }
}

/// What a job does whose light cannot be kept, or cannot be changed.
pub(super) fn of_light(error: RelightError) -> Ending {
    match error {
        RelightError::Io { error, .. } if error.kind() == io::ErrorKind::NotFound => {
            Ending::Failed("the light of the job is gone: submit its scene with the other light".into())
        }
        RelightError::Io { error, .. } => of_disk("the light of its scene cannot be used")(error),
        other => Ending::Failed(other.to_string()),
    }
}

fn of_export(error: ExportError, path: &Path) -> Ending {
    match error {
        ExportError::Write { source, .. } => of_disk("its lit file cannot be written")(source),
        // Where the service has its files is nobody's business.
        other => Ending::Failed(other.to_string().replace(&path.display().to_string(), "the lit file")),
    }
}

/// Length and SHA-256 of a file.
pub(super) fn digest(path: &Path) -> io::Result<(u64, [u8; 32])> {
    let mut hasher = Sha256::new();
    let size = io::copy(&mut File::open(path)?, &mut hasher)?;
    Ok((size, hasher.finalize().into()))
}
