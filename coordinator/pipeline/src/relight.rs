//! From a baked scene and its kept light to a lit file with other lights.

use std::path::Path;
use std::time::Instant;

use bake::{BakeError, KeptLight, NewLight, RelightReport, relight};
use output::export::{ExportSettings, export};
use scene::ImportOptions;

use crate::files_beside::check_files;
use crate::run::{RunError, RunObserver, SceneSource, read_scene, write_report};
use crate::summary::{relit_extras, relit_json};

/// What to relight, and the files to write.
pub struct RelightRequest<'a> {
    /// The scene that was baked.
    pub scene: SceneSource<'a>,
    /// How it is read, as in the bake; the sky is that of the kept light.
    pub import: ImportOptions,
    /// The light of each source, as the bake has kept it.
    pub kept_light: &'a Path,
    /// The lights to show.
    pub light: NewLight,
    /// How the lit file is written; its extras are added by the run.
    pub export: ExportSettings,
    /// The lit file.
    pub output: &'a Path,
    /// File for all metrics as JSON.
    pub report: Option<&'a Path>,
}

/// A finished relight.
#[derive(Debug)]
pub struct Relighted {
    /// Wall time from the files to the lit file.
    pub seconds: f64,
    /// Its metrics.
    pub report: RelightReport,
    /// The same as JSON.
    pub report_json: String,
    /// Names of the lights that a relight can change.
    pub lights: Vec<String>,
}

/// Relights a baked scene: writes the lit file and the report of the request.
///
/// # Errors
/// When a file cannot be read or written, the light was kept of another scene, or the observer cancels.
pub fn run(request: RelightRequest<'_>, observer: &mut dyn RunObserver) -> Result<Relighted, RunError> {
    let clock = Instant::now();
    let path = request.kept_light;
    let read =
        files::read_regular(path).map_err(|error| RunError::KeptLight { path: path.to_owned(), error });
    let kept = KeptLight::from_bytes(&read?)?;
    let import = ImportOptions { sky: kept.sky(), ..request.import };
    let file = request.scene.file();
    let scene = read_scene(request.scene, &import, observer)?;
    let written = [("report", request.report)];
    check_files((&scene, file.as_deref()), Some(path), request.output, &written)?;
    if observer.is_cancelled() {
        return Err(BakeError::Cancelled.into());
    }
    let relit = relight(&scene, &kept, &request.light)?;
    observer.exporting();
    observer.warn(&relit.report.warnings);
    let settings = ExportSettings { extras: relit_extras(&relit), ..request.export };
    let exported = export(&relit.scene, &relit.lit, &settings, request.output)?;
    observer.warn(&exported.warnings);
    let seconds = clock.elapsed().as_secs_f64();
    let report_json = relit_json(&relit, &exported, seconds)?;
    write_report(request.report, &report_json)?;
    let lights = kept.lights().into_iter().map(str::to_owned).collect();
    Ok(Relighted { seconds, report: relit.report, report_json, lights })
}
