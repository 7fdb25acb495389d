use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;
use atomic_write_file::AtomicWriteFile;
use clap::Args;
use sha2::{Digest, Sha256};
use shared::api::FetchResultRequest;
use shared::api::fetch_result_response::Body;
use shared::security::ClientSecurity;

use super::super::ensure_place;
use super::{Client, ServerArgument, refused, wait};

#[derive(Args)]
pub struct FetchArguments {
    /// The job, as `submit` named it.
    job: String,
    /// Where its lit scene is written.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Fetch the present state of a job that runs, as GLB.
    #[arg(long)]
    present: bool,
    #[command(flatten)]
    server: ServerArgument,
}

/// Which file is wanted.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Wish {
    /// The lit file of a job that is done.
    Result,
    /// What a job that runs knows by now; of one that is done, the lit file.
    Present,
}

/// Writes what came out of a job.
pub fn run(arguments: &FetchArguments, security: &ClientSecurity) -> anyhow::Result<()> {
    ensure_place(&arguments.output)?;
    let wish = if arguments.present { Wish::Present } else { Wish::Result };
    wait(async {
        let mut client = arguments.server.connect(security).await?;
        fetch(&mut client, wish, &arguments.job, &arguments.output).await
    })
}

/// Writes a file of a job, whole or not at all.
pub(super) async fn fetch(client: &mut Client, wish: Wish, id: &str, output: &Path) -> anyhow::Result<()> {
    let request = FetchResultRequest { id: id.to_owned(), present: wish == Wish::Present, offset: 0 };
    let mut messages = client.fetch_result(request).await.map_err(refused)?.into_inner();
    let cannot = || format!("{} cannot be written", output.display());
    let mut file = AtomicWriteFile::open(output).with_context(cannot)?;
    let (mut header, mut hasher) = (None, Sha256::new());
    while let Some(message) = messages.message().await.map_err(refused)? {
        match message.body {
            Some(Body::Header(first)) => header = Some(first),
            Some(Body::Chunk(bytes)) => {
                hasher.update(&bytes);
                file.write_all(&bytes).with_context(cannot)?;
            }
            None => {}
        }
    }
    let expected = header.context("the service sends no header: it is of another release")?.sha256;
    anyhow::ensure!(
        *expected == *hasher.finalize(),
        "what came is not what the service has, or not all of it: fetch it again"
    );
    file.commit().with_context(cannot)
}
