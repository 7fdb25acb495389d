//! Admission of jobs. Records are written in parallel, outside the lock: a disk syncs many files in little more time than one. A
//! record that is being written is invisible, but counts for the limits of its client, for its scene and for its idempotency key.

use std::io;
use std::sync::{Arc, MutexGuard, PoisonError};

use protocol::api::SubmitSceneHeader;

use crate::Inner;
use crate::job::{ClientName, JobId, Record};
use crate::ledger::Ledger;
use crate::refusal::Refusal;
use crate::store::Upload;
use crate::sync::lock;

/// How a submission relates to earlier ones.
enum Announced {
    /// It repeats the submission of this job.
    Before(JobId),
    /// It is new, with its position among all jobs.
    New(Box<Record>),
}

impl Inner {
    /// Accepts a job, and its scene if that was uploaded. A repeated submission returns the earlier job.
    pub(super) fn accept(self: &Arc<Self>, draft: Record, upload: Option<&Upload>) -> Result<JobId, Refusal> {
        let record = match self.announce(draft, upload.is_some())? {
            Announced::Before(job) => return Ok(job),
            Announced::New(record) => *record,
        };
        let written = self.write(&record, upload);
        let (id, client) = (record.id, record.client.clone());
        let changing = lock(&self.changing);
        if let Err(error) = written {
            lock(&self.ledger).dismiss(id);
            self.arrived.notify_all();
            // With its record, which may be on disk although the sync failed.
            if let Err(error) = self.remove(&record, false) {
                tracing::warn!(job = %id, %error, "what is left of a job that was refused cannot be removed");
            }
            return Err(error.into());
        }
        tracing::info!(job = %id, %client, "taken in");
        let actions = lock(&self.ledger).insert(record);
        self.arrived.notify_all();
        drop(changing);
        self.metrics.submitted();
        self.perform(actions);
        Ok(id)
    }

    /// Checks the limits, and gives a job its position.
    fn announce(&self, draft: Record, has_upload: bool) -> Result<Announced, Refusal> {
        let changing = lock(&self.changing);
        let _changing = self.wait_for_key(changing, &draft);
        let mut ledger = lock(&self.ledger);
        if let Some(job) = self.known(&ledger, &draft.client, &draft.header)? {
            return Ok(Announced::Before(job));
        }
        if self.ending.is_cancelled() {
            return Err(Refusal::Ending);
        }
        let unfinished = ledger.unfinished(&draft.client);
        if unfinished >= self.limits.jobs_of_a_client {
            let description = format!(
                "{unfinished} jobs of this client have not ended, and it may have no more: wait for some, or cancel them"
            );
            return Err(Refusal::exhausted(format!("client:{}", draft.client), description));
        }
        if let Some(relit) = &draft.relit
            && !ledger.uses_light(relit.baked, draft.id)
        {
            // Deleted since it was looked up.
            return Err(Refusal::NoLight(relit.baked));
        }
        if !has_upload && !ledger.has_scene(&draft.client, draft.scene) {
            return Err(Refusal::SceneMissing(draft.scene));
        }
        Ok(Announced::New(Box::new(ledger.announce(draft))))
    }

    /// Waits while a record with the same key is being written: its outcome is this submission's answer too.
    fn wait_for_key<'a>(&self, changing: MutexGuard<'a, ()>, draft: &Record) -> MutexGuard<'a, ()> {
        let is_arriving = |_: &mut ()| lock(&self.ledger).is_arriving(draft);
        self.arrived.wait_while(changing, is_arriving).unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes a job to disk, its scene first.
    fn write(&self, record: &Record, upload: Option<&Upload>) -> io::Result<()> {
        if let Some(upload) = upload {
            self.store.finish_upload(upload)?;
        }
        self.store.write(record)
    }

    /// Returns the job that was submitted with the same key.
    pub(super) fn known(
        &self,
        ledger: &Ledger,
        client: &ClientName,
        header: &SubmitSceneHeader,
    ) -> Result<Option<JobId>, Refusal> {
        match ledger.by_key(client, &header.idempotency_key) {
            None => Ok(None),
            Some(entry) if entry.record.header == *header => Ok(Some(entry.record.id)),
            Some(entry) => Err(Refusal::KeyTaken(entry.record.id)),
        }
    }
}
