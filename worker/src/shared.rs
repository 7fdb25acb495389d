//! The state that all sessions of a worker share.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use kernel::replica::Digest;
use tokio::sync::broadcast;
use tokio_util::sync::CancellationToken;

use crate::Settings;
use crate::metrics::Metrics;
use crate::pool::ComputePool;
use crate::store::ReplicaStore;

/// Arrivals that a session may be behind with. Of those that it misses the coordinator does not hear, and sends them itself.
const ARRIVALS: usize = 64;

/// State of a worker. A clone is another handle to it.
#[derive(Clone)]
pub(crate) struct Shared {
    pub(crate) settings: Arc<Settings>,
    pub(crate) pool: ComputePool,
    pub(crate) shutdown: CancellationToken,
    pub(crate) uploads: Arc<UploadProgress>,
    /// Tells all sessions of a replica that came from another worker.
    pub(crate) arrivals: broadcast::Sender<Digest>,
    store: Arc<Mutex<ReplicaStore>>,
}

impl Shared {
    pub(crate) fn new(settings: Settings, pool: ComputePool, shutdown: CancellationToken) -> Self {
        let store = Arc::new(Mutex::new(ReplicaStore::new(settings.replica_bytes)));
        let (arrivals, _) = broadcast::channel(ARRIVALS);
        Self { settings: Arc::new(settings), pool, shutdown, uploads: Arc::default(), arrivals, store }
    }

    /// The replicas; hold them for a look-up, never across work.
    pub(crate) fn store(&self) -> MutexGuard<'_, ReplicaStore> {
        // No code that holds the lock leaves the store half changed.
        self.store.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes what is held.
    pub(crate) fn change_store(&self, change: impl FnOnce(&mut ReplicaStore)) {
        let mut store = self.store();
        change(&mut store);
        let Metrics { replicas, replica_bytes, .. } = &self.settings.metrics;
        replicas.set(store.count() as i64);
        replica_bytes.set(store.bytes().try_into().unwrap_or(i64::MAX));
    }
}

/// Whether uploads get on, all of them together.
#[derive(Debug, Default)]
pub(crate) struct UploadProgress {
    count: AtomicU64,
    /// Replicas that have arrived and are made ready.
    preparing: AtomicUsize,
}

impl UploadProgress {
    /// Bytes came.
    pub(crate) fn came(&self, bytes: usize) {
        self.count.fetch_add(bytes as u64, Ordering::Relaxed);
    }

    /// A replica is made ready until the result is dropped.
    pub(crate) fn preparing(&self) -> Preparing<'_> {
        self.preparing.fetch_add(1, Ordering::Relaxed);
        Preparing(self)
    }

    /// A number that is another one at each call while uploads get on.
    pub(crate) fn progress(&self) -> u64 {
        let step = u64::from(self.preparing.load(Ordering::Relaxed) > 0);
        self.count.fetch_add(step, Ordering::Relaxed) + step
    }
}

/// See [`UploadProgress::preparing`].
pub(crate) struct Preparing<'a>(&'a UploadProgress);

impl Drop for Preparing<'_> {
    fn drop(&mut self) {
        self.0.preparing.fetch_sub(1, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uploads_get_on_by_their_bytes_and_while_they_are_made_ready() {
        let uploads = UploadProgress::default();
        assert_eq!(uploads.progress(), uploads.progress());
        uploads.came(3);
        assert_eq!((uploads.progress(), uploads.progress()), (3, 3));
        let preparing = uploads.preparing();
        assert_eq!((uploads.progress(), uploads.progress()), (4, 5));
        drop(preparing);
        assert_eq!((uploads.progress(), uploads.progress()), (5, 5));
    }
}
