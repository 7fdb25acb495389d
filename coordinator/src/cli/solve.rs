use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use atomic_write_file::AtomicWriteFile;
use clap::Args;
use coordinator::bake::{BakeSettings, bake};
use coordinator::cluster::{Cluster, Workers};
use coordinator::export::{ExportSettings, check_writable, export};
use coordinator::import::{ImportOptions, import};
use serde_json::json;

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

/// Knobs of the bake.
#[derive(Args)]
struct Knobs {
    /// Longest edge of a shooting patch, relative to the scene's extent.
    #[arg(long, default_value_t = BakeSettings::default().shooter_edge, value_parser = proportion)]
    shooter_edge: f64,
    /// Interpolation error at which refinement ends: relative L2 of the radiosity.
    #[arg(long, default_value_t = BakeSettings::default().mesh_error, value_parser = positive)]
    mesh_error: f64,
    /// Refinement also ends at this number of vertices.
    #[arg(long, default_value_t = BakeSettings::default().max_vertices)]
    max_vertices: usize,
    /// Memory for rows, in MiB: 4 bytes for each pair of shooting vertex and vertex. Refinement also ends when it is full.
    #[arg(long, default_value_t = BakeSettings::default().row_memory)]
    row_memory: usize,
    /// Shooting ends when rho / (1 - rho) x unshot flux is under this part of the reflected flux; sweeps do the rest.
    #[arg(long, default_value_t = BakeSettings::default().threshold, value_parser = positive)]
    threshold: f64,
    /// Shot n is chosen from the state after shot n - WINDOW. Part of the answer, whatever the workers.
    #[arg(long, default_value_t = BakeSettings::default().window, value_parser = at_least_one)]
    window: usize,
    /// Rays that a vertex spends on a hemisphere of shafts too crowded to be cut exactly.
    #[arg(long, default_value_t = BakeSettings::default().rays_per_hemisphere)]
    rays: u32,
    /// Seed of all rays.
    #[arg(long, default_value_t = BakeSettings::default().seed)]
    seed: u64,
    /// Weigh point lights by the cosine of a horizontal plane through them instead of evenly by solid angle.
    #[arg(long)]
    planar_point_lights: bool,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("must be a positive number".into()),
    }
}

fn proportion(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (1e-3..=1.0).contains(&value) => Ok(value),
        _ => Err("must be a number from 0.001 to 1".into()),
    }
}

fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) | Err(_) => Err("must be a whole number from 1".into()),
        Ok(value) => Ok(value),
    }
}

impl Knobs {
    fn settings(&self) -> BakeSettings {
        BakeSettings {
            shooter_edge: self.shooter_edge,
            mesh_error: self.mesh_error,
            max_vertices: self.max_vertices,
            row_memory: self.row_memory,
            threshold: self.threshold,
            window: self.window,
            rays_per_hemisphere: self.rays,
            seed: self.seed,
            planar_point_lights: self.planar_point_lights,
            ..BakeSettings::default()
        }
    }
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
