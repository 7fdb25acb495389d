//! The command line.

mod arrange;
mod check_data;
mod client;
mod compare;
pub mod console;
mod form_factors;
mod job;
mod machine;
mod options;
mod output_options;
mod outputs;
mod progress;
mod reference;
mod relight;
mod render;
mod report;
mod scene_options;
mod serve;
mod signals;
mod solve;
mod study;
mod telemetry;
mod workers;

use clap::{Parser, Subcommand};
use cluster::metrics::Metrics;

pub use arrange::parse;

/// Bake diffuse global illumination into glTF scenes by progressive radiosity
#[derive(Parser)]
#[command(
    version,
    arg_required_else_help = true,
    subcommand_required = true,
    after_help = "Examples:
  coordinator solve scene.glb -o lit.glb --error 0.02
  coordinator solve scene.glb -o lit.glb --workers a:7070,b:7070
  coordinator serve --data /var/lib/halflight"
)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Bake a glTF file into a lit glTF file
    #[command(after_help = "Examples:
  coordinator solve scene.glb -o lit.glb --error 0.02
  coordinator solve scene.glb -o day.glb --sky 1,1.25,1.6 --keep-light scene.light
  coordinator solve scene.glb -o lit.glb --workers a:7070,b:7070 --checkpoint scene.rows")]
    Solve(Box<solve::SolveArguments>),
    /// Relight a baked scene with new light intensities or colours, without baking again
    #[command(after_help = "Example:
  coordinator relight scene.glb --kept scene.light -o evening.glb --light sun=0.5,0.3,0.2")]
    Relight(relight::RelightArguments),
    /// Render a picture of a lit file: PNG or EXR
    #[command(after_help = "Examples:
  coordinator render lit.glb -o picture.png --width 1920 --samples 64
  coordinator render lit.glb -o picture.exr --eye 1,1.6,4 --target 3,1,0 --fov 60")]
    Render(Box<render::RenderArguments>),
    /// Serve clients that submit scenes, until SIGTERM or SIGINT
    #[command(after_help = "Example:
  coordinator serve --workers a:7070,b:7070 --data /var/lib/halflight --metrics 127.0.0.1:9464")]
    Serve(Box<serve::ServeArguments>),
    /// Run the job that standard input names: the service starts it
    #[command(hide = true)]
    Job(job::JobArguments),
    /// Check that all files of a service's data folder are as they were written
    #[command(after_help = "Example:\n  coordinator check-data --data /var/lib/halflight")]
    CheckData(check_data::CheckDataArguments),
    #[command(flatten)]
    Client(client::ClientCommand),
    /// Compute the view factors between the named surfaces of a scene
    #[command(after_help = "Example:\n  coordinator form-factors scene.glb -o factors.csv --areas areas.csv")]
    FormFactors(form_factors::FormFactorArguments),
    /// Path-trace the radiosity at points of a scene, as a reference for bakes
    #[command(after_help = "Example:\n  coordinator reference scene.glb -o reference.csv --paths 4096")]
    Reference(reference::ReferenceArguments),
    /// Compare a lit scene with a path-traced reference
    #[command(
        after_help = "Example:\n  coordinator compare lit.glb --reference reference.csv --scene scene.glb"
    )]
    Compare(compare::CompareArguments),
    /// Measure error over time of bakes at many settings, against a path-traced reference
    #[command(after_help = "Example:\n  coordinator study scene.glb --reference reference.csv -o study")]
    Study(study::StudyArguments),
}

impl Command {
    fn telemetry(&self) -> Option<&telemetry::TelemetryArguments> {
        match self {
            Self::Solve(arguments) => Some(&arguments.telemetry),
            Self::Render(arguments) => Some(&arguments.telemetry),
            Self::Serve(arguments) => Some(&arguments.telemetry),
            _ => None,
        }
    }

    /// What remains of it when a signal ends it at once, in words; `None` where it stops in its own way.
    fn remains_when_stopped(&self) -> Option<String> {
        match self {
            Self::Serve(_) | Self::Job(_) => None,
            Self::Solve(solve) => Some(solve.remains_when_stopped()),
            _ => Some("nothing was written".into()),
        }
    }

    /// Format of its logs, where that can be chosen.
    fn log(&self) -> Option<protocol::telemetry::LogFormat> {
        match self {
            Self::Job(arguments) => Some(arguments.log),
            _ => self.telemetry().map(|telemetry| telemetry.log),
        }
    }
}

/// Runs a command.
pub fn run(arguments: Arguments) -> anyhow::Result<()> {
    let command = &arguments.command;
    let _logging = telemetry::log(command.log())?;
    let metrics = Metrics::default();
    let service = service::Metrics::default();
    let shown = command.telemetry().map(|telemetry| telemetry.show(&metrics, &service));
    let _page = shown.transpose()?;
    if let Some(remains) = command.remains_when_stopped() {
        signals::end_process_one(remains)?;
    }
    match command {
        Command::Serve(serve) => serve::run(serve, serve.workers.cluster(&metrics)?, service),
        Command::Job(_) => job::run(),
        Command::CheckData(arguments) => check_data::run(arguments),
        Command::Client(command) => client::run(command),
        Command::Solve(solve) => solve::run(solve, &solve.workers.cluster(&metrics)?),
        Command::Relight(relight) => relight::run(relight),
        Command::Render(render) => render::run(render, &render.workers.cluster(&metrics)?),
        Command::Compare(compare) => compare::run(compare),
        Command::Reference(reference) => reference::run(reference, reference.threads.count()?),
        Command::FormFactors(factors) => form_factors::run(factors, factors.threads.count()?),
        Command::Study(study) => study::run(study, &study.workers.cluster(&metrics)?.workers),
    }
}
