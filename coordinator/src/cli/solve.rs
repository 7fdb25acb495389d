use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use atomic_write_file::AtomicWriteFile;
use clap::Args;
use coordinator::bake::bake;
use coordinator::cluster::{Cluster, Workers};
use coordinator::export::{ExportSettings, check_writable, export};
use coordinator::import::{ImportOptions, import};
use serde_json::json;

use super::knobs::{Knobs, positive};
use super::machine::peak_memory_bytes;
use super::progress::ProgressLine;
use super::report::Summary;

#[derive(Args)]
pub struct SolveArguments {
    /// Scene to bake: .glb or .gltf.
    scene: PathBuf,
    /// Lit scene to write: .glb or .gltf.
    #[arg(short, long)]
    output: PathBuf,
    /// Write every figure of the table to this JSON file.
    #[arg(long)]
    report: Option<PathBuf>,
    /// COLOR_0 per unit of irradiance [default: one at which 5 % of the surface is clipped].
    #[arg(long, value_parser = positive)]
    exposure: Option<f64>,
    /// Unit of the irradiance, as the scene's lights mean it; written to the output.
    #[arg(long, default_value = "W/m^2")]
    unit: String,
    #[command(flatten)]
    knobs: Knobs,
}

/// Bakes one file.
pub fn run(arguments: &SolveArguments, workers: &Workers) -> anyhow::Result<()> {
    let clock = Instant::now();
    check_writable(&arguments.output)?;
    if let Some(report) = &arguments.report {
        check_report(report)?;
    }
    check_distinct(arguments)?;
    let scene = import(&arguments.scene, &ImportOptions::default())?;
    for warning in &scene.warnings {
        eprintln!("warning: {warning}");
    }
    let settings = arguments.knobs.settings();
    let mut cluster = Cluster::start(workers)?;
    let mut line = ProgressLine::new();
    let baked = bake(&scene, &settings, &mut cluster, &mut |progress| line.show(progress))?;
    line.finish();
    for warning in &baked.report.warnings {
        eprintln!("warning: {warning}");
    }
    let per_worker = cluster.workers();
    cluster.shutdown();
    let extras = json!({ "energy_balance": baked.report.balance, "settings": settings });
    let export_settings =
        ExportSettings { exposure: arguments.exposure, unit: arguments.unit.clone(), extras };
    let exported = export(&scene, &baked.lit, &export_settings, &arguments.output)?;
    let summary = Summary {
        seconds: clock.elapsed().as_secs_f64(),
        unit: &arguments.unit,
        degenerate_triangles: scene.degenerate_triangles,
        peak_memory_bytes: peak_memory_bytes(),
        bake: &baked.report,
        exported: &exported,
        workers: &per_worker,
    };
    summary.print();
    if let Some(path) = &arguments.report {
        write_report(path, &summary.to_json(&settings)?)?;
    }
    Ok(())
}

/// Nothing that the bake reads or writes may overwrite another of its files.
fn check_distinct(arguments: &SolveArguments) -> anyhow::Result<()> {
    let whole = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let output = whole(&arguments.output);
    anyhow::ensure!(
        output != whole(&arguments.scene),
        "output {} is the scene itself: choose another output",
        arguments.output.display()
    );
    if let Some(report) = &arguments.report {
        let report_path = whole(report);
        anyhow::ensure!(
            report_path != output && report_path != whole(&arguments.scene),
            "report {} is the scene or the output: choose another --report",
            report.display()
        );
    }
    Ok(())
}

fn check_report(path: &Path) -> anyhow::Result<()> {
    AtomicWriteFile::open(path)
        .map(AtomicWriteFile::discard)
        .with_context(|| format!("report {} cannot be written: choose another --report", path.display()))??;
    Ok(())
}

fn write_report(path: &Path, json: &str) -> anyhow::Result<()> {
    use std::io::Write;
    let write = || -> std::io::Result<()> {
        let mut file = AtomicWriteFile::open(path)?;
        file.write_all(json.as_bytes())?;
        file.commit()
    };
    write().with_context(|| format!("report {} cannot be written", path.display()))
}
