use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use serde_json::json;
use verify::reference::to_csv;
use verify::score::score_points;

use super::console::{print, say};
use super::outputs::{check_distinct, check_place};
use super::scene_options::BesideOptions;

#[derive(Args)]
pub struct CompareArguments {
    /// Lit scene: a GLB with _IRRADIANCE, such as those that `solve` writes
    lit: PathBuf,
    /// Path-traced reference, CSV, as written by `reference`
    #[arg(long, value_name = "CSV")]
    reference: PathBuf,
    /// Scene before the bake
    #[arg(long, value_name = "FILE")]
    scene: PathBuf,
    /// Write the values of the lit scene at the points of the reference to this CSV file
    #[arg(long, value_name = "CSV")]
    points: Option<PathBuf>,
    #[command(flatten)]
    beside: BesideOptions,
}

/// Prints the score of a lit scene as one line of JSON.
pub fn run(arguments: &CompareArguments) -> anyhow::Result<()> {
    if let Some(points) = &arguments.points {
        let read =
            [("lit scene", &arguments.lit), ("reference", &arguments.reference), ("scene", &arguments.scene)];
        check_distinct(&read.map(|(name, path)| (name, Some(&**path))), &[("list of points", Some(points))])?;
        check_place(points, "list of points", "--points")?;
    }
    let (score, points) =
        score_points(&arguments.lit, &arguments.reference, &arguments.scene, &arguments.beside.read())?;
    if let Some(path) = &arguments.points {
        files::write(path, to_csv(&points).as_bytes())
            .with_context(|| format!("{} cannot be written: choose another --points", path.display()))?;
    }
    if score.is_lost_in_noise() {
        let noise = 100.0 * score.reference_noise;
        say(format_args!(
            "warning: the reference has {noise:.1} % noise of its own: trace it with more --paths"
        ));
    }
    print(json!({
        "relative_l2": score.relative_l2,
        "reference_noise": score.reference_noise,
        "energy_ratio": score.energy_ratio,
        "p95": score.p95,
        "max": score.max,
        "uncovered": score.uncovered,
        "not_finite": score.not_finite,
        "vertices": score.vertices,
        "triangles": score.triangles,
    }))
}
