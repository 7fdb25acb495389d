//! The state that all sessions of a worker share.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio_util::sync::CancellationToken;

use crate::Settings;
use crate::metrics::Metrics;
use crate::pool::ComputePool;
use crate::store::ReplicaStore;

/// State of a worker. A clone is another handle to it.
#[derive(Clone)]
pub(crate) struct Shared {
    pub(crate) settings: Arc<Settings>,
    pub(crate) pool: ComputePool,
    pub(crate) shutdown: CancellationToken,
    store: Arc<Mutex<ReplicaStore>>,
}

impl Shared {
    pub(crate) fn new(settings: Settings, pool: ComputePool, shutdown: CancellationToken) -> Self {
        let store = Arc::new(Mutex::new(ReplicaStore::new(settings.replica_bytes)));
        Self { settings: Arc::new(settings), pool, shutdown, store }
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
