use std::time::{Duration, SystemTime};

use clap::Args;
use comfy_table::ColumnConstraint;
use protocol::api::{CancelJobRequest, DeleteJobRequest, Job, ListJobsRequest, State};

use super::super::console::print;
use super::super::report::new_table;
use super::{ServerArgument, refused, wait};

#[derive(Args)]
pub struct JobsArguments {
    /// List only jobs that have not ended
    #[arg(long)]
    unfinished: bool,
    #[command(flatten)]
    server: ServerArgument,
}

#[derive(Args)]
pub struct JobArguments {
    /// Id of the job, as printed by `submit`
    job: String,
    #[command(flatten)]
    server: ServerArgument,
}

/// Lists jobs, newest first.
pub fn list(arguments: &JobsArguments) -> anyhow::Result<()> {
    let states =
        if arguments.unfinished { vec![State::Queued.into(), State::Running.into()] } else { vec![] };
    let mut table = new_table();
    table.set_header(["job", "name", "state", "submitted", ""]);
    // The id of a job is copied from here: broken over two lines it cannot be.
    if let Some(jobs) = table.column_mut(0) {
        jobs.set_constraint(ColumnConstraint::ContentWidth);
    }
    wait(async {
        let mut client = arguments.server.connect().await?;
        let mut page_token = String::new();
        loop {
            let request = ListJobsRequest { page_size: 1000, page_token, states: states.clone() };
            let page = client.list_jobs(request).await.map_err(refused)?.into_inner();
            for job in page.jobs {
                let since = job.submitted.and_then(|time| SystemTime::try_from(time).ok());
                let age = since.and_then(|time| time.elapsed().ok()).map(ago).unwrap_or_default();
                let (state, more) = said(&job);
                table.add_row([job.id, job.name, state.into(), age, more]);
            }
            page_token = page.next_page_token;
            if page_token.is_empty() {
                return Ok(());
            }
        }
    })?;
    print(&table)
}

/// Cancels a job.
pub fn cancel(arguments: &JobArguments) -> anyhow::Result<()> {
    wait(async {
        let mut client = arguments.server.connect().await?;
        let request = CancelJobRequest { id: arguments.job.clone() };
        let job = client.cancel_job(request).await.map_err(refused)?.into_inner();
        print(format_args!("{} is {}", job.id, said(&job).0))
    })
}

/// Deletes a job.
pub fn delete(arguments: &JobArguments) -> anyhow::Result<()> {
    wait(async {
        let mut client = arguments.server.connect().await?;
        let request = DeleteJobRequest { id: arguments.job.clone() };
        client.delete_job(request).await.map_err(refused)?;
        Ok(())
    })
}

/// The state of a job, with details.
fn said(job: &Job) -> (&'static str, String) {
    match job.state() {
        State::Queued => ("queued", format!("{} before it", job.ahead)),
        State::Running => {
            let unshot =
                job.progress.as_ref().map(|progress| format!("unshot {:.2} %", 100.0 * progress.unshot));
            ("running", unshot.unwrap_or_default())
        }
        State::Done => ("done", String::new()),
        State::Failed => ("failed", job.failure.clone()),
        State::Cancelled => ("cancelled", String::new()),
        State::Unspecified => ("unknown", String::new()),
    }
}

/// An age for people.
fn ago(passed: Duration) -> String {
    match passed.as_secs() {
        seconds @ 0..=119 => format!("{seconds} s ago"),
        seconds @ 120..=7199 => format!("{} min ago", seconds / 60),
        seconds @ 7200..=172_799 => format!("{} h ago", seconds / 3600),
        seconds => format!("{} days ago", seconds / 86400),
    }
}
