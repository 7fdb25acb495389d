use std::ffi::OsString;
use std::io;
use std::path::Path;

use anyhow::Context;
use clap::Args;
use protocol::telemetry::LogFormat;

/// This program, also where its file was replaced meanwhile.
const SELF: &str = "/proc/self/exe";

/// One job of a service, in a process of its own.
#[derive(Args)]
pub struct JobArguments {
    /// Format of logs: text or json
    #[arg(long, default_value = "text")]
    pub log: LogFormat,
}

/// Runs the job that standard input names.
pub fn run() -> anyhow::Result<()> {
    service::run_job(io::stdin(), io::stdout()).context("cannot run a job")
}

/// The command that runs a job and logs in this format.
pub fn command(log: LogFormat) -> Vec<OsString> {
    let own = || std::env::current_exe().unwrap_or_else(|_| "coordinator".into()).into_os_string();
    let program = if Path::new(SELF).exists() { SELF.into() } else { own() };
    vec![program, "job".into(), "--log".into(), log.to_string().into()]
}
