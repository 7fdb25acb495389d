use std::time::Duration;

use protocol::api::{Job, State};
use tokio::sync::mpsc;
use tokio::time::sleep;
use tokio_stream::wrappers::ReceiverStream;

use crate::Service;
use crate::job::ClientName;
use crate::refusal::Refusal;
use crate::sync::lock;

/// Least time between two states of a job.
const INTERVAL: Duration = Duration::from_millis(200);

impl Service {
    /// Streams the job now and after every change, until it has ended. A slow reader skips states: nothing is queued for it.
    ///
    /// # Errors
    /// When it is not this client's.
    pub fn watch(
        &self,
        client: &ClientName,
        id: &str,
    ) -> Result<ReceiverStream<Result<Job, Refusal>>, Refusal> {
        let (mut job_news, mut queue_news) = lock(&self.inner.ledger).news(client, id)?;
        let (sender, receiver) = mpsc::channel(1);
        let (service, client, id) = (self.clone(), client.clone(), id.to_owned());
        let watching = self.inner.metrics.watching();
        tokio::spawn(async move {
            let _watching = watching;
            let mut told: Option<Job> = None;
            // Looks up the state when the reader is ready for it.
            while let Ok(place) = sender.reserve().await {
                job_news.mark_unchanged();
                queue_news.mark_unchanged();
                let job = match service.get(&client, &id) {
                    Ok(job) => job,
                    Err(gone) => return place.send(Err(gone)),
                };
                let (has_ended, waits) = (has_ended(&job), job.state() == State::Queued);
                if told.as_ref() != Some(&job) {
                    told = Some(job.clone());
                    place.send(Ok(job));
                } else {
                    drop(place);
                }
                if has_ended {
                    return;
                }
                tokio::select! {
                    // Also when deleted: the next lookup fails.
                    _ = job_news.changed() => {}
                    Ok(()) = queue_news.changed(), if waits => {}
                    () = service.inner.ending.cancelled() => {
                        if let Ok(place) = sender.reserve().await {
                            place.send(Err(Refusal::Ending));
                        }
                        return;
                    }
                    () = sender.closed() => return,
                }
                sleep(INTERVAL).await;
            }
        });
        Ok(ReceiverStream::new(receiver))
    }
}

/// Whether a job is done, failed or cancelled.
fn has_ended(job: &Job) -> bool {
    matches!(job.state(), State::Done | State::Failed | State::Cancelled)
}
