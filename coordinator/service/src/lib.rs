//! The long-running service: scenes in, jobs that survive, lit files out.
//!
//! | module | what lives there |
//! |---|---|
//! | `job` | a job: its names, its record |
//! | `queue` | which job runs next: pure |
//! | `ledger` | all jobs in memory, for what is asked often |
//! | `store` | the data folder |
//! | `accept` | how a job is taken in |
//! | `changes` | what happens to a job, on the disk first and in memory then |
//! | `run`, `relight` | one job: import, bake or light otherwise, export |
//! | `progress`, `present` | what is seen of a job that runs |
//! | `submit`, `watch`, `fetch` | what clients ask for that takes longer than a look |
//! | `clients`, `settings`, `refusal`, `metrics` | who may ask, limits, why not, figures |
//! | `api` | the service in gRPC |
//! | `http`, `guard` | the service in a browser, and what browsers may not be made to do |
//! | `server` | one port for all of it |
//!
//! Threads: those of the network's runtime never touch the disk and never compute. Files are written where blocking is allowed, each
//! job runs in a thread of its own, and rows are computed by workers. A change of a job is made by one at a time, on the disk before
//! it is seen, but new jobs are written side by side; what clients ask is answered from memory meanwhile.

mod accept;
pub mod api;
mod changes;
pub mod clients;
mod fetch;
pub mod guard;
pub mod http;
pub mod job;
mod ledger;
mod metrics;
mod present;
mod progress;
pub mod queue;
mod refusal;
mod relight;
mod run;
pub mod server;
mod settings;
pub mod store;
mod submit;
#[cfg(test)]
mod tests;
mod watch;

use std::collections::HashMap;
use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

use protocol::api::{Job, ListJobsRequest, ListJobsResponse};
use tokio::sync::Semaphore;
use tokio::task::{JoinError, spawn_blocking};
use tokio_util::sync::CancellationToken;

pub use fetch::{Fetched, FileBytes};
pub use job::{ClientName, JobId};
use job::{Record, next_revision};
pub use metrics::Metrics;
pub use refusal::Refusal;
pub use settings::{Limits, ServiceSettings};

use cluster::Cluster;
use ledger::Ledger;
use progress::lock;
use queue::Event;
use store::{Opened, Store, StoreError};

/// How often it is looked what is kept no longer.
const TIDY: Duration = Duration::from_secs(60);

/// How often it is looked whether jobs have left.
const PAUSE: Duration = Duration::from_millis(20);

/// The jobs of all clients. A clone is another handle to the same service.
#[derive(Clone)]
pub struct Service {
    office: Arc<Office>,
}

/// What all parts of the service share.
struct Office {
    store: Store,
    workers: Cluster,
    limits: Limits,
    /// Held by whoever changes a job: on the disk first, then in memory.
    changing: Mutex<()>,
    /// Told when a job that was on its way to the disk is there, or will not be.
    arrived: Condvar,
    /// Held for a moment only.
    ledger: Mutex<Ledger>,
    /// Uploads under way.
    uploads: Mutex<HashMap<ClientName, usize>>,
    /// Whoever writes a present state.
    presenting: Semaphore,
    ending: CancellationToken,
    metrics: Metrics,
}

impl Service {
    /// Opens the data folder. Jobs that have not ended go on when [`Self::resume`] is called.
    ///
    /// # Errors
    /// When the folder cannot be used.
    pub fn open(settings: &ServiceSettings, workers: Cluster, metrics: Metrics) -> Result<Self, StoreError> {
        let Opened { store, records, damaged } = Store::open(&settings.data)?;
        for path in damaged {
            tracing::error!(path = %path.display(), "a job's record is damaged and is passed over: take it from a back-up");
        }
        // No place until it is known that the service can be reached.
        let mut ledger = Ledger::new(settings.places);
        ledger.hold();
        for record in records {
            // Whoever saw it before sees it as newer: what it was while it ran is not on the disk.
            let revision = next_revision(record.revision);
            ledger.insert(Record { revision, ..record });
        }
        metrics.load(ledger.load());
        let office = Office {
            store,
            workers,
            limits: settings.limits.clone(),
            changing: Mutex::new(()),
            arrived: Condvar::new(),
            ledger: Mutex::new(ledger),
            uploads: Mutex::default(),
            presenting: Semaphore::new(1),
            ending: CancellationToken::new(),
            metrics,
        };
        Ok(Self { office: Arc::new(office) })
    }

    /// Begins to work. Within a runtime.
    pub fn resume(&self) {
        let actions = lock(&self.office.ledger).tell_queue(Event::Opened);
        self.office.perform(actions);
        let office = Arc::clone(&self.office);
        tokio::spawn(async move {
            let ending = office.ending.clone();
            loop {
                let tidying = Arc::clone(&office);
                // What goes wrong is in the log.
                let _ = spawn_blocking(move || tidying.tidy()).await;
                tokio::select! {
                    () = ending.cancelled() => return,
                    () = tokio::time::sleep(TIDY) => {}
                }
            }
        });
    }

    /// Ends: watchers are told, jobs stop and go on at the next start. True when all have left in time.
    pub async fn end(&self, patience: Duration) -> bool {
        self.office.ending.cancel();
        let actions = lock(&self.office.ledger).tell_queue(Event::Closed);
        self.office.perform(actions);
        let left = async {
            while lock(&self.office.ledger).load().1 > 0 {
                tokio::time::sleep(PAUSE).await;
            }
        };
        tokio::time::timeout(patience, left).await.is_ok()
    }

    /// One job.
    ///
    /// # Errors
    /// When it is none of this client's.
    pub fn get(&self, client: &ClientName, id: &str) -> Result<Job, Refusal> {
        lock(&self.office.ledger).view(client, id)
    }

    /// A page of this client's jobs, newest first.
    ///
    /// # Errors
    /// When the token of the page is none.
    pub fn list(&self, client: &ClientName, request: &ListJobsRequest) -> Result<ListJobsResponse, Refusal> {
        lock(&self.office.ledger).list(client, request)
    }

    /// Ends a job that has not ended; changes nothing of one that has.
    ///
    /// # Errors
    /// When it is none of this client's, or the disk fails.
    pub async fn cancel(&self, client: &ClientName, id: &str) -> Result<Job, Refusal> {
        let (office, client, id) = (Arc::clone(&self.office), client.clone(), id.to_owned());
        blocking(move || {
            office.cancel(&client, &id)?;
            lock(&office.ledger).view(&client, &id)
        })
        .await
    }

    /// Forgets a job; cancels it first where it has not ended.
    ///
    /// # Errors
    /// When it is none of this client's, or the disk fails.
    pub async fn delete(&self, client: &ClientName, id: &str) -> Result<(), Refusal> {
        let (office, client, id) = (Arc::clone(&self.office), client.clone(), id.to_owned());
        blocking(move || office.delete(&client, &id)).await
    }
}

/// Does what may wait for the disk, where that holds up nobody.
async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Refusal> + Send + 'static,
) -> Result<T, Refusal> {
    let done = spawn_blocking(work).await;
    done.unwrap_or_else(|error: JoinError| Err(Refusal::Failed(error.to_string())))
}
