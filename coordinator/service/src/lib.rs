//! The long-running service: jobs, their store, the API and the page.
//!
//! In: scenes and requests of clients (gRPC, gRPC-web, HTTP). Out: jobs that survive restarts, lit files, previews, metrics. It must
//! not know how light or rows are computed: it hands a job's files and settings to `pipeline` and its rows to `cluster`. Begin
//! reading at [`Service`], then `submit` (a job comes in), `changes` (it changes state), `outside` and `inside` (it runs).
//!
//! | module | what lives there |
//! |---|---|
//! | [`job`] | identifiers and the record of a job |
//! | [`queue`] | which job runs next: pure |
//! | `ledger` | all jobs in memory, for reads |
//! | [`store`] | the data folder |
//! | `submit`, `accept` | uploads and checks of a submission, and its admission |
//! | `changes` | state changes of a job: on disk first, then in memory |
//! | `outside` | the process of a job, as the service starts, serves and ends it |
//! | `pipes` | what the two tell each other |
//! | `inside` | within that process: one job, through the pipeline |
//! | `progress` | the state of a running job, for watchers |
//! | `watch`, `fetch` | streams of job states and of files |
//! | [`clients`], `settings`, `refusal`, `metrics` | tokens, limits, errors, metrics |
//! | [`api`] | the service in gRPC |
//! | [`http`], [`guard`] | the page, and protection against pages of other sites |
//! | [`server`] | one port for all of it |
//!
//! Threads: the network's runtime never touches the disk and never computes. Files are written in blocking threads, each job runs in
//! a process of its own, and workers compute its rows. Jobs change one at a time, on disk before in memory; only new records are
//! written in parallel. Reads are answered from memory.

mod accept;
pub mod api;
mod changes;
pub mod clients;
mod fetch;
pub mod guard;
pub mod http;
mod inside;
pub mod job;
mod ledger;
mod metrics;
mod outside;
mod pipes;
mod progress;
pub mod queue;
mod refusal;
pub mod server;
mod settings;
pub mod store;
mod submit;
mod sync;
#[cfg(test)]
mod tests;
mod watch;

use std::collections::HashMap;
use std::ffi::OsString;
use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

use protocol::api::{Job, ListJobsRequest, ListJobsResponse};
use tokio::sync::Semaphore;
use tokio::task::{JoinError, spawn_blocking};
use tokio_util::sync::CancellationToken;

pub use fetch::{Fetched, FileBytes};
pub use inside::run_job;
pub use job::{ClientName, JobId};
use job::{Record, next_revision};
pub use metrics::Metrics;
pub use refusal::Refusal;
pub use settings::{Limits, ServiceSettings};

use cluster::Cluster;
use ledger::Ledger;
use queue::Event;
use store::{Opened, Store, StoreError};
use submit::Pace;
use sync::lock;

/// Time between two removals of expired jobs.
const TIDY: Duration = Duration::from_secs(60);

/// Time between two looks whether all jobs have stopped.
const PAUSE: Duration = Duration::from_millis(20);

/// The jobs of all clients. A clone is another handle to the same service.
#[derive(Clone)]
pub struct Service {
    inner: Arc<Inner>,
}

/// The state that all handles share.
struct Inner {
    store: Store,
    workers: Cluster,
    limits: Limits,
    /// Jobs that may run at the same time.
    jobs: usize,
    job_command: Vec<OsString>,
    /// Held while a job changes, on disk and in memory.
    changing: Mutex<()>,
    /// Notified when a job that was being written is on disk, or has failed to be.
    arrived: Condvar,
    /// Never held during I/O.
    ledger: Mutex<Ledger>,
    /// Uploads in progress, by client.
    uploads: Mutex<HashMap<ClientName, Vec<Arc<Pace>>>>,
    /// Held while a preview is exported.
    previewing: Semaphore,
    ending: CancellationToken,
    metrics: Metrics,
}

