use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Args;
use service::store;

use super::console::{print, say};

/// Between two lines that tell how far it has come.
const INTERVAL: Duration = Duration::from_secs(1);

#[derive(Args)]
pub struct CheckDataArguments {
    /// Data folder of the service, which may run meanwhile
    #[arg(long, env = "COORDINATOR_DATA", value_name = "FOLDER", default_value = "halflight-data")]
    data: PathBuf,
}

/// Checks a data folder, and lists what is damaged.
pub fn run(arguments: &CheckDataArguments) -> anyhow::Result<()> {
    let (mut files, mut told) = (0, Instant::now());
    let found = store::check(&arguments.data, |path| {
        files += 1;
        if told.elapsed() >= INTERVAL {
            told = Instant::now();
            say(format_args!("check: {files} files, now {}", path.display()));
        }
    })?;
    for (path, cure) in &found.damaged {
        print(format_args!("{} is damaged or gone: {cure}", path.display()))?;
    }
    let count = found.damaged.len();
    anyhow::ensure!(
        count == 0,
        "{count} of {} files in {} are damaged",
        found.files,
        arguments.data.display()
    );
    print(format_args!("{} files are as they were written", found.files))
}
