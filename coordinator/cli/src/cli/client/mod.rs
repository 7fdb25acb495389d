//! The commands for clients of a service.
//!
//! | module | command |
//! |---|---|
//! | `submit` | submit a scene |
//! | `watch` | show the progress of a job |
//! | `fetch` | download a lit scene |
//! | `jobs` | list, cancel and delete jobs |
//! | `health` | check that a service serves |
//!
//! `connection` connects to the service; commands that wait for a job reconnect after a restart of it.

mod connection;
mod fetch;
mod health;
mod jobs;
mod submit;
mod watch;

use std::future::Future;

use anyhow::Context;
use clap::Subcommand;
use protocol::security::explain;
use tonic::Status;

use connection::{Client, Connection, ServerArgument, Trouble};

/// Commands for clients of a service.
#[derive(Subcommand)]
pub enum ClientCommand {
    /// Submit a scene to a service and print the id of its job
    #[command(after_help = "Examples:
  coordinator submit scene.glb --error 0.02 -o lit.glb
  coordinator submit --relight JOB --light lamp=0.5 -o evening.glb")]
    Submit(Box<submit::SubmitArguments>),
    /// Show the progress of a job until it ends
    #[command(after_help = "Example:\n  coordinator watch JOB --server bake:7000")]
    Watch(watch::WatchArguments),
    /// Download the lit scene of a job, or a preview of a running one
    #[command(after_help = "Example:\n  coordinator fetch JOB --preview -o preview.glb")]
    Fetch(fetch::FetchArguments),
    /// List jobs, newest first
    #[command(after_help = "Example:\n  coordinator jobs --unfinished")]
    Jobs(jobs::JobsArguments),
    /// Cancel a queued or running job
    #[command(after_help = "Example:\n  coordinator cancel JOB")]
    Cancel(jobs::JobArguments),
    /// Delete a job and everything stored for it
    #[command(after_help = "Example:\n  coordinator delete JOB")]
    Delete(jobs::JobArguments),
    /// Check that a service is ready; exits with 0 if it is
    #[command(after_help = "Example:\n  coordinator health --server 127.0.0.1:7000")]
    Health(ServerArgument),
}

/// Runs a command of a client.
pub fn run(command: &ClientCommand) -> anyhow::Result<()> {
    match command {
        ClientCommand::Submit(arguments) => submit::run(arguments),
        ClientCommand::Watch(arguments) => watch::run(arguments),
        ClientCommand::Fetch(arguments) => fetch::run(arguments),
        ClientCommand::Jobs(arguments) => jobs::list(arguments),
        ClientCommand::Cancel(arguments) => jobs::cancel(arguments),
        ClientCommand::Delete(arguments) => jobs::delete(arguments),
        ClientCommand::Health(server) => health::run(server),
    }
}

/// Runs a conversation with a service to its end.
fn wait<T>(conversation: impl Future<Output = anyhow::Result<T>>) -> anyhow::Result<T> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .context("cannot start the network")?;
    runtime.block_on(conversation)
}

/// The error of a service, in its own words.
fn refused(status: Status) -> anyhow::Error {
    match explain(&status) {
        Some(reason) => anyhow::anyhow!("{reason}"),
        None if status.message().is_empty() => anyhow::anyhow!("the service answers {}", status.code()),
        None => anyhow::anyhow!("{}", status.message()),
    }
}
