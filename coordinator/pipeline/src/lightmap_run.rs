//! The lightmap of a run: laid out before the bake, in a thread of its own while the observer is asked whether to stop.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use bake::{BakeSettings, LightPart};
use lightmap::{LightmapError, Plan, PlanReport, Resolution, plan};
use output::export::PageFormat;
use scene::Scene;

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

/// Lays a lightmap out; `is_cancelled` is asked often.
pub(crate) fn lay_out(
    scene: &Scene,
    resolution: Resolution,
    mut is_cancelled: impl FnMut() -> bool,
) -> Result<Plan, LightmapError> {
    let stops = AtomicBool::new(false);
    thread::scope(|scope| {
        let stop = || stops.load(Ordering::Relaxed);
        let planning = scope.spawn(move || plan(scene, resolution, &stop));
        while !planning.is_finished() {
            stops.fetch_or(is_cancelled(), Ordering::Relaxed);
            thread::sleep(PATIENCE);
        }
        planning.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

/// What there is to say of a lightmap before the bake.
pub(crate) fn warnings(scene: &Scene, bake: &BakeSettings, report: &PlanReport) -> Vec<String> {
    let problem = report.second_set_problem.as_ref();
    let problem = problem.map(|problem| {
        format!(
            "the second set of texture coordinates is not used for the lightmap, which has its own: {problem}"
        )
    });
    problem.into_iter().chain(lit_twice(scene, bake, "the lightmap")).collect()
}

/// A warning that lamps of the file and baked light may be shown together.
pub(crate) fn lit_twice(scene: &Scene, bake: &BakeSettings, holder: &str) -> Option<String> {
    let lamps = scene.lights.len();
    let is_lit_twice = lamps > 0 && bake.only != LightPart::Indirect;
    is_lit_twice.then(|| {
        let (lamps, light) = match lamps {
            1 => ("1 lamp stays".into(), "its light is"),
            _ => (format!("{lamps} lamps stay"), "their light is"),
        };
        format!(
            "{lamps} in the file, and {light} in {holder}, too: give --only indirect for viewers that show lamps"
        )
    })
}
