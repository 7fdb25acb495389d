//! Appends records in a thread of its own: a bake never waits for the disk.

use std::collections::HashMap;
use std::io::{self, Write};
use std::path::Path;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use kernel::replica::Digest;

use super::file::Place;
use super::record::{HEAD, encode};
use kernel::row::Row;
use protocol::worker::RowStatistics;

/// Bytes that may wait to be written. Rows beyond them are not recorded: computing a row again costs less than waiting for a slow
/// disk.
const MOST_WAITING: usize = 64 << 20;

/// Longest time before written records are synced to the disk, in case of a power failure.
const SYNC_INTERVAL: Duration = Duration::from_secs(5);

/// State that the bake and the writer share.
pub struct Written {
    pub index: Mutex<HashMap<Digest, Place>>,
    pub rows: AtomicU64,
    /// Length of the file.
    pub bytes: AtomicU64,
    waiting: AtomicUsize,
    /// Why the writer stopped.
    stopped: Mutex<Option<String>>,
}

impl Written {
    pub fn new(index: HashMap<Digest, Place>, bytes: u64) -> Arc<Self> {
        Arc::new(Self {
            index: Mutex::new(index),
            rows: AtomicU64::new(0),
            bytes: AtomicU64::new(bytes),
            waiting: AtomicUsize::new(0),
            stopped: Mutex::new(None),
        })
    }

    /// Place of a row in the file.
    pub fn place(&self, key: &Digest) -> Option<Place> {
        lock(&self.index).get(key).copied()
    }

    /// Why recording stopped, if it did.
    pub fn stopped(&self) -> Option<String> {
        lock(&self.stopped).clone()
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // No code that holds the lock leaves it half changed.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Destination of a checkpoint's bytes.
pub trait Storage: Write + Send + 'static {
    /// Syncs written bytes to the disk.
    fn sync(&mut self) -> io::Result<()>;
    /// Cuts off bytes after the last whole record.
    fn cut(&mut self, length: u64) -> io::Result<()>;
}

impl Storage for std::fs::File {
    fn sync(&mut self) -> io::Result<()> {
        self.sync_data()
    }

    fn cut(&mut self, length: u64) -> io::Result<()> {
        self.set_len(length)
    }
}

/// Handle to the writer's thread.
pub struct Writer {
    records: Option<Sender<(Digest, Row, RowStatistics)>>,
    thread: Option<JoinHandle<()>>,
    written: Arc<Written>,
}

impl Writer {
    /// Starts a thread that appends to `storage`, up to `limit` bytes in all. Messages call it by its `path`.
    ///
    /// # Errors
    /// When the system refuses to start a thread.
    pub fn start(path: &Path, storage: impl Storage, limit: u64, written: Arc<Written>) -> io::Result<Self> {
        let (records, inbox) = mpsc::channel();
        let shared = Arc::clone(&written);
        let path = path.to_owned();
        let thread = std::thread::Builder::new().name("checkpoint".into()).spawn(move || {
            if let Err(why) = write(storage, limit, &inbox, &shared) {
                let path = path.display();
                tracing::warn!(
                    "checkpoint {path} ends here, and the bake goes on: {why}; what comes from now on would be computed again"
                );
                *lock(&shared.stopped) = Some(why);
            }
        })?;
        Ok(Self { records: Some(records), thread: Some(thread), written })
    }

    /// Queues a row to be appended. False if it will not be.
    pub fn record(&self, key: Digest, row: &Row, statistics: &RowStatistics) -> bool {
        let bytes = row.bytes();
        let Some(records) = &self.records else { return false };
        if self.written.waiting.load(Ordering::Relaxed) + bytes > MOST_WAITING {
            return false;
        }
        self.written.waiting.fetch_add(bytes, Ordering::Relaxed);
        records.send((key, row.clone(), *statistics)).is_ok()
    }

    /// Waits until all is written.
    pub fn finish(&mut self) {
        self.records = None;
        if let Some(thread) = self.thread.take() {
            // The thread handles its errors.
            let _ = thread.join();
        }
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        self.finish();
    }
}

/// Writes until the bake is over. Returns the reason if it stops before.
fn write(
    mut storage: impl Storage,
    limit: u64,
    inbox: &Receiver<(Digest, Row, RowStatistics)>,
    written: &Written,
) -> Result<(), String> {
    let mut end = written.bytes.load(Ordering::Relaxed);
    // When the first record was written that may not have reached the disk.
    let mut unsynced: Option<Instant> = None;
    let failed = |error: io::Error| format!("it cannot be written: {error}");
    loop {
        let patience = unsynced.map_or(SYNC_INTERVAL, |since| SYNC_INTERVAL.saturating_sub(since.elapsed()));
        let received =
            if patience.is_zero() { Err(RecvTimeoutError::Timeout) } else { inbox.recv_timeout(patience) };
        let (key, row, statistics) = match received {
            Ok(record) => record,
            Err(outcome) => {
                // Also while no rows come, and at the end.
                if unsynced.take().is_some() {
                    storage.sync().map_err(failed)?;
                }
                match outcome {
                    RecvTimeoutError::Timeout => continue,
                    RecvTimeoutError::Disconnected => return Ok(()),
                }
            }
        };
        let record = encode(key, &row, &statistics);
        written.waiting.fetch_sub(row.bytes(), Ordering::Relaxed);
        let next = end + record.len() as u64;
        if next > limit {
            return Err(format!("it has reached --checkpoint-size ({} MiB)", limit >> 20));
        }
        if let Err(error) = storage.write_all(&record) {
            // An incomplete record would be cut off by the reader too.
            let _ = storage.cut(end);
            return Err(failed(error));
        }
        unsynced.get_or_insert_with(Instant::now);
        let place = Place { offset: end + HEAD as u64, length: record.len() - HEAD };
        lock(&written.index).insert(key, place);
        end = next;
        written.bytes.store(end, Ordering::Relaxed);
        written.rows.fetch_add(1, Ordering::Relaxed);
    }
}
