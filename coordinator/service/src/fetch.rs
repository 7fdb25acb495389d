use std::io::{self, SeekFrom};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use bytes::Bytes;
use files::open_regular;
use protocol::api::{FetchResultRequest, FileHeader, Format, OutputOptions, State};
use tokio::fs::File;
use tokio::io::AsyncSeekExt;
use tokio::time::{Instant, sleep};
use tokio_stream::Stream;
use tokio_util::io::ReaderStream;

use crate::job::{ClientName, Record};
use crate::metrics::Metrics;
use crate::progress::Live;
use crate::refusal::Refusal;
use crate::store::{digest, remove_file};
use crate::sync::lock;
use crate::{Service, blocking};

/// Bytes read at once, when the last ones were taken.
const READ_BYTES: usize = 256 << 10;

/// How long to wait for a first preview, and how often to look.
const PATIENCE: Duration = Duration::from_secs(10);
const LOOK: Duration = Duration::from_millis(50);

/// Media type of binary glTF.
const GLB: &str = "model/gltf-binary";

/// Longest name of a file.
const LONGEST_NAME: usize = 64;

/// A file for a client.
pub struct Fetched {
    /// What it is.
    pub header: FileHeader,
    /// Its bytes, from where they were asked for.
    pub bytes: FileBytes,
}

/// The bytes of a file, read as they are taken.
pub struct FileBytes {
    reader: ReaderStream<File>,
    metrics: Metrics,
}

impl Stream for FileBytes {
    type Item = Result<Bytes, Refusal>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        let next = Pin::new(&mut self.reader).poll_next(context);
        if let Poll::Ready(Some(Ok(bytes))) = &next {
            self.metrics.fetched(bytes.len());
        }
        next.map(|read| read.map(|bytes| bytes.map_err(Refusal::from)))
    }
}

impl Service {
    /// Opens the lit file of a finished job, or a preview of a running one.
    ///
    /// # Errors
    /// When the job is not this client's, has no such file, or the disk fails.
    pub async fn fetch(&self, client: &ClientName, request: &FetchResultRequest) -> Result<Fetched, Refusal> {
        let record = lock(&self.inner.ledger).of_client(client, &request.id)?.record.clone();
        match (record.state, &record.outcome) {
            (State::Done, Some(outcome)) => {
                if request.offset > outcome.size {
                    let should = format!("must be {} at most: that is the length of the file", outcome.size);
                    return Err(Refusal::invalid("offset", should));
                }
                let (media_type, file_name) = named(&record);
                let header = FileHeader {
                    size: outcome.size,
                    sha256: outcome.sha256.clone(),
                    media_type,
                    file_name,
                    present: 0,
                };
                let result = self.inner.store.result(&record);
                let mut file = File::from_std(blocking(move || Ok(open_regular(&result)?)).await?);
                file.seek(SeekFrom::Start(request.offset)).await?;
                Ok(Fetched { header, bytes: self.bytes_of(file) })
            }
            (State::Running, _) if request.present => self.fetch_preview(&record, request.offset).await,
            _ if request.present => Err(Refusal::NotRunning(record.id)),
            _ => Err(Refusal::NotDone(record.id)),
        }
    }

    /// Has a preview exported by the process of the job. The file is unlinked before it is sent: the system removes it when it is closed.
    async fn fetch_preview(&self, record: &Record, offset: u64) -> Result<Fetched, Refusal> {
        if offset > 0 {
            return Err(Refusal::invalid("offset", "must be 0 for a preview: the next one is another file"));
        }
        let live = lock(&self.inner.ledger).entry(record.id).and_then(|entry| entry.live.clone());
        let live = live.ok_or(Refusal::NotRunning(record.id))?;
        // One at a time: each may take as much memory as the scene.
        let _turn = self.inner.previewing.acquire().await;
        if !self.wait_for_preview(&live).await {
            return Err(Refusal::NotRunning(record.id));
        }
        let path = self.inner.store.temporary("glb")?;
        let asked = (Arc::clone(&live), path.clone());
        // In a blocking thread: the pipe may be full.
        let exported = blocking(move || Ok(asked.0.link.export_preview(&asked.1))).await?.await;
        let exported = exported.map_err(|_| Refusal::NotRunning(record.id))?;
        let (file, size, sha256) = blocking(move || {
            let opened = (|| Ok((std::fs::File::open(&path)?, digest(&path)?)))();
            remove_file(&path)?;
            if !exported.failure.is_empty() {
                return Err(Refusal::Failed(exported.failure));
            }
            let (file, (size, sha256)) = opened.map_err(|error: io::Error| Refusal::from(error))?;
            Ok((file, size, sha256))
        })
        .await?;
        let number = exported.number;
        let header = FileHeader {
            size,
            sha256: sha256.to_vec().into(),
            media_type: GLB.into(),
            file_name: format!("{}-{number}.glb", stem(record)),
            present: number,
        };
        Ok(Fetched { header, bytes: self.bytes_of(File::from_std(file)) })
    }

    /// Returns whether there is a preview, and waits for the first: it is made when somebody asks.
    async fn wait_for_preview(&self, live: &Live) -> bool {
        let until = Instant::now() + PATIENCE;
        loop {
            match live.ask_preview() {
                true => return true,
                false if Instant::now() >= until || live.is_stopped() => return false,
                false => sleep(LOOK).await,
            }
        }
    }

    fn bytes_of(&self, file: File) -> FileBytes {
        let reader = ReaderStream::with_capacity(file, READ_BYTES);
        FileBytes { reader, metrics: self.inner.metrics.clone() }
    }
}

/// Returns media type and name of a job's lit file.
fn named(record: &Record) -> (String, String) {
    let stem = stem(record);
    match record.header.output.as_ref().map(OutputOptions::format) {
        Some(Format::Ply) => ("application/octet-stream".into(), format!("{stem}-lit.ply")),
        _ => (GLB.into(), format!("{stem}-lit.glb")),
    }
}

/// Returns the stem of a job's file names: the plain characters of the client's name for it.
fn stem(record: &Record) -> String {
    let is_plain = |character: &char| character.is_ascii_alphanumeric() || matches!(character, '-' | '_');
    let stem: String = record.header.name.chars().filter(is_plain).take(LONGEST_NAME).collect();
    if stem.is_empty() { "scene".into() } else { stem }
}
