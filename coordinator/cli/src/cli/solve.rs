use std::path::{Path, PathBuf};

use anyhow::Context;
use bake::BakeSettings;
use clap::Args;
use cluster::{Cluster, ClusterSettings};
use output::export::check_writable;
use output::files::AtomicWriteFile;
use pipeline::run::{BakeRequest, CheckpointFile, RunError, SceneSource};

use super::knobs::Knobs;
use super::output_options::OutputOptions;
use super::progress::Shown;
use super::report::Tables;
use super::scene_options::SceneOptions;

#[derive(Args)]
pub struct SolveArguments {
    /// Scene to bake: .glb or .gltf.
    scene: PathBuf,
    /// Lit scene to write: .glb or .gltf; or .ply, the lit mesh with light as numbers at its vertices.
    #[arg(short, long)]
    output: PathBuf,
    /// Write every figure of the table to this JSON file.
    #[arg(long)]
    report: Option<PathBuf>,
    #[command(flatten)]
    options: SceneOptions,
    #[command(flatten)]
    written: OutputOptions,
    /// Write the light of each source by itself to this file, so that `relight` can change its brightness and colour without a bake.
    #[arg(long, value_name = "FILE")]
    keep_light: Option<PathBuf>,
    #[command(flatten)]
    checkpoint: CheckpointArguments,
    #[command(flatten)]
    knobs: Knobs,
}

#[derive(Args)]
struct CheckpointArguments {
    /// Record finished rows in this file, so that a bake that was ended can go on: run the same command again. Removed when the
    /// output is written.
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// The checkpoint grows to so many MiB; what comes after is computed again by a bake that goes on.
    #[arg(long, value_name = "MIB", default_value_t = 16 << 10, requires = "checkpoint")]
    checkpoint_size: u64,
    /// Keep the checkpoint when the output is written: a bake of the same scene with other light goes faster with it.
    #[arg(long, requires = "checkpoint")]
    keep_checkpoint: bool,
}

/// Bakes one file.
pub fn run(arguments: &SolveArguments, workers: &ClusterSettings) -> anyhow::Result<()> {
    check_writable(&arguments.output)?;
    if let Some(report) = &arguments.report {
        check_report(report)?;
    }
    let CheckpointArguments { checkpoint, checkpoint_size, keep_checkpoint } = &arguments.checkpoint;
    check_distinct(&[
        ("scene", Some(&arguments.scene)),
        ("output", Some(&arguments.output)),
        ("report", arguments.report.as_ref()),
        ("checkpoint", checkpoint.as_ref()),
        ("kept light", arguments.keep_light.as_ref()),
    ])?;
    if let Some(kept) = &arguments.keep_light {
        check_place(kept, "kept light", "--keep-light")?;
    }
    let (settings, export) =
        arguments.written.settings(&arguments.options.options(), arguments.knobs.settings()?)?;
    let request = BakeRequest {
        scene: SceneSource::File(&arguments.scene),
        import: arguments.options.import_options()?,
        bake: BakeSettings { keep_light: arguments.keep_light.is_some().then_some(u64::MAX), ..settings },
        export,
        output: &arguments.output,
        kept_light: arguments.keep_light.as_deref(),
        report: arguments.report.as_deref(),
        checkpoint: checkpoint.as_ref().map(|path| CheckpointFile {
            path,
            max_bytes: checkpoint_size.saturating_mul(1 << 20),
            replace: false,
            keep: *keep_checkpoint,
        }),
    };
    let mut shown = Shown::new(&workers.metrics);
    let finished = pipeline::run::run(request, || Cluster::start(workers), &mut shown);
    let finished = match (finished, checkpoint) {
        (Err(error @ RunError::Bake(_)), Some(path)) => Err(error).with_context(|| {
            format!("the rows made so far are in {}: the same command goes on", path.display())
        }),
        (finished, _) => Ok(finished?),
    };
    finished?.summary.print();
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

/// Checks that a file can be written that the user names with `option`.
fn check_place(path: &Path, name: &str, option: &str) -> anyhow::Result<()> {
    AtomicWriteFile::open(path)
        .and_then(AtomicWriteFile::discard)
        .with_context(|| format!("{name} {} cannot be written: choose another {option}", path.display()))
}
