//! What the threads of the workers do, summed up over time.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use bake::ThreadTime;
use tokio::time::Instant;

/// What threads do at the moment.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Threads {
    /// All of the connected workers.
    pub(super) connected: usize,
    /// Those that their workers hold a job for.
    pub(super) occupied: usize,
    /// The others of workers to which a replica is on its way.
    pub(super) loading: usize,
}

/// Time of the threads so far.
#[derive(Debug)]
pub(super) struct Ledger {
    entries: Mutex<Entries>,
}

#[derive(Debug)]
struct Entries {
    threads: Threads,
    since: Instant,
    /// Up to then.
    time: ThreadTime,
}

impl Default for Ledger {
    fn default() -> Self {
        let entries =
            Entries { threads: Threads::default(), since: Instant::now(), time: ThreadTime::default() };
        Self { entries: Mutex::new(entries) }
    }
}

impl Ledger {
    /// From now on threads do this.
    pub(super) fn set(&self, threads: Threads) {
        let mut entries = self.lock();
        if entries.threads != threads {
            entries.pass();
            entries.threads = threads;
        }
    }

    /// A job is answered that took so long to compute.
    pub(super) fn computed(&self, busy: Duration) {
        self.lock().time.busy += busy;
    }

    /// The time of the threads up to now.
    pub(super) fn time(&self) -> ThreadTime {
        let mut entries = self.lock();
        entries.pass();
        entries.time
    }

    fn lock(&self) -> MutexGuard<'_, Entries> {
        // No code that holds the lock leaves the entries half changed.
        self.entries.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Entries {
    fn pass(&mut self) {
        let now = Instant::now();
        let passed = now.saturating_duration_since(self.since);
        let of = |threads: usize| passed * u32::try_from(threads).unwrap_or(u32::MAX);
        let Threads { connected, occupied, loading } = self.threads;
        self.time.connected += of(connected);
        self.time.occupied += of(occupied);
        self.time.loading += of(loading);
        self.since = now;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test(start_paused = true)]
    async fn time_is_counted_for_each_thread() {
        let ledger = Ledger::default();
        let second = Duration::from_secs(1);
        tokio::time::advance(second).await;
        assert_eq!(ledger.time(), ThreadTime::default(), "no worker is there");
        ledger.set(Threads { connected: 4, occupied: 1, loading: 2 });
        tokio::time::advance(second).await;
        ledger.set(Threads { connected: 2, occupied: 2, loading: 0 });
        tokio::time::advance(second).await;
        ledger.computed(second);
        let time =
            ThreadTime { connected: 6 * second, occupied: 3 * second, loading: 2 * second, busy: second };
        assert_eq!(ledger.time(), time);
    }
}
