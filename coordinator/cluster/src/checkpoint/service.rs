use std::collections::{HashMap, HashSet, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use files::LockedFile;
use kernel::replica::{Digest, EncodedReplica};
use kernel::row::{FinishedJob, JobId, Row, RowRequest};
use protocol::worker::RowStatistics;

use super::error::CheckpointError;
use super::file::{CheckpointFile, read};
use super::record::{decode_body, is_whole, keys};
use super::writer::{Writer, Written};
use bake::{BakeError, RowService, ThreadTime};

/// Use of a checkpoint by a bake.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CheckpointSummary {
    /// Rows read from the file.
    pub rows_read: u64,
    /// Rows appended to it.
    pub rows_written: u64,
    /// Rows not recorded, because the disk did not keep up or recording had stopped.
    pub rows_dropped: u64,
    /// Length of the file.
    pub bytes: u64,
    /// Why recording stopped before the end of the bake, if it did.
    pub stopped: Option<String>,
}

/// A row service that answers from a checkpoint, and adds to it the rows that its inner service computes.
pub struct Checkpointed<S> {
    inner: S,
    path: PathBuf,
    written: Arc<Written>,
    writer: Writer,
    /// Behind the writer: fields are dropped in their order.
    file: LockedFile,
    /// Rows given to the writer: each is recorded once.
    recorded: HashSet<Digest>,
    /// Jobs that the inner service computes, wholly or in part.
    under_way: HashMap<JobId, UnderWay>,
    /// Jobs whose rows are all in the file.
    ready: VecDeque<(JobId, RowRequest, Vec<Digest>)>,
    /// Answers to jobs whose last rows were written while they were submitted.
    answered: VecDeque<FinishedJob>,
    rows_read: u64,
    rows_dropped: u64,
}

struct UnderWay {
    /// One for each shooter of the job.
    keys: Vec<Digest>,
    /// Rows that were in the file.
    known: Vec<Option<(Row, RowStatistics)>>,
}

/// A checkpoint, ready to be read and added to.
pub struct OpenCheckpoint {
    path: PathBuf,
    written: Arc<Written>,
    writer: Writer,
    file: LockedFile,
    recorded: HashSet<Digest>,
}

impl OpenCheckpoint {
    /// Opens or creates the checkpoint at `path`, of `limit` bytes at most.
    ///
    /// # Errors
    /// When the file is not a checkpoint, is of another release or row version, is in use, or cannot be written.
    pub fn open(path: &Path, limit: u64) -> Result<Self, CheckpointError> {
        let failed = |error| CheckpointError::Io { path: path.to_owned(), error };
        let CheckpointFile { file, index, length } = CheckpointFile::open(path)?;
        let recorded = index.keys().copied().collect();
        let written = Written::new(index, length);
        let storage = file.try_clone().map_err(failed)?;
        let writer = Writer::start(path, storage, limit, Arc::clone(&written)).map_err(failed)?;
        Ok(Self { path: path.to_owned(), written, writer, file, recorded })
    }
}

impl<S> Checkpointed<S> {
    /// Answers from this checkpoint what it has, and from `inner` the rest.
    pub fn new(inner: S, checkpoint: OpenCheckpoint) -> Self {
        let OpenCheckpoint { path, written, writer, file, recorded } = checkpoint;
        Self {
            inner,
            path,
            file,
            written,
            writer,
            recorded,
            under_way: HashMap::new(),
            ready: VecDeque::new(),
            answered: VecDeque::new(),
            rows_read: 0,
            rows_dropped: 0,
        }
    }

    /// Waits until all is written. Returns the inner service and a summary.
    pub fn finish(mut self) -> (S, CheckpointSummary) {
        self.writer.finish();
        let summary = CheckpointSummary {
            rows_read: self.rows_read,
            rows_written: self.written.rows.load(Ordering::Relaxed),
            rows_dropped: self.rows_dropped,
            bytes: self.written.bytes.load(Ordering::Relaxed),
            stopped: self.written.stopped(),
        };
        (self.inner, summary)
    }

