//! Jobs on their way to the disk: nobody sees them, and they count already. Pure.

use std::collections::BTreeMap;

use crate::job::{JobId, Record, Sequence};

/// Jobs whose record is being written.
#[derive(Debug, Default)]
pub struct Arriving {
    records: BTreeMap<JobId, Record>,
}

impl Arriving {
    /// One more, which gets a place after all that arrive and after `last`.
    pub fn announce(&mut self, record: Record, last: Sequence) -> Record {
        let last = self.records.values().map(|record| record.sequence).fold(last, Ord::max);
        let record = Record { sequence: Sequence(last.0 + 1), ..record };
        self.records.insert(record.id, record.clone());
        record
    }

    /// One less: it is there, or will not be.
    pub fn dismiss(&mut self, job: JobId) {
        self.records.remove(&job);
    }

    /// Whether one has the client and the key of this draft.
    #[must_use]
    pub fn has_key_of(&self, draft: &Record) -> bool {
        let key = &draft.header.idempotency_key;
        let is_same = |other: &Record| other.client == draft.client && other.header.idempotency_key == *key;
        !key.is_empty() && self.records.values().any(is_same)
    }

    /// All of them.
    pub fn all(&self) -> impl Iterator<Item = &Record> {
        self.records.values()
    }
}
