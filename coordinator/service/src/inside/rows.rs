//! Rows for a job in a process of its own: the service has them computed.

use std::collections::HashMap;
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use bake::{BakeError, RowService, ThreadTime};
use cluster::WorkerPart;
use kernel::messages::Finished;
use kernel::replica::{Digest, EncodedReplica};
use kernel::row::{FinishedJob, JobId, RowRequest, decode_row};
use pipeline::run::SharedRows;

use super::world::World;
use crate::pipes::Outlet;
use crate::pipes::messages::{NoRows, Order, Replica, Submit, Word};

/// No more rows, in the words of the service.
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
pub struct RowsError {
    /// The same job would fail again.
    pub is_final: bool,
    message: String,
}

/// A row service at the other end of a pipe.
pub struct PipeRows<W: Write> {
    outlet: Arc<Outlet<W>>,
    answers: Receiver<Order>,
    world: Arc<World>,
    /// Jobs without an answer, and their receivers.
    under_way: HashMap<JobId, usize>,
}

impl<W: Write> PipeRows<W> {
    /// Asks at `outlet`, and is answered by the orders that are about rows.
    pub fn new(outlet: Arc<Outlet<W>>, answers: Receiver<Order>, world: Arc<World>) -> Self {
        Self { outlet, answers, world, under_way: HashMap::new() }
    }

    fn error(&self, message: impl ToString) -> BakeError {
        BakeError::Rows(Box::new(RowsError { is_final: false, message: message.to_string() }))
    }

    /// Decodes an answer; `None` where nobody waits for it any more.
    fn take(&mut self, finished: &Finished) -> Result<Option<FinishedJob>, BakeError> {
        let job = JobId(finished.job_id);
        let Some(receivers) = self.under_way.remove(&job) else { return Ok(None) };
        let rows: Result<_, _> = finished.rows.iter().map(|row| decode_row(row, receivers)).collect();
        let rows = rows.map_err(|error| self.error(error))?;
        Ok(Some(FinishedJob { job, rows, statistics: finished.statistics.clone() }))
    }
}

impl<W: Write> RowService for PipeRows<W> {
    fn publish(&mut self, EncodedReplica { digest, kind, bytes }: EncodedReplica) {
        self.outlet.say(Word::Publish(Replica { digest: digest.to_bytes(), kind: kind.into(), bytes }));
    }

    fn release(&mut self, digest: Digest) {
        self.outlet.say(Word::Release(digest.to_bytes()));
    }

    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>) {
        let receivers = requests.iter().map(|(job, request)| (*job, request.receiver_count as usize));
        self.under_way.extend(receivers);
        let jobs = requests.iter().map(|(job, request)| request.to_job(job.0)).collect();
        self.outlet.say(Word::Submit(Submit { jobs }));
    }

    fn withdraw(&mut self) {
        self.under_way.clear();
        self.outlet.say(Word::Withdraw(true));
    }

    fn threads(&self) -> usize {
        self.world.threads.load(Relaxed)
    }

    fn jobs_ahead(&self) -> usize {
        self.world.jobs_ahead.load(Relaxed)
    }

    fn thread_time(&self) -> ThreadTime {
        self.world.thread_time()
    }

    fn next(&mut self, patience: Duration) -> Result<Option<FinishedJob>, BakeError> {
        match self.answers.recv_timeout(patience) {
            Ok(Order::Rows(finished)) => self.take(&finished),
            Ok(Order::NoRows(NoRows { is_final, message })) => {
                Err(BakeError::Rows(Box::new(RowsError { is_final, message })))
            }
            Ok(_) | Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(self.error("the service is gone")),
        }
    }
}

impl<W: Write> SharedRows for PipeRows<W> {
    fn workers(&self) -> Vec<WorkerPart> {
        self.outlet.say(Word::AskWorkers(true));
        // Answers to withdrawn jobs may come before.
        let answer = self.answers.iter().find_map(|order| match order {
            Order::Workers(workers) => Some(workers),
            _ => None,
        });
        answer.into_iter().flat_map(|workers| workers.parts).map(WorkerPart::from).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use super::*;
    use crate::pipes::messages::Surroundings;

    #[test]
    fn what_the_service_tells_of_the_workers_is_known_to_the_bake() {
        let world = Arc::new(World::default());
        let (_orders, answers) = mpsc::channel();
        let rows = PipeRows::new(Arc::new(Outlet::new(vec![])), answers, Arc::clone(&world));
        let [connected, occupied, loading, busy] = [400, 300, 50, 200].map(Duration::from_millis);
        let time = ThreadTime { connected, occupied, loading, busy };
        // Twenty of them because workers are far away.
        world.set(Surroundings { threads: 2, is_watched: false, jobs_ahead: 28, time: time.into() });
        assert_eq!((rows.threads(), rows.jobs_ahead(), rows.thread_time()), (2, 28, time));
    }
}
