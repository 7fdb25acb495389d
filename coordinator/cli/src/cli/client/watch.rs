use anyhow::anyhow;
use clap::Args;
use protocol::api::{Job, Phase, State, WatchJobRequest};

use super::super::console::say;
use super::super::progress::{ProgressLine, rate};
use super::{Connection, ServerArgument, Trouble, wait};

#[derive(Args)]
pub struct WatchArguments {
    /// Id of the job, as printed by `submit`
    job: String,
    #[command(flatten)]
    server: ServerArgument,
}

/// Shows the progress of a job until it ends.
pub fn run(arguments: &WatchArguments) -> anyhow::Result<()> {
    wait(async {
        let mut connection = Connection::open(&arguments.server).await?;
        follow(&mut connection, &arguments.job).await
    })
}

/// Waits until a job is done, across restarts of the service.
pub(super) async fn follow(connection: &mut Connection<'_>, id: &str) -> anyhow::Result<()> {
    while let Err(trouble) = watch(connection, id).await {
        connection.renew(trouble).await?;
    }
    Ok(())
}

/// Waits until a job is done, or the connection breaks.
async fn watch(connection: &mut Connection<'_>, id: &str) -> Result<(), Trouble> {
    let line = ProgressLine::new("queued");
    let request = WatchJobRequest { id: id.to_owned() };
    let mut jobs = connection.client.watch_job(request).await?.into_inner();
    while let Some(job) = jobs.message().await? {
        connection.heard();
        match job.state() {
            State::Done => {
                line.finish();
                for warning in job.outcome.iter().flat_map(|outcome| &outcome.warnings) {
                    say(format_args!("warning: {warning}"));
                }
                return Ok(());
            }
            State::Failed => return Err(anyhow!("job {id} failed: {}", job.failure).into()),
            State::Cancelled => return Err(anyhow!("job {id} was cancelled").into()),
            State::Queued | State::Running | State::Unspecified => show(&line, &job),
        }
    }
    Err(Trouble::Passing("it ended the conversation before the job".into()))
}

fn show(line: &ProgressLine, job: &Job) {
    let Some(progress) = &job.progress else {
        return line.show_step("queued", (0, 1), |_| format!("{} before it", job.ahead));
    };
    let left = progress.time_left.map(|left| format!(" · {} s left", left.seconds)).unwrap_or_default();
    let error = progress.error.map(|error| format!(" · error {:.2} %", error * 100.0)).unwrap_or_default();
    line.show_step(step(progress.phase()), (progress.rows, progress.rows_needed), |_| {
        format!(
            "unshot {:.2} %{error} · rows {}/{} · {} · {} vertices · {} workers{left}",
            progress.unshot * 100.0,
            progress.rows,
            progress.rows_needed,
            rate([progress.rows_per_second, progress.rays_per_second]),
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
        Phase::FinalSolve => "final solve",
        Phase::Groups => "groups",
        Phase::Lightmap => "lightmap",
        Phase::Probes => "probes",
        Phase::ExportMesh => "export mesh",
        Phase::Export => "export",
    }
}
