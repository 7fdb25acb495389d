//! One job, in a process of its own, through the pipeline.

use std::io::{self, Write};
use std::mem;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::Instant;

use bake::{BakeError, BakeSettings, NewLight};
use cluster::checkpoint::CheckpointError;
use files::{FileError, read_regular};
use output::export::{Compression, ExportError, ExportSettings};
use pipeline::options::{
    MOST_NAMES, Violations, export_settings, import_options, irradiance_unit, is_short, new_light, wanted,
};
use pipeline::prediction::least_memory_bytes;
use pipeline::probes_run::ProbeSettings;
use pipeline::relight::RelightRequest;
use pipeline::run::{BakeRequest, CheckpointFile, RunError, SceneSource, SharedRows, Workers};
use protocol::api::submit_scene_header::Source;
use protocol::api::{self, Outcome};
use sha2::{Digest, Sha256};

use super::observer::Reporter;
use super::rows::RowsError;
use crate::job::Record;
use crate::outside::TOO_LARGE;
use crate::refusal::is_full;
use crate::store::{Store, digest};

/// How a run of a job ended, as far as its own process can say.
#[derive(Debug)]
pub enum Ending {
    /// The lit file is written.
    Done(Box<Outcome>),
    /// It cannot be baked or relit.
    Failed(String),
    /// It can resume later: there are no workers, or the disk is full.
    Later(String),
}

/// A job and its limits.
pub struct Job {
    /// The data folder.
    pub store: Store,
    /// The job.
    pub record: Record,
    /// Memory for rows, in MiB.
    pub row_cache: usize,
    /// Bytes of kept light.
    pub light_bytes: u64,
    /// Bytes of the checkpoint.
    pub checkpoint_bytes: u64,
    /// Bytes of memory that the job may take.
    pub memory: u64,
}

/// Runs one job, and resumes from its checkpoint if there is one.
pub fn run<W: Write>(job: &Job, rows: &mut dyn SharedRows, reporter: &mut Reporter<W>) -> Ending {
    // Nothing is used after a panic.
    let outcome = catch_unwind(AssertUnwindSafe(|| attempt(job, rows, reporter)));
    match outcome {
        Ok(Ok(outcome)) => Ending::Done(Box::new(outcome)),
        Ok(Err(ending)) => ending,
        Err(_) => {
            tracing::error!(job = %job.record.id, "the bake panicked");
            Ending::Failed("the bake failed for a fault of this program: please report the scene".into())
        }
    }
}

