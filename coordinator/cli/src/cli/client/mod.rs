//! The API of a service from the shell.
//!
//! | module | command |
//! |---|---|
//! | `submit` | hand over a scene |
//! | `watch` | see how far a job is |
//! | `fetch` | take what came out |
//! | `jobs` | list, cancel and delete jobs |
//! | `health` | whether it serves |
//!
//! `connection` is how all of them reach the service; those that wait for a job go on over a restart of it.

mod connection;
mod fetch;
mod health;
mod jobs;
mod submit;
mod watch;

use std::future::Future;

use anyhow::Context;
use clap::Subcommand;
use protocol::security::{ClientSecurity, explain};
use tonic::Status;

use connection::{Client, Connection, ServerArgument, Trouble};

/// What is asked of a service.
#[derive(Subcommand)]
pub enum ClientCommand {
    /// Submit a scene to a service: the name of its job is printed.
    Submit(Box<submit::SubmitArguments>),
    /// Show how far a job of a service is, until it has ended.
    Watch(watch::WatchArguments),
    /// Fetch the lit scene of a finished job, or a preview of a running one.
    Fetch(fetch::FetchArguments),
    /// List the jobs of a service, newest first.
    Jobs(jobs::JobsArguments),
    /// End a job that is queued or runs.
    Cancel(jobs::JobArguments),
    /// Forget a job and all that is kept of it.
    Delete(jobs::JobArguments),
    /// Ask a service whether it serves: the exit code is 0 if it does. For health checks of containers.
    Health(ServerArgument),
}

/// Asks a service.
pub fn run(command: &ClientCommand, security: &ClientSecurity) -> anyhow::Result<()> {
    match command {
        ClientCommand::Submit(arguments) => submit::run(arguments, security),
        ClientCommand::Watch(arguments) => watch::run(arguments, security),
        ClientCommand::Fetch(arguments) => fetch::run(arguments, security),
        ClientCommand::Jobs(arguments) => jobs::list(arguments, security),
        ClientCommand::Cancel(arguments) => jobs::cancel(arguments, security),
        ClientCommand::Delete(arguments) => jobs::delete(arguments, security),
        ClientCommand::Health(server) => health::run(server, security),
    }
}

/// Waits for a conversation with a service.
fn wait<T>(conversation: impl Future<Output = anyhow::Result<T>>) -> anyhow::Result<T> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .context("cannot start the network")?;
    runtime.block_on(conversation)
}

/// What a service says, in its own words.
fn refused(status: Status) -> anyhow::Error {
    match explain(&status) {
        Some(reason) => anyhow::anyhow!("{reason}"),
        None if status.message().is_empty() => anyhow::anyhow!("the service answers {}", status.code()),
        None => anyhow::anyhow!("{}", status.message()),
    }
}
