use prost::Message;
use protocol::api::{Job, ListJobsRequest, ListJobsResponse, MAX_MESSAGE_BYTES, State};
use tokio::sync::watch;

use super::{Entry, Ledger};
use crate::job::{ClientName, Record, Sequence};
use crate::refusal::Refusal;

/// Jobs per page: default and most.
const PAGE: (usize, usize) = (100, 1000);

/// Bytes after which a page ends, so that it fits into a message.
const PAGE_BYTES: usize = MAX_MESSAGE_BYTES / 4;

impl Ledger {
    /// Returns a client's view of its job.
    ///
    /// # Errors
    /// When it is not the client's.
    pub fn view(&mut self, client: &ClientName, id: &str) -> Result<Job, Refusal> {
        let job = self.of_client(client, id)?.record.id;
        self.count_ahead();
        // It exists: it was found above.
        self.entry(job).map(|entry| self.show(entry)).ok_or_else(|| Refusal::UnknownJob(id.into()))
    }

    fn count_ahead(&mut self) {
        let order = || self.queue.order().into_iter().zip(0..).collect();
        self.ahead.get_or_insert_with(order);
    }

    fn show(&self, entry: &Entry) -> Job {
        let mut job = entry.record.view();
        if entry.record.state == State::Queued {
            let ahead = self.ahead.as_ref().and_then(|ahead| ahead.get(&entry.record.id));
            job.ahead = ahead.copied().unwrap_or_default();
            job.revision += self.queue_changes;
        }
        if let Some(live) = &entry.live
            && entry.record.state == State::Running
        {
            let (progress, changes) = live.progress();
            job.progress = Some(progress);
            job.revision += changes;
        }
        job
    }

    /// Returns a page of a client's jobs, newest first.
    ///
    /// # Errors
    /// When the page token is invalid.
    pub fn list(
        &mut self,
        client: &ClientName,
        request: &ListJobsRequest,
    ) -> Result<ListJobsResponse, Refusal> {
        let before = match request.page_token.as_str() {
            "" => Sequence(u64::MAX),
            token => Sequence(token.parse().map_err(|_| {
                Refusal::invalid("page_token", "must be one of an earlier answer, as it was")
            })?),
        };
        self.count_ahead();
        let size = match request.page_size as usize {
            0 => PAGE.0,
            size => size.min(PAGE.1),
        };
        let wanted = |record: &Record| {
            record.client == *client
                && (request.states.is_empty() || request.states.contains(&record.state.into()))
        };
        let jobs = self.by_sequence.range(..before).rev();
        let entries = jobs.filter_map(|(_, job)| self.entries.get(job)).filter(|entry| wanted(&entry.record));
        let (mut jobs, mut bytes, mut next_page_token) = (vec![], 0, String::new());
        let mut last = Sequence::default();
        for entry in entries {
            if jobs.len() >= size || bytes > PAGE_BYTES {
                next_page_token = last.0.to_string();
                break;
            }
            let mut job = self.show(entry);
            if let Some(outcome) = &mut job.outcome {
                outcome.report_json.clear();
                outcome.lights.clear();
            }
            bytes += job.encoded_len();
            last = entry.record.sequence;
            jobs.push(job);
        }
        Ok(ListJobsResponse { jobs, next_page_token })
    }

    /// Subscribes to changes of a client's job, and of the queue.
    ///
    /// # Errors
    /// When it is not the client's.
    pub fn news(
        &self,
        client: &ClientName,
        id: &str,
    ) -> Result<(watch::Receiver<()>, watch::Receiver<()>), Refusal> {
        let entry = self.of_client(client, id)?;
        Ok((entry.changed.subscribe(), self.queue_changed.subscribe()))
    }
}
