//! The command line.

mod client;
mod compare;
mod form_factors;
mod knobs;
mod machine;
mod output_options;
mod progress;
mod reference;
mod relight;
mod render;
mod report;
mod scene_options;
mod serve;
mod solve;
mod study;
mod telemetry;
mod workers;

use std::path::Path;

use clap::{Parser, Subcommand};
use coordinator::metrics::Metrics;

/// Bakes diffuse global illumination into glTF scenes by progressive radiosity. Without a command it serves clients that submit scenes.
#[derive(Parser)]
#[command(version)]
pub struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    serve: serve::ServeArguments,
    #[command(flatten)]
    workers: workers::WorkerArguments,
    #[command(flatten)]
    telemetry: telemetry::TelemetryArguments,
}

#[derive(Subcommand)]
enum Command {
    /// Serve clients that submit scenes, until it is told to stop. Without any command: the same.
    Serve(serve::ServeArguments),
    /// Submit a scene to a service: the name of its job is printed.
    Submit(client::SubmitArguments),
    /// Show how far a job of a service is, until it has ended.
    Watch(client::WatchArguments),
    /// Fetch the lit scene of a job, or the present state of one that runs.
    Fetch(client::FetchArguments),
    /// List the jobs of a service, newest first.
    Jobs(client::JobsArguments),
    /// End a job that is queued or runs.
    Cancel(client::JobArguments),
    /// Forget a job and all that is kept of it.
    Delete(client::JobArguments),
    /// Bake a glTF file: a lit glTF comes out.
    Solve(solve::SolveArguments),
    /// Light a baked scene otherwise: other brightness or colour of its lights, in a small part of the time.
    Relight(relight::RelightArguments),
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
    let service_metrics = coordinator::service::Metrics::default();
    let _page = arguments.telemetry.show(&metrics, &service_metrics)?;
    let workers = &arguments.workers;
    let serve = |serve| serve::run(serve, workers.cluster(&metrics)?, service_metrics.clone());
    match &arguments.command {
        None => serve(&arguments.serve),
        Some(Command::Serve(arguments)) => serve(arguments),
        Some(Command::Submit(submit)) => client::submit(submit, &workers.security()?),
        Some(Command::Watch(watch)) => client::watch(watch, &workers.security()?),
        Some(Command::Fetch(fetch)) => client::fetch(fetch, &workers.security()?),
        Some(Command::Jobs(jobs)) => client::list(jobs, &workers.security()?),
        Some(Command::Cancel(job)) => client::cancel(job, &workers.security()?),
        Some(Command::Delete(job)) => client::delete(job, &workers.security()?),
        Some(Command::Solve(solve)) => solve::run(solve, &workers.cluster(&metrics)?),
        Some(Command::Relight(relight)) => relight::run(relight),
        Some(Command::Render(render)) => render::run(render, &workers.cluster(&metrics)?),
        Some(Command::Compare(compare)) => compare::run(compare),
        Some(Command::Reference(reference)) => reference::run(reference, workers.threads()?),
        Some(Command::FormFactors(factors)) => form_factors::run(factors, workers.threads()?),
        Some(Command::Study(study)) => study::run(study, &workers.cluster(&metrics)?.workers),
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
