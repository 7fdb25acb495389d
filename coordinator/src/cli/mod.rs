//! The command line.

mod compare;
mod form_factors;
mod knobs;
mod machine;
mod progress;
mod reference;
mod render;
mod report;
mod scene_options;
mod solve;
mod study;
mod telemetry;
mod workers;

use std::path::Path;

use clap::{Parser, Subcommand};
use coordinator::metrics::Metrics;

/// Bakes diffuse global illumination into glTF scenes by progressive radiosity.
#[derive(Parser)]
#[command(version)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    workers: workers::WorkerArguments,
    #[command(flatten)]
    telemetry: telemetry::TelemetryArguments,
}

#[derive(Subcommand)]
enum Command {
    /// Bake a glTF file: a lit glTF comes out.
    Solve(solve::SolveArguments),
    /// Make a picture of a lit file: PNG or EXR.
    Render(render::RenderArguments),
    /// Compare a lit scene with a path-traced reference.
    Compare(compare::CompareArguments),
    /// Path-trace the radiosity at points of a scene: what a bake can be compared with.
    Reference(reference::ReferenceArguments),
    /// Compute the view factors between the named surfaces of a scene.
    FormFactors(form_factors::FormFactorArguments),
    /// Sweep the quality of a scene's bakes: error over time against a path-traced reference.
    Study(study::StudyArguments),
}

/// Carries out what the command line asks for.
pub fn run(arguments: Arguments) -> anyhow::Result<()> {
    let _logging = arguments.telemetry.log()?;
    let metrics = Metrics::default();
    let _page = arguments.telemetry.show(&metrics)?;
    match arguments.command {
        Command::Solve(solve) => solve::run(&solve, &arguments.workers.cluster(&metrics)?),
        Command::Render(render) => render::run(&render, &arguments.workers.cluster(&metrics)?),
        Command::Compare(compare) => compare::run(&compare),
        Command::Reference(reference) => reference::run(&reference, arguments.workers.threads()?),
        Command::FormFactors(factors) => form_factors::run(&factors, arguments.workers.threads()?),
        Command::Study(study) => study::run(&study, &arguments.workers.cluster(&metrics)?.workers),
    }
}

/// Refuses an output whose folder does not exist, or that is a folder itself.
fn ensure_place(output: &Path) -> anyhow::Result<()> {
    let whole = std::path::absolute(output).unwrap_or_else(|_| output.to_owned());
    let folder = whole.parent().unwrap_or(Path::new("/"));
    anyhow::ensure!(
        folder.is_dir(),
        "output directory {} does not exist: create it, or choose another output",
        folder.display()
    );
    anyhow::ensure!(!output.is_dir(), "output {} is a directory: name a file in it", output.display());
    Ok(())
}
