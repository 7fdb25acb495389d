use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use atomic_write_file::AtomicWriteFile;
use bake::{BakeSettings, Observer, Progress, bake, check_groups};
use clap::Args;
use cluster::checkpoint::{Checkpointed, remove};
use cluster::metrics::Metrics;
use cluster::{Cluster, ClusterSettings};
use output::export::{ExportSettings, check_writable, export};
use pipeline::options::{Violations, bake_settings};
use pipeline::summary::{Computed, Summary, extras};
use protocol::api::BakeOptions;
use scene::import;

use super::machine::peak_memory_bytes;
use super::options::Given;
use super::output_options::OutputOptions;
use super::progress::ProgressLine;
use super::report::Tables;
use super::scene_options::SceneOptions;
use super::telemetry::TelemetryArguments;
use super::workers::WorkerArguments;

#[derive(Args)]
pub struct SolveArguments {
    /// Scene to bake: .glb or .gltf
    scene: PathBuf,
    /// Lit scene to write: .glb, .gltf, or .ply with light as numbers at vertices
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Write all results of the bake to this JSON file
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Keep the light of each source in this file, for `relight`
    #[arg(long, value_name = "FILE")]
    keep_light: Option<PathBuf>,
    #[command(flatten)]
    knobs: Knobs,
    #[command(flatten)]
    options: SceneOptions,
    #[command(flatten)]
    written: OutputOptions,
    #[command(flatten)]
    checkpoint: CheckpointArguments,
    #[command(flatten)]
    pub workers: WorkerArguments,
    #[command(flatten)]
    pub telemetry: TelemetryArguments,
}

/// The quality of a bake, and the memory that it may use.
#[derive(Args)]
struct Knobs {
    #[command(flatten)]
    given: Given<BakeOptions>,
    /// Memory for rows, in MiB; other rows are computed again
    ///
    /// Does not affect the result.
    #[arg(long, value_name = "MIB", help_heading = "Advanced quality", default_value_t = BakeSettings::default().row_cache)]
    row_cache: usize,
}

impl Knobs {
    fn settings(&self) -> anyhow::Result<BakeSettings> {
        let mut wrong = Violations::default();
        let settings = bake_settings(&self.given.0, &mut wrong);
        wrong.check()?;
        Ok(BakeSettings { row_cache: self.row_cache, ..settings })
    }
}

#[derive(Args)]
#[command(next_help_heading = "Checkpoint")]
struct CheckpointArguments {
    /// Record finished rows in this file, to resume an interrupted bake
    ///
    /// The same command again resumes. The file is removed when the output is written.
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Size limit of the checkpoint, in MiB; later rows are computed again
    #[arg(long, value_name = "MIB", default_value_t = 16 << 10, requires = "checkpoint")]
    checkpoint_size: u64,
    /// Keep the checkpoint when the output is written, to bake the scene again with other lights
    #[arg(long, requires = "checkpoint")]
    keep_checkpoint: bool,
}

/// Shows how far a bake is: to whoever waits for it, and to Prometheus.
struct Shown {
    line: ProgressLine,
    metrics: Metrics,
}

impl Observer for Shown {
    fn progress(&mut self, progress: &Progress) {
        self.metrics.progress(progress);
        self.line.show(progress);
    }
}