fn attempt<W: Write>(
    job: &Job,
    rows: &mut dyn SharedRows,
    reporter: &mut Reporter<W>,
) -> Result<Outcome, Ending> {
    let Job { store, record, .. } = job;
    let clock = Instant::now();
    reporter.enter(api::Phase::Import);
    let mut wrong = Violations::default();
    let wanted = wanted(&record.header, &mut wrong);
    let relight = match (&record.relit, &record.header.source) {
        (Some(relit), Some(Source::Relight(relight))) => Some((relit, new_light(relight, &mut wrong))),
        (Some(relit), _) => Some((relit, NewLight::default())),
        (None, _) => None,
    };
    let output = store.result(record);
    let scene = || -> Result<SceneSource<'_>, Ending> {
        // Without a folder: references to other files are refused.
        let bytes = read_regular(&store.scene(record.scene));
        let bytes = bytes.map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => {
                failed("its scene is gone from the service's disk: submit the file again")
            }
            _ => of_disk("its scene cannot be read")(error),
        })?;
        if *Sha256::digest(&bytes) != record.scene.0 {
            tracing::error!(scene = %record.scene, "a scene is not as it was submitted: the disk has changed it");
            return Err(failed("its scene was damaged on the service's disk: submit the file again"));
        }
        // What the file says is enough to refuse it before it takes any memory. Another scene than the default one may be smaller.
        let least = least_memory_bytes(&bytes);
        if wanted.import.read.scene.is_none() && least > job.memory {
            let [least, most] = [least, job.memory].map(|bytes| bytes >> 20);
            return Err(failed(format!(
                "its triangles need {least} MiB of memory at least, and a job may use {most} MiB here: {TOO_LARGE}"
            )));
        }
        Ok(SceneSource::Bytes(bytes))
    };
    // Previews are looked at once.
    reporter.export = ExportSettings { compression: Compression::None, ..wanted.export.clone() };
    let (report_json, lights) = match relight {
        None => {
            wrong.check().map_err(failed)?;
            let request = BakeRequest {
                scene: scene()?,
                import: wanted.import,
                bake: BakeSettings {
                    row_cache: job.row_cache,
                    keep_light: Some(job.light_bytes),
                    ..wanted.bake
                },
                export: wanted.export,
                lightmap: wanted.lightmap,
                occlusion: wanted.occlusion,
                probes: wanted.probes.map(|places| ProbeSettings { places, beside: false }),
                output: &output,
                kept_light: Some(&store.light(record.id)),
                report: None,
                checkpoint: Some(CheckpointFile {
                    path: &store.checkpoint(record.id),
                    max_bytes: job.checkpoint_bytes,
                    replace: true,
                    // Removed when the record of the job is written.
                    keep: true,
                }),
            };
            let finished = pipeline::run::run(request, Workers::Shared(rows), reporter);
            let finished = finished.map_err(|error| of_run(error, &output))?;
            (finished.report_json, finished.lights)
        }
        Some((relit, light)) => {
            let import = import_options(&relit.options, &mut wrong);
            let header = record.header.output.clone().unwrap_or_default();
            let export = export_settings(&header, irradiance_unit(&relit.options), &mut wrong);
            wrong.check().map_err(failed)?;
            let request = RelightRequest {
                scene: scene()?,
                import,
                kept_light: &store.light(relit.baked),
                light: NewLight { only: wanted.bake.only, groups: wanted.bake.groups, ..light },
                export,
                output: &output,
                report: None,
            };
            let relighted = pipeline::relight::run(request, reporter);
            let relighted = relighted.map_err(|error| of_run(error, &output))?;
            (relighted.report_json, Some(relighted.lights))
        }
    };
    let (size, sha256) = digest(&output).map_err(of_disk("its lit file cannot be read"))?;
    Ok(Outcome {
        report_json,
        warnings: mem::take(&mut reporter.warnings),
        took: clock.elapsed().try_into().ok(),
        can_be_relit: lights.is_some(),
        // Others no client could name in a request.
        lights: lights.into_iter().flatten().filter(|name| is_short(name)).take(MOST_NAMES).collect(),
        size,
        sha256: sha256.to_vec().into(),
    })
}

fn failed(error: impl ToString) -> Ending {
    Ending::Failed(error.to_string())
}

/// Decides how a job ends whose run failed.
fn of_run(error: RunError, output: &Path) -> Ending {
    match error {
        // A job that kills whoever computes it would do so again.
        RunError::Bake(BakeError::Rows(rows))
            if !rows.downcast_ref().is_some_and(|error: &RowsError| error.is_final) =>
        {
            Ending::Later(BakeError::Rows(rows).to_string())
        }
        RunError::Checkpoint(error) => Ending::Later(error.to_string()),
        RunError::CheckpointRemoval(CheckpointError::Io { error, .. }) => {
            of_disk("its checkpoint cannot be removed")(error)
        }
        RunError::KeptLight { error, .. } if error.kind() == io::ErrorKind::NotFound => {
            failed("the light of the job is gone: submit its scene with the new lights")
        }
        RunError::KeptLight { error, .. } => of_disk("the light of its scene cannot be used")(error),
        RunError::Export(ExportError::File(FileError::Write { error, .. })) => {
            of_disk("its lit file cannot be written")(error)
        }
        // Paths of the service are not for clients.
        other => failed(other.to_string().replace(&output.display().to_string(), "the lit file")),
    }
}

/// Decides how a job ends that met this error of the disk.
fn of_disk(what: &'static str) -> impl Fn(io::Error) -> Ending {
    move |error| {
        if is_full(&error) {
            return Ending::Later("there is no room on the service's disk".into());
        }
        tracing::error!(%error, what, "the disk fails");
        Ending::Failed(format!("{what}: the service's log says more"))
    }
}
