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

use std::io::{self, Write};
use std::path::Path;

use anyhow::Context;
use clap::{Parser, Subcommand};
use cluster::metrics::Metrics;
use output::files;

/// Bakes diffuse global illumination into glTF scenes by progressive radiosity. Without a command it serves clients that submit scenes.
#[derive(Parser)]
#[command(version)]
pub struct Arguments {
    // First: the one after it takes the command out of what these look at.
    #[command(flatten)]
    serve: serve::WithoutCommand,
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    workers: workers::WorkerArguments,
    #[command(flatten)]
    telemetry: telemetry::TelemetryArguments,
}

#[derive(Subcommand)]
enum Command {
    /// Serve clients that submit scenes, until it is told to stop. Without any command: the same.
    Serve(serve::ServeArguments),
    #[command(flatten)]
    Client(client::ClientCommand),
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
    let workers = &arguments.workers;
    let metrics = Metrics::default();
    let service_metrics = service::Metrics::default();
    let _page = match &arguments.command {
        // Who only asks has no figures; in a container of a service, the address of the figures is the service's.
        Some(Command::Client(_)) => None,
        _ => arguments.telemetry.show(&metrics, &service_metrics)?,
    };
    let serve = |serve| serve::run(serve, workers.cluster(&metrics)?, service_metrics.clone());
    match &arguments.command {
        None => serve(&arguments.serve.0),
        Some(Command::Serve(arguments)) => serve(arguments),
        Some(Command::Client(command)) => client::run(command, &workers.security()?),
        Some(Command::Solve(solve)) => solve::run(solve, &workers.cluster(&metrics)?),
        Some(Command::Relight(relight)) => relight::run(relight),
        Some(Command::Render(render)) => render::run(render, &workers.cluster(&metrics)?),
        Some(Command::Compare(compare)) => compare::run(compare),
        Some(Command::Reference(reference)) => reference::run(reference, workers.threads()?),
        Some(Command::FormFactors(factors)) => form_factors::run(factors, workers.threads()?),
        Some(Command::Study(study)) => study::run(study, &workers.cluster(&metrics)?.workers),
    }
}

/// Writes an output whole or not at all.
fn write_output(
    path: &Path,
    content: impl FnOnce(&mut (dyn Write + Send)) -> io::Result<()>,
) -> anyhow::Result<()> {
    files::write_with(path, content).with_context(|| format!("output {} cannot be written", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(line: &str) -> Result<Arguments, String> {
        Arguments::try_parse_from(line.split_whitespace()).map_err(|error| error.to_string())
    }

    #[test]
    fn options_of_the_service_go_with_serve_or_no_command() {
        for line in ["coordinator", "coordinator --jobs 3", "coordinator --jobs 3 --workers first:7070"] {
            assert!(matches!(parse(line), Ok(Arguments { command: None, .. })), "{line}");
        }
        for line in ["coordinator serve --jobs 3", "coordinator --workers first:7070 serve --jobs 3"] {
            assert!(matches!(parse(line), Ok(Arguments { command: Some(Command::Serve(_)), .. })), "{line}");
        }
    }

    #[test]
    fn options_of_the_service_before_another_command_are_refused_by_name() {
        for (line, option, command) in [
            ("coordinator --jobs 3 solve scene.glb -o lit.glb", "--jobs", "solve"),
            ("coordinator --data=here jobs", "--data", "jobs"),
            ("coordinator --listen-plaintext watch 1", "--listen-plaintext", "watch"),
        ] {
            let told = parse(line).err().unwrap();
            assert!(told.contains(option) && told.contains(command), "{line}: {told}");
            assert!(told.contains("serve"), "{line}: {told}");
        }
        // After the command they count.
        let told = parse("coordinator --jobs 3 serve").err().unwrap();
        assert!(told.contains("after `serve`"), "{told}");
    }

    #[test]
    fn options_for_all_go_before_any_command() {
        let solve = parse("coordinator --workers first:7070 solve scene.glb -o lit.glb").unwrap();
        assert!(matches!(solve.command, Some(Command::Solve(_))));
    }
}
