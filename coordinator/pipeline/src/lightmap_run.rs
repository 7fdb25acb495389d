//! The lightmap of a run: laid out before the bake, in a thread of its own while the observer is asked whether to stop.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use bake::{BakeError, BakeSettings, LightPart};
use lightmap::{LightmapError, Plan, PlanReport, Resolution, plan};
use output::export::{PageFormat, check_lightmap};
use scene::Scene;

use crate::run::{RunError, RunObserver};

/// Time between two questions whether the run is cancelled.
const PATIENCE: Duration = Duration::from_millis(20);

/// How a lightmap is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightmapSettings {
    /// How fine it is.
    pub resolution: Resolution,
    /// Format of its pages.
    pub format: PageFormat,
}

/// Lays a lightmap out. Returns it with the files of its pages beside the output.
pub(crate) fn lay_out(
    scene: &Scene,
    settings: &LightmapSettings,
    bake: &BakeSettings,
    output: &Path,
    observer: &mut dyn RunObserver,
) -> Result<(Plan, Vec<PathBuf>), RunError> {
    check_lightmap(output, 0, settings.format)?;
    let is_cancelled = AtomicBool::new(false);
    let plan = thread::scope(|scope| {
        let stop = || is_cancelled.load(Ordering::Relaxed);
        let planning = scope.spawn(move || plan(scene, settings.resolution, &stop));
        while !planning.is_finished() {
            is_cancelled.fetch_or(observer.is_cancelled(), Ordering::Relaxed);
            thread::sleep(PATIENCE);
        }
        planning.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    });
    let plan = plan.map_err(|error| match error {
        LightmapError::Cancelled => RunError::Bake(BakeError::Cancelled),
        error => RunError::Lightmap(error),
    })?;
    let warnings = warnings(scene, bake, plan.report());
    observer.warn(&warnings);
    let beside = check_lightmap(output, plan.report().pages, settings.format)?;
    Ok((plan, beside))
}

fn warnings(scene: &Scene, bake: &BakeSettings, report: &PlanReport) -> Vec<String> {
    let problem = report.second_set_problem.as_ref();
    let problem = problem.map(|problem| {
        format!(
            "the second set of texture coordinates is not used for the lightmap, which has its own: {problem}"
        )
    });
    let lamps = scene.lights.len();
    let is_lit_twice = lamps > 0 && bake.only != LightPart::Indirect;
    let twice = is_lit_twice.then(|| {
        format!(
            "{lamps} lamps stay in the file, and their light is in the lightmap, too: give --only indirect for viewers that show lamps"
        )
    });
    problem.into_iter().chain(twice).collect()
}
