use std::fs;
use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use serde_json::json;
use verify::reference::to_csv;
use verify::score::score_points;

#[derive(Args)]
pub struct CompareArguments {
    /// Lit scene: a GLB that this program wrote, or another with _IRRADIANCE.
    lit: PathBuf,
    /// Path-traced reference: CSV of position, normal, primitive, radiosity and standard error.
    #[arg(long)]
    reference: PathBuf,
    /// The scene before the bake, which the reference was made of.
    #[arg(long)]
    scene: PathBuf,
    /// Write what the lit scene has at the points of the reference to this file, CSV as the reference is: to see where they differ.
    #[arg(long)]
    points: Option<PathBuf>,
}

/// Prints the score of a lit scene as one line of JSON.
pub fn run(arguments: &CompareArguments) -> anyhow::Result<()> {
    let (score, points) = score_points(&arguments.lit, &arguments.reference, &arguments.scene)?;
    if let Some(path) = &arguments.points {
        fs::write(path, to_csv(&points))
            .with_context(|| format!("{} cannot be written: choose another --points", path.display()))?;
    }
    println!(
        "{}",
        json!({
            "relative_l2": score.relative_l2,
            "energy_ratio": score.energy_ratio,
            "p95": score.p95,
            "max": score.max,
            "uncovered": score.uncovered,
            "not_finite": score.not_finite,
            "vertices": score.vertices,
            "triangles": score.triangles,
        })
    );
    Ok(())
}
