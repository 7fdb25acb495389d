use std::path::{Path, PathBuf};

use anyhow::Context;
use bake::BakeSettings;
use clap::Args;
use cluster::ClusterSettings;
use output::export::check_writable;
use pipeline::options::{Violations, bake_settings};
use pipeline::probes_run::ProbeSettings;
use pipeline::run::{BakeRequest, CheckpointFile, RunError, SceneSource, Workers};
use protocol::api::BakeOptions;

use super::options::Given;
use super::output_options::OutputOptions;
use super::outputs::{check_distinct, check_place, check_regular, check_report};
use super::progress::Shown;
use super::report::Tables;
use super::scene_options::{BesideOptions, SceneOptions};
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
    beside: BesideOptions,
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

impl SolveArguments {
    /// What remains when a signal ends the bake, in words.
    pub fn remains_when_stopped(&self) -> String {
        match &self.checkpoint.checkpoint {
            Some(path) => kept(path),
            None => "nothing was written; with --checkpoint the same command would go on".into(),
        }
    }
}

fn kept(checkpoint: &Path) -> String {
    format!("the rows made so far are in {}: the same command goes on", checkpoint.display())
}

/// Bakes one file.
pub fn run(arguments: &SolveArguments, workers: &ClusterSettings) -> anyhow::Result<()> {
    check_writable(&arguments.output)?;
    if let Some(report) = &arguments.report {
        check_report(report)?;
    }
    let CheckpointArguments { checkpoint, checkpoint_size, keep_checkpoint } = &arguments.checkpoint;
    let written = [
        ("output", Some(&*arguments.output)),
        ("report", arguments.report.as_deref()),
        ("checkpoint", checkpoint.as_deref()),
        ("kept light", arguments.keep_light.as_deref()),
    ];
    let mut read = vec![
        ("scene", Some(&*arguments.scene)),
        ("sky", arguments.options.sky_path()),
        ("file of probe points", arguments.written.probe_points_path()),
    ];
    read.extend(arguments.workers.security.files());
    check_distinct(&read, &written)?;
    if let Some(checkpoint) = checkpoint {
        check_regular(checkpoint, "checkpoint", "--checkpoint")?;
    }
    if let Some(kept) = &arguments.keep_light {
        check_place(kept, "kept light", "--keep-light")?;
    }
    let mut shown = Shown::new(&workers.metrics);
    let (settings, export) =
        arguments.written.settings(&arguments.options.options(), arguments.knobs.settings()?)?;
    let lightmap = arguments.written.lightmap()?;
    let request = BakeRequest {
        scene: SceneSource::File(&arguments.scene),
        import: arguments.beside.allow(arguments.options.with_sky()?),
        bake: BakeSettings { keep_light: arguments.keep_light.is_some().then_some(u64::MAX), ..settings },
        export,
        lightmap,
        occlusion: arguments.written.occlusion()?,
        probes: arguments.written.probes()?.map(|places| ProbeSettings { places, beside: true }),
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
    let finished = pipeline::run::run(request, Workers::Exclusive(workers), &mut shown);
    drop(shown);
    let finished = match (finished, checkpoint) {
        (Err(error @ RunError::Bake(_)), Some(path)) => Err(error).with_context(|| kept(path)),
        (finished, _) => Ok(finished?),
    };
    finished?.summary.print()
}