/// Bakes one file.
pub fn run(arguments: &SolveArguments, workers: &ClusterSettings) -> anyhow::Result<()> {
    let clock = Instant::now();
    check_writable(&arguments.output)?;
    if let Some(report) = &arguments.report {
        check_report(report)?;
    }
    check_distinct(&[
        ("scene", Some(&arguments.scene)),
        ("output", Some(&arguments.output)),
        ("report", arguments.report.as_ref()),
        ("checkpoint", arguments.checkpoint.checkpoint.as_ref()),
        ("kept light", arguments.keep_light.as_ref()),
    ])?;
    if let Some(kept) = &arguments.keep_light {
        check_place(kept, "kept light", "--keep-light")?;
    }
    let (settings, export_settings) =
        arguments.written.settings(&arguments.options.options(), arguments.knobs.settings()?)?;
    let settings =
        BakeSettings { keep_light: arguments.keep_light.is_some().then_some(u64::MAX), ..settings };
    let scene = import(&arguments.scene, &arguments.options.import_options()?)?;
    for warning in &scene.warnings {
        eprintln!("warning: {warning}");
    }
    check_groups(&scene, &settings.groups)?;
    let mut shown = Shown { line: ProgressLine::new(), metrics: workers.metrics.clone() };
    let cluster = Cluster::start(workers)?;
    let (baked, recorded) = match &arguments.checkpoint.checkpoint {
        None => (bake(&scene, &settings, &mut cluster.handle(0), &mut shown)?, None),
        Some(path) => {
            let limit = arguments.checkpoint.checkpoint_size.saturating_mul(1 << 20);
            let mut service = Checkpointed::open(cluster.handle(0), path, limit)?;
            let baked = bake(&scene, &settings, &mut service, &mut shown);
            let (_, recorded) = service.finish();
            let kept = || format!("the rows made so far are in {}: the same command goes on", path.display());
            (baked.with_context(kept)?, Some(recorded))
        }
    };
    shown.line.finish();
    for warning in &baked.report.warnings {
        eprintln!("warning: {warning}");
    }
    let (per_worker, counts) = (cluster.workers(), cluster.counts());
    cluster.shutdown();
    let extras = extras(&scene, &settings, &baked.report);
    let export_settings = ExportSettings { extras, ..export_settings };
    let exported = export(&scene, &baked.lit, &export_settings, &arguments.output)?;
    for warning in &exported.warnings {
        eprintln!("warning: {warning}");
    }
    if let (Some(path), Some(kept)) = (&arguments.keep_light, &baked.kept) {
        kept.write(path)?;
    }
    let summary = Summary {
        seconds: clock.elapsed().as_secs_f64(),
        unit: &export_settings.unit,
        account: &scene.import_report,
        degenerate_triangles: scene.degenerate_triangles,
        peak_memory_bytes: peak_memory_bytes(),
        bake: &baked.report,
        exported: &exported,
        workers: Computed::Alone(&per_worker, counts),
        checkpoint: recorded.as_ref(),
    };
    summary.print();
    if let Some(path) = &arguments.report {
        write_report(path, &summary.to_json(&settings)?)?;
    }
    if let Some(path) = &arguments.checkpoint.checkpoint
        && !arguments.checkpoint.keep_checkpoint
    {
        remove(path)?;
    }
    Ok(())
}

/// Nothing that the bake reads or writes may overwrite another of its files.
pub fn check_distinct(files: &[(&str, Option<&PathBuf>)]) -> anyhow::Result<()> {
    let whole = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    for (index, (name, path)) in files.iter().enumerate() {
        let Some(path) = path else { continue };
        for (other, taken) in &files[..index] {
            anyhow::ensure!(
                taken.is_none_or(|taken| whole(taken) != whole(path)),
                "{name} {} is the {other} itself: choose another {name}",
                path.display()
            );
        }
    }
    Ok(())
}

pub fn check_report(path: &Path) -> anyhow::Result<()> {
    check_place(path, "report", "--report")
}

/// Finds out whether a file can be written that is called so and was asked for with this option.
fn check_place(path: &Path, name: &str, option: &str) -> anyhow::Result<()> {
    AtomicWriteFile::open(path)
        .map(AtomicWriteFile::discard)
        .with_context(|| format!("{name} {} cannot be written: choose another {option}", path.display()))??;
    Ok(())
}

pub fn write_report(path: &Path, json: &str) -> anyhow::Result<()> {
    use std::io::Write;
    let write = || -> std::io::Result<()> {
        let mut file = AtomicWriteFile::open(path)?;
        file.write_all(json.as_bytes())?;
        file.commit()
    };
    write().with_context(|| format!("report {} cannot be written", path.display()))
}
