use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use files::AtomicWriteFile;
use protocol::api::fetch_result_response::Body;
use protocol::api::{FetchResultRequest, FileHeader};
use sha2::{Digest, Sha256};

use super::super::outputs::check_distinct;
use super::{Connection, ServerArgument, Trouble, wait};

#[derive(Args)]
pub struct FetchArguments {
    /// Id of the job, as printed by `submit`
    job: String,
    /// Lit scene to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Fetch a preview of a running job, as GLB
    #[arg(long, alias = "present")]
    preview: bool,
    #[command(flatten)]
    server: ServerArgument,
}

/// A file of a job.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum JobFile {
    /// The lit file of a finished job.
    Result,
    /// A preview of a running job; of a finished one, the lit file.
    Preview,
}

/// Downloads a file of a job.
pub fn run(arguments: &FetchArguments) -> anyhow::Result<()> {
    check_distinct(&arguments.server.security.files(), &[("output", Some(&arguments.output))])?;
    files::check(&arguments.output)?;
    let file = if arguments.preview { JobFile::Preview } else { JobFile::Result };
    wait(async {
        let mut connection = Connection::open(&arguments.server).await?;
        fetch(&mut connection, file, &arguments.job, &arguments.output).await
    })
}

/// Writes a file of a job, completely or not at all. Resumes after a broken connection.
pub(super) async fn fetch(
    connection: &mut Connection<'_>,
    wanted: JobFile,
    id: &str,
    output: &Path,
) -> anyhow::Result<()> {
    let cannot = || format!("{} cannot be written", output.display());
    let file = files::replace(output).with_context(cannot)?;
    let mut coming = Coming { file, received: 0, hasher: Sha256::new(), header: None };
    while let Err(trouble) = receive(connection, wanted, id, &mut coming).await {
        connection.renew(trouble).await?;
        if wanted == JobFile::Preview {
            // The next preview is another file.
            coming.restart().with_context(cannot)?;
        }
    }
    let expected = coming.header.context("the service sends no header: use the same release of both")?.sha256;
    anyhow::ensure!(*expected == *coming.hasher.finalize(), "the download is damaged: fetch the file again");
    coming.file.commit().with_context(cannot)
}

/// A file that is being downloaded.
struct Coming {
    file: AtomicWriteFile,
    received: u64,
    hasher: Sha256,
    /// The latest one.
    header: Option<FileHeader>,
}

impl Coming {
    fn add(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.hasher.update(bytes);
        self.received += bytes.len() as u64;
        self.file.write_all(bytes)
    }

    fn restart(&mut self) -> io::Result<()> {
        (self.received, self.hasher, self.header) = (0, Sha256::new(), None);
        self.file.set_len(0)?;
        self.file.rewind()
    }
}

/// Receives the rest of a file.
async fn receive(
    connection: &mut Connection<'_>,
    wanted: JobFile,
    id: &str,
    coming: &mut Coming,
) -> Result<(), Trouble> {
    let present = wanted == JobFile::Preview;
    let request = FetchResultRequest { id: id.to_owned(), present, offset: coming.received };
    let mut messages = connection.client.fetch_result(request).await?.into_inner();
    while let Some(message) = messages.message().await? {
        connection.heard();
        match message.body {
            Some(Body::Header(header)) => coming.header = Some(header),
            Some(Body::Chunk(bytes)) => coming.add(&bytes).context("the download cannot be written")?,
            None => {}
        }
    }
    Ok(())
}