impl Service {
    /// Opens the data folder. Unfinished jobs resume when [`Self::resume`] is called.
    ///
    /// # Errors
    /// When the folder cannot be used.
    pub fn open(settings: &ServiceSettings, workers: Cluster, metrics: Metrics) -> Result<Self, StoreError> {
        let Opened { store, records, damaged, set_aside } = Store::open(&settings.data)?;
        for path in set_aside {
            tracing::warn!(path = %path.display(), "set aside, since no job refers to it: delete it if it is not needed");
        }
        for path in damaged {
            tracing::error!(path = %path.display(), "a job's record is damaged and is passed over: take it from a back-up");
        }
        // No job starts before the service can be reached.
        let mut ledger = Ledger::new(settings.places);
        ledger.hold();
        for record in records {
            // Newer than any revision that was seen while it ran: those are not on disk.
            let revision = next_revision(record.revision);
            ledger.insert(Record { revision, ..record });
        }
        metrics.load(ledger.load());
        let inner = Inner {
            store,
            workers,
            limits: settings.limits.clone(),
            jobs: settings.places.all,
            job_command: settings.job_command.clone(),
            changing: Mutex::new(()),
            arrived: Condvar::new(),
            ledger: Mutex::new(ledger),
            uploads: Mutex::default(),
            previewing: Semaphore::new(1),
            ending: CancellationToken::new(),
            metrics,
        };
        Ok(Self { inner: Arc::new(inner) })
    }

    /// Starts queued jobs and the removal of expired ones. Call within a runtime.
    pub fn resume(&self) {
        let actions = lock(&self.inner.ledger).tell_queue(Event::Opened);
        self.inner.perform(actions);
        let inner = Arc::clone(&self.inner);
        tokio::spawn(async move {
            let ending = inner.ending.clone();
            loop {
                let tidying = Arc::clone(&inner);
                // Errors are logged.
                let _ = spawn_blocking(move || tidying.tidy()).await;
                tokio::select! {
                    () = ending.cancelled() => return,
                    () = tokio::time::sleep(TIDY) => {}
                }
            }
        });
    }

    /// Ends watches and stops jobs, which resume at the next start. Returns whether all stopped in time.
    pub async fn end(&self, patience: Duration) -> bool {
        self.inner.ending.cancel();
        let actions = lock(&self.inner.ledger).tell_queue(Event::Closed);
        self.inner.perform(actions);
        let left = async {
            while lock(&self.inner.ledger).load().1 > 0 {
                tokio::time::sleep(PAUSE).await;
            }
        };
        tokio::time::timeout(patience, left).await.is_ok()
    }

    /// Returns one job.
    ///
    /// # Errors
    /// When it is not this client's.
    pub fn get(&self, client: &ClientName, id: &str) -> Result<Job, Refusal> {
        lock(&self.inner.ledger).view(client, id)
    }

    /// Returns a page of this client's jobs, newest first.
    ///
    /// # Errors
    /// When the page token is invalid.
    pub fn list(&self, client: &ClientName, request: &ListJobsRequest) -> Result<ListJobsResponse, Refusal> {
        lock(&self.inner.ledger).list(client, request)
    }

    /// Cancels a job, unless it has ended.
    ///
    /// # Errors
    /// When it is not this client's, or the disk fails.
    pub async fn cancel(&self, client: &ClientName, id: &str) -> Result<Job, Refusal> {
        let (inner, client, id) = (Arc::clone(&self.inner), client.clone(), id.to_owned());
        blocking(move || {
            inner.cancel(&client, &id)?;
            lock(&inner.ledger).view(&client, &id)
        })
        .await
    }

    /// Deletes a job and its files; cancels it first if it has not ended.
    ///
    /// # Errors
    /// When it is not this client's, or the disk fails.
    pub async fn delete(&self, client: &ClientName, id: &str) -> Result<(), Refusal> {
        let (inner, client, id) = (Arc::clone(&self.inner), client.clone(), id.to_owned());
        blocking(move || inner.delete(&client, &id)).await
    }
}

/// Runs work that may wait for the disk in a blocking thread.
async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Refusal> + Send + 'static,
) -> Result<T, Refusal> {
    let done = spawn_blocking(work).await;
    done.unwrap_or_else(|error: JoinError| Err(Refusal::Failed(error.to_string())))
}
