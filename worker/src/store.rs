//! The replicas that a worker holds.

use std::collections::HashMap;
use std::sync::Arc;

use bytes::Bytes;
use kernel::picture::decode_picture;
use kernel::replica::{Digest, ReplicaError, decode_receivers, decode_scene};
use protocol::worker::{ReplicaHeader, ReplicaKind};

use crate::engine::{ReceiverSet, Scene};
use kernel::picture::tracer::Picture;

/// A replica made ready for jobs. A clone is another handle to the same one.
#[derive(Clone)]
pub enum Replica {
    /// The occluders, in their BVH.
    Scene(Arc<Scene>),
    /// Points at which irradiance is wanted.
    Receivers(Arc<ReceiverSet>),
    /// A lit scene, in its BVH.
    Picture(Arc<Picture>),
}

impl Replica {
    /// Decodes a replica and builds what jobs need of it: for a scene or a picture the BVH, for
    /// receivers their groups. This is the expensive step; it happens
    /// once for each upload.
    ///
    /// # Errors
    /// When the bytes are not a replica of this kind.
    pub fn decode(kind: ReplicaKind, bytes: &[u8]) -> Result<Self, ReplicaError> {
        match kind {
            ReplicaKind::Scene => Ok(Self::Scene(Arc::new(decode_scene(bytes)?.into()))),
            ReplicaKind::Receivers => {
                Ok(Self::Receivers(Arc::new(ReceiverSet::new(decode_receivers(bytes)?))))
            }
            ReplicaKind::Picture => Ok(Self::Picture(Arc::new(Picture::new(decode_picture(bytes)?)))),
            ReplicaKind::Unspecified => Err(ReplicaError::Inconsistent("the kind of the replica is missing")),
        }
    }
}

/// A replica as it came, to be passed on. A clone is another handle to the same bytes.
#[derive(Debug, Clone, PartialEq)]
pub struct Parcel {
    /// Describes it.
    pub header: ReplicaHeader,
    /// The bytes that follow the header.
    pub bytes: Bytes,
}

/// Replicas by digest, bounded by their encoded size: the least recently used ones make room for new ones.
///
/// Jobs under way keep handles to what they use, so a replica may be dropped here at any time.
pub struct ReplicaStore {
    capacity: u64,
    held: u64,
    uses: u64,
    entries: HashMap<Digest, Entry>,
}

struct Entry {
    replica: Replica,
    bytes: u64,
    parcel: Option<Parcel>,
    /// Value of [`ReplicaStore::uses`] when it was last asked for.
    last_use: u64,
}

impl ReplicaStore {
    /// An empty store with a capacity in bytes of encoded replicas. Decoded they take up to about four times as much, and to be passed on
    /// no more than once again.
    #[must_use]
    pub fn new(capacity: u64) -> Self {
        Self { capacity, held: 0, uses: 0, entries: HashMap::new() }
    }

    /// Largest replica that the store takes, in encoded bytes. A quarter of its capacity: the two replicas of a job fit
    /// beside those of another coordinator.
    #[must_use]
    pub fn largest(&self) -> u64 {
        self.capacity / 4
    }

    /// Number of replicas held.
    #[must_use]
    pub fn count(&self) -> usize {
        self.entries.len()
    }

    /// Their encoded size in bytes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.held
    }

    /// The replica of this digest, which counts as a use; `None` where it was never loaded, or dropped since.
    pub fn get(&mut self, digest: Digest) -> Option<Replica> {
        self.uses += 1;
        let entry = self.entries.get_mut(&digest)?;
        entry.last_use = self.uses;
        Some(entry.replica.clone())
    }

    /// Keeps a replica, given its encoded size in bytes, and drops the least recently used others until all fit. A replica
    /// that is held already stays.
    pub fn insert(&mut self, digest: Digest, replica: Replica, bytes: u64) {
        if self.get(digest).is_some() {
            return;
        }
        while self.held + bytes > self.capacity {
            let Some(oldest) =
                self.entries.iter().min_by_key(|(_, entry)| entry.last_use).map(|(digest, _)| *digest)
            else {
                break;
            };
            tracing::info!(replica = %oldest, "dropping the least recently used replica");
            self.remove(oldest);
        }
        self.held += bytes;
        self.entries.insert(digest, Entry { replica, bytes, parcel: None, last_use: self.uses });
    }

    /// Keeps a replica that is held as it came, too.
    pub fn keep_parcel(&mut self, digest: Digest, parcel: Parcel) {
        if let Some(entry) = self.entries.get_mut(&digest) {
            entry.parcel = Some(parcel);
        }
    }

    /// A replica as it came; `None` where it is not held.
    #[must_use]
    pub fn parcel(&self, digest: Digest) -> Option<Parcel> {
        self.entries.get(&digest).and_then(|entry| entry.parcel.clone())
    }

    /// Forgets a replica.
    pub fn remove(&mut self, digest: Digest) {
        if let Some(entry) = self.entries.remove(&digest) {
            self.held -= entry.bytes;
        }
    }
}

#[cfg(test)]
mod tests {
    use kernel::replica::{Receivers, encode_receivers};

    use super::*;

    fn replica(first_key: u64) -> (Digest, Replica) {
        let encoded = encode_receivers(&Receivers { first_key, receivers: vec![] });
        (encoded.digest, Replica::decode(encoded.kind, &encoded.bytes).unwrap())
    }

    #[test]
    fn the_least_recently_used_replica_makes_room() {
        let mut store = ReplicaStore::new(100);
        let [(a, first), (b, second), (c, third)] = [1, 2, 3].map(replica);
        store.insert(a, first, 40);
        store.insert(b, second, 40);
        assert!(store.get(a).is_some());
        store.insert(c, third, 40);
        assert!(store.get(b).is_none());
        assert!(store.get(a).is_some());
        assert!(store.get(c).is_some());
    }

    #[test]
    fn a_removed_replica_frees_its_bytes() {
        let mut store = ReplicaStore::new(100);
        let [(a, first), (b, second)] = [1, 2].map(replica);
        store.insert(a, first.clone(), 60);
        store.insert(a, first, 60);
        store.remove(a);
        store.remove(a);
        assert_eq!(store.held, 0);
        store.insert(b, second, 100);
        assert!(store.get(b).is_some());
    }

    #[test]
    fn bytes_of_the_other_kind_are_refused() {
        let encoded = encode_receivers(&Receivers {
            first_key: 1,
            receivers: vec![kernel::replica::Receiver {
                position: glam::DVec3::ZERO,
                normal: glam::DVec3::Y,
                plane: kernel::geometry::PlaneId(0),
            }],
        });
        assert!(Replica::decode(ReplicaKind::Scene, &encoded.bytes).is_err());
        assert!(Replica::decode(ReplicaKind::Unspecified, &encoded.bytes).is_err());
    }
}
