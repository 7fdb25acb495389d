use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use output::files::{self, AtomicWriteFile};
use protocol::api::fetch_result_response::Body;
use protocol::api::{FetchResultRequest, FileHeader};
use protocol::security::ClientSecurity;
use sha2::{Digest, Sha256};

use super::{Connection, ServerArgument, Trouble, wait};

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
    files::check(&arguments.output)?;
    let wish = if arguments.present { Wish::Present } else { Wish::Result };
    wait(async {
        let mut connection = Connection::open(&arguments.server, security).await?;
        fetch(&mut connection, wish, &arguments.job, &arguments.output).await
    })
}

/// Writes a file of a job, whole or not at all. Where the connection breaks, it goes on where it was.
pub(super) async fn fetch(
    connection: &mut Connection<'_>,
    wish: Wish,
    id: &str,
    output: &Path,
) -> anyhow::Result<()> {
    let cannot = || format!("{} cannot be written", output.display());
    let file = AtomicWriteFile::open(output).with_context(cannot)?;
    let mut coming = Coming { file, received: 0, hasher: Sha256::new(), header: None };
    while let Err(trouble) = receive(connection, wish, id, &mut coming).await {
        connection.renew(trouble).await?;
        if wish == Wish::Present {
            // The next present state is another file.
            coming.restart().with_context(cannot)?;
        }
    }
    let expected = coming.header.context("the service sends no header: it is of another release")?.sha256;
    anyhow::ensure!(
        *expected == *coming.hasher.finalize(),
        "what came is not what the service has, or not all of it: fetch it again"
    );
    coming.file.commit().with_context(cannot)
}

/// A file of which a part is there.
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

/// Takes what is left of a file, for as long as the service is there.
async fn receive(
    connection: &mut Connection<'_>,
    wish: Wish,
    id: &str,
    coming: &mut Coming,
) -> Result<(), Trouble> {
    let present = wish == Wish::Present;
    let request = FetchResultRequest { id: id.to_owned(), present, offset: coming.received };
    let mut messages = connection.client.fetch_result(request).await?.into_inner();
    while let Some(message) = messages.message().await? {
        connection.heard();
        match message.body {
            Some(Body::Header(header)) => coming.header = Some(header),
            Some(Body::Chunk(bytes)) => coming.add(&bytes).context("what came cannot be written")?,
            None => {}
        }
    }
    Ok(())
}
