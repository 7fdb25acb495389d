//! Replicas that workers pass on to each other: where they reach each other, and which take long.

use std::collections::{BTreeMap, BTreeSet};

use kernel::replica::Digest;
use tokio::time::Instant;

use super::connect::Peer;
use crate::scheduler::{WorkerId, patience};

/// What is known of uploads under way, from workers and from here.
#[derive(Debug, Default)]
pub(super) struct Passing {
    peers: BTreeMap<WorkerId, Peer>,
    /// When each upload under way counts as late.
    late: BTreeMap<(WorkerId, Digest), Instant>,
    by_time: BTreeSet<(Instant, WorkerId, Digest)>,
}

impl Passing {
    /// A worker is connected that passes replicas on.
    pub(super) fn joined(&mut self, worker: WorkerId, peer: Peer) {
        self.peers.insert(worker, peer);
    }

    /// A worker is lost.
    pub(super) fn lost(&mut self, worker: WorkerId) {
        self.peers.remove(&worker);
        self.late.retain(|(of, _), _| *of != worker);
        self.by_time.retain(|(_, of, _)| *of != worker);
    }

    /// Where others reach a worker.
    pub(super) fn peer(&self, worker: WorkerId) -> Option<&Peer> {
        self.peers.get(&worker)
    }

    /// A replica of this length is on its way to a worker. Nobody waits for those to workers that take none from others.
    pub(super) fn begins(&mut self, worker: WorkerId, digest: Digest, bytes: u64) {
        self.arrived(worker, digest);
        if self.peers.contains_key(&worker) {
            let late = Instant::now() + patience(bytes);
            self.late.insert((worker, digest), late);
            self.by_time.insert((late, worker, digest));
        }
    }

    /// A replica has arrived.
    pub(super) fn arrived(&mut self, worker: WorkerId, digest: Digest) {
        if let Some(late) = self.late.remove(&(worker, digest)) {
            self.by_time.remove(&(late, worker, digest));
        }
    }

    /// When the next upload is late.
    pub(super) fn next_late(&self) -> Option<Instant> {
        self.by_time.first().map(|(time, ..)| *time)
    }

    /// The upload that is late, if one is.
    pub(super) fn take_late(&mut self) -> Option<(WorkerId, Digest)> {
        let (_, worker, digest) =
            self.by_time.first().copied().filter(|(time, ..)| *time <= Instant::now())?;
        self.arrived(worker, digest);
        Some((worker, digest))
    }
}