    /// Reads a row from the file; `None` if it is missing or damaged.
    fn row(&mut self, key: Digest, receivers: usize) -> Option<(Row, RowStatistics)> {
        let place = self.written.place(&key)?;
        let found = read(&self.file, place).ok().filter(|bytes| is_whole(key, bytes));
        let row = found.and_then(|bytes| decode_body(&bytes, receivers));
        match row {
            Some(_) => self.rows_read += 1,
            None => {
                tracing::warn!(path = %self.path.display(), "a row of the checkpoint cannot be read again")
            }
        }
        row
    }
}

impl<S: RowService> Checkpointed<S> {
    /// Has the rows computed that are not in the file, and keeps the others until then. Returns the answer if all are in the file.
    fn ask(&mut self, job: JobId, mut request: RowRequest, keys: Vec<Digest>) -> Option<FinishedJob> {
        let receivers = request.receiver_count as usize;
        let known: Vec<_> = keys.iter().map(|key| self.row(*key, receivers)).collect();
        if known.iter().all(Option::is_some) {
            let (rows, statistics) = known.into_iter().flatten().unzip();
            return Some(FinishedJob { job, rows, statistics });
        }
        let mut is_known = known.iter().map(Option::is_some);
        request.shooters.retain(|_| !is_known.next().unwrap_or(false));
        self.under_way.insert(job, UnderWay { keys, known });
        self.inner.submit(vec![(job, request)]);
        None
    }

    /// Joins computed rows with those from the file, and has them recorded.
    fn complete(&mut self, computed: FinishedJob) -> FinishedJob {
        let job = computed.job;
        let Some(UnderWay { keys, known }) = self.under_way.remove(&job) else { return computed };
        let mut computed = computed.rows.into_iter().zip(computed.statistics);
        let mut finished = FinishedJob { job, rows: vec![], statistics: vec![] };
        for (key, known) in keys.into_iter().zip(known) {
            let Some((row, statistics)) = known.or_else(|| {
                let (row, statistics) = computed.next()?;
                if self.recorded.insert(key) && !self.writer.record(key, &row, &statistics) {
                    self.rows_dropped += 1;
                    self.recorded.remove(&key);
                }
                Some((row, statistics))
            }) else {
                continue;
            };
            finished.rows.push(row);
            finished.statistics.push(statistics);
        }
        finished
    }
}

impl<S: RowService> RowService for Checkpointed<S> {
    fn publish(&mut self, replica: EncodedReplica) {
        self.inner.publish(replica);
    }

    fn release(&mut self, digest: Digest) {
        self.inner.release(digest);
    }

    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>) {
        for (job, request) in requests {
            let keys = keys(&request);
            if keys.iter().all(|key| self.written.place(key).is_some()) {
                // Read when it is needed: until then it takes no memory.
                self.ready.push_back((job, request, keys));
            } else if let Some(finished) = self.ask(job, request, keys) {
                self.answered.push_back(finished);
            }
        }
    }

    fn withdraw(&mut self) {
        self.inner.withdraw();
        self.under_way.clear();
        self.ready.clear();
        self.answered.clear();
    }

    fn threads(&self) -> usize {
        self.inner.threads()
    }

    fn jobs_ahead(&self) -> usize {
        self.inner.jobs_ahead()
    }

    fn thread_time(&self) -> ThreadTime {
        self.inner.thread_time()
    }

    fn next(&mut self, patience: Duration) -> Result<Option<FinishedJob>, BakeError> {
        if let Some(finished) = self.answered.pop_front() {
            return Ok(Some(finished));
        }
        while let Some((job, request, keys)) = self.ready.pop_front() {
            if let Some(finished) = self.ask(job, request, keys) {
                return Ok(Some(finished));
            }
        }
        let computed = self.inner.next(patience)?;
        Ok(computed.map(|computed| self.complete(computed)))
    }
}
