use clap::Args;
use shared::api::{Job, Phase, State, WatchJobRequest};
use shared::security::ClientSecurity;

use super::super::progress::{ProgressLine, short};
use super::{Client, ServerArgument, refused, wait};

#[derive(Args)]
pub struct WatchArguments {
    /// The job, as `submit` named it.
    job: String,
    #[command(flatten)]
    server: ServerArgument,
}

/// Shows how far a job is, until it has ended.
pub fn run(arguments: &WatchArguments, security: &ClientSecurity) -> anyhow::Result<()> {
    wait(async {
        let mut client = arguments.server.connect(security).await?;
        follow(&mut client, &arguments.job).await
    })
}

/// Waits until a job is done.
pub(super) async fn follow(client: &mut Client, id: &str) -> anyhow::Result<()> {
    let mut line = ProgressLine::new();
    let request = WatchJobRequest { id: id.to_owned() };
    let mut jobs = client.watch_job(request).await.map_err(refused)?.into_inner();
    while let Some(job) = jobs.message().await.map_err(refused)? {
        match job.state() {
            State::Done => {
                line.finish();
                for warning in job.outcome.iter().flat_map(|outcome| &outcome.warnings) {
                    eprintln!("warning: {warning}");
                }
                return Ok(());
            }
            State::Failed => anyhow::bail!("job {id} failed: {}", job.failure),
            State::Cancelled => anyhow::bail!("job {id} was cancelled"),
            State::Queued | State::Running | State::Unspecified => show(&mut line, &job),
        }
    }
    anyhow::bail!("the service ended the conversation before job {id}: watch it again")
}

fn show(line: &mut ProgressLine, job: &Job) {
    let Some(progress) = &job.progress else {
        return line.show_step("queued", (0, 1), |_| format!("{} before it", job.ahead));
    };
    let left = progress.time_left.map(|left| format!(" · {} s left", left.seconds)).unwrap_or_default();
    let error = progress.error.map(|error| format!(" · error {:.2} %", error * 100.0)).unwrap_or_default();
    line.show_step(step(progress.phase()), (progress.rows, progress.rows_needed), |_| {
        format!(
            "unshot {:.2} %{error} · rows {}/{} · {} rays/s · {} vertices · {} workers{left}",
            progress.unshot * 100.0,
            progress.rows,
            progress.rows_needed,
            short(progress.rays_per_second),
            progress.vertices,
            progress.workers,
        )
    });
}

fn step(phase: Phase) -> &'static str {
    match phase {
        Phase::Unspecified | Phase::Import => "import",
        Phase::Light => "light",
        Phase::Shoot => "shoot",
        Phase::Refine => "refine",
        Phase::Measure => "measure",
        Phase::Settle => "settle",
        Phase::Groups => "groups",
        Phase::Export => "export",
    }
}
