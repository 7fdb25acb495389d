//! Replicas that workers do not take: for what each says of itself, what it answers, and what becomes of it.

use std::collections::{BTreeMap, HashMap};
use std::time::Duration;

use kernel::replica::{Digest, EncodedReplica};
use tokio::time::Instant;

use crate::scheduler::WorkerId;

/// How long jobs that no worker takes the replicas of wait for one that does: it may just be dialled.
const PATIENCE: Duration = Duration::from_secs(5);

/// Times in a row that a worker is lost while it is given a replica before it is not given that one again.
const MOST_LOSSES: u32 = 3;

/// What is known of replicas and the workers that do not take them.
#[derive(Debug, Default)]
pub(super) struct Refusals {
    /// Length of the largest replica that a worker takes, in bytes; 0 if it does not say.
    largest: BTreeMap<WorkerId, u64>,
    /// Replicas on their way to each worker, and their lengths.
    on_the_way: BTreeMap<WorkerId, BTreeMap<Digest, u64>>,
    /// Losses in a row of the worker at an address, while it was given a replica.
    losses: HashMap<(Digest, String), u32>,
    /// Why a replica was refused last.
    reasons: HashMap<Digest, String>,
    /// When jobs that wait in vain are given up.
    ends: Option<Instant>,
}

impl Refusals {
    /// A worker is connected.
    pub(super) fn joined(&mut self, worker: WorkerId, largest: u64) {
        self.largest.insert(worker, largest);
    }

    /// A worker at an address is lost. Of several replicas on their way to it the largest is blamed: want of memory kills most.
    pub(super) fn lost(&mut self, worker: WorkerId, address: &str, orderly: bool) {
        self.largest.remove(&worker);
        let on_the_way = self.on_the_way.remove(&worker).filter(|_| !orderly);
        if let Some((digest, _)) = on_the_way.into_iter().flatten().max_by_key(|(_, length)| *length) {
            *self.losses.entry((digest, address.into())).or_default() += 1;
        }
    }

    /// A replica is about to be sent to the worker of this name and address.
    ///
    /// # Errors
    /// Why it is not to be sent.
    pub(super) fn sends(
        &mut self,
        worker: WorkerId,
        (name, address): (&str, &str),
        replica: &EncodedReplica,
    ) -> Result<(), String> {
        let (digest, length) = (replica.digest, replica.bytes.len() as u64);
        let largest = self.largest.get(&worker).copied().filter(|largest| *largest > 0);
        if let Some(largest) = largest.filter(|largest| length > *largest) {
            return Err(format!(
                "replica {digest} has {length} bytes, and worker {name} takes {largest}: start it with a larger \
                 --replica-bytes, or submit a smaller scene"
            ));
        }
        if self.losses.get(&(digest, address.into())).is_some_and(|losses| *losses >= MOST_LOSSES) {
            return Err(format!(
                "worker {name} was lost {MOST_LOSSES} times in a row while it was given replica {digest}: see its log, or \
                 give it more memory"
            ));
        }
        self.on_the_way.entry(worker).or_default().insert(digest, length);
        Ok(())
    }

    /// A replica has arrived at a worker at this address.
    pub(super) fn arrived(&mut self, worker: WorkerId, address: &str, digest: Digest) {
        if let Some(replicas) = self.on_the_way.get_mut(&worker) {
            replicas.remove(&digest);
        }
        self.losses.remove(&(digest, address.into()));
    }

    /// A worker does not take a replica.
    pub(super) fn refused(&mut self, worker: WorkerId, digest: Digest, reason: String) {
        if let Some(replicas) = self.on_the_way.get_mut(&worker) {
            replicas.remove(&digest);
        }
        self.reasons.insert(digest, reason);
    }

    /// A replica is not needed any more.
    pub(super) fn released(&mut self, digest: Digest) {
        self.reasons.remove(&digest);
        self.losses.retain(|(lost, _), _| *lost != digest);
    }

    /// Why one of these replicas was refused.
    pub(super) fn reason(&self, needs: &[Digest]) -> String {
        needs.iter().find_map(|digest| self.reasons.get(digest)).cloned().unwrap_or_default()
    }

    /// Jobs wait in vain, or not.
    pub(super) fn wait(&mut self, in_vain: bool) {
        self.ends = in_vain.then(|| self.ends.unwrap_or_else(|| Instant::now() + PATIENCE));
    }

    /// When jobs that wait in vain are given up, if there are any.
    pub(super) fn ends(&self) -> Option<Instant> {
        self.ends
    }
}
