//! The probes of a run: their places before the bake, their light after it.

use std::path::{Path, PathBuf};

use probes::{Places, Plan, ProbeError, plan};
use scene::Scene;

/// Which probes a run writes.
#[derive(Debug, Clone, PartialEq)]
pub struct ProbeSettings {
    /// Where they are.
    pub places: Places,
    /// Whether they also get a file beside the output.
    pub beside: bool,
}

/// The file of the probes beside an output.
#[must_use]
pub fn file_beside(output: &Path) -> PathBuf {
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    output.with_file_name(format!("{stem}-probes.json"))
}

/// The probes that are asked for, and the file beside the output that they get.
pub(crate) fn lay_out(
    scene: &Scene,
    settings: Option<&ProbeSettings>,
    output: &Path,
) -> Result<(Option<Plan>, Option<PathBuf>), ProbeError> {
    let Some(ProbeSettings { places, beside }) = settings else { return Ok((None, None)) };
    Ok((Some(plan(scene, places)?), beside.then(|| file_beside(output))))
}
