//! Jobs whose record is being written: invisible, but counted. Pure.

use std::collections::BTreeMap;

use crate::job::{JobId, Record, Sequence};

/// Jobs whose record is being written.
#[derive(Debug, Default)]
pub struct Arriving {
    records: BTreeMap<JobId, Record>,
}

impl Arriving {
    /// Adds a job, after the other arriving ones and after `last`.
    pub fn announce(&mut self, record: Record, last: Sequence) -> Record {
        let last = self.records.values().map(|record| record.sequence).fold(last, Ord::max);
        let record = Record { sequence: Sequence(last.0 + 1), ..record };
        self.records.insert(record.id, record.clone());
        record
    }

    /// Removes a job: its record is written, or has failed to be.
    pub fn dismiss(&mut self, job: JobId) {
        self.records.remove(&job);
    }

    /// Whether a job has the client and the idempotency key of this draft.
    #[must_use]
    pub fn has_key_of(&self, draft: &Record) -> bool {
        let key = &draft.header.idempotency_key;
        let is_same = |other: &Record| other.client == draft.client && other.header.idempotency_key == *key;
        !key.is_empty() && self.records.values().any(is_same)
    }

    /// Returns all arriving jobs.
    pub fn all(&self) -> impl Iterator<Item = &Record> {
        self.records.values()
    }
}
