//! The command line.

mod compare;
mod form_factors;
mod knobs;
mod machine;
mod progress;
mod reference;
mod report;
mod solve;
mod study;

use std::num::NonZeroUsize;
use std::path::Path;

use anyhow::Context;
use clap::{Parser, Subcommand};
use coordinator::cluster::Workers;
use tracing_subscriber::EnvFilter;

/// Bakes diffuse global illumination into glTF scenes by progressive radiosity.
#[derive(Parser)]
#[command(version)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    workers: WorkerArguments,
}

#[derive(clap::Args)]
struct WorkerArguments {
    /// Workers that compute the rows, as host:port, separated by commas. A name with several addresses stands for all of
    /// them [default: this process].
    #[arg(long, env = "COORDINATOR_WORKERS", value_delimiter = ',', global = true)]
    workers: Vec<String>,
    /// Jobs computed at the same time when this process computes the rows [default: one for each core].
    #[arg(long, env = "COORDINATOR_THREADS", global = true, conflicts_with = "workers")]
    threads: Option<NonZeroUsize>,
}

#[derive(Subcommand)]
enum Command {
    /// Bake a glTF file: a lit glTF comes out.
    Solve(solve::SolveArguments),
    /// Compare a lit scene with a path-traced reference.
    Compare(compare::CompareArguments),
    /// Path-trace the radiosity at points of a scene: what a bake can be compared with.
    Reference(reference::ReferenceArguments),
    /// Compute the view factors between the named surfaces of a scene.
    FormFactors(form_factors::FormFactorArguments),
    /// Sweep the quality of a scene's bakes: error over time against a path-traced reference.
    Study(study::StudyArguments),
}

impl WorkerArguments {
    fn workers(&self) -> anyhow::Result<Workers> {
        // An empty variable, as compose files have it, names no worker.
        let named: Vec<String> = self.workers.iter().filter(|worker| !worker.is_empty()).cloned().collect();
        if !named.is_empty() {
            return Ok(Workers::Remote(named));
        }
        Ok(Workers::Embedded { threads: self.threads()?.get() })
    }

    fn threads(&self) -> anyhow::Result<NonZeroUsize> {
        match self.threads {
            Some(threads) => Ok(threads),
            None => std::thread::available_parallelism().context("cannot count the cores: give --threads"),
        }
    }
}

/// Carries out what the command line asks for.
pub fn run(arguments: Arguments) -> anyhow::Result<()> {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("warn"));
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).without_time().init();
    match arguments.command {
        Command::Solve(solve) => solve::run(&solve, &arguments.workers.workers()?),
        Command::Compare(compare) => compare::run(&compare),
        Command::Reference(reference) => reference::run(&reference, arguments.workers.threads()?),
        Command::FormFactors(factors) => form_factors::run(&factors, arguments.workers.threads()?),
        Command::Study(study) => study::run(&study, &arguments.workers.workers()?),
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
