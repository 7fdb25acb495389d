//! State that the handles of a cluster share.
//!
//! [`Turns`] says whose job goes next. Workers are given only as many jobs as keep all threads busy: what they have cannot be
//! overtaken any more, and is what a new handle waits for.

use std::collections::{BTreeMap, HashMap};
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use bake::ThreadTime;
use kernel::replica::{Digest, EncodedReplica};
use kernel::row::JobId;
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender};

use super::error::ClusterError;
use super::message::Message;
use super::reactor::{self, Connected};
use super::recent::RecentRate;
use super::request::Request;
use super::summary::{FinishedWork, WorkerPart};
use crate::scheduler::{HandleId, Turns};

/// A handle of this much more priority gets twice as much.
const DOUBLING: f64 = 20.0;

/// Highest priority; the lowest is its negative.
const MOST_PRIORITY: i32 = 100;

/// Jobs that a handle asks for per thread: those that a worker holds, and one that waits here.
const JOBS_AHEAD_PER_THREAD: usize = 4;

/// The answer to a job of a handle, or why there is none.
pub(super) type Outcome = Result<FinishedWork, ClusterError>;

/// The state, and the way to the reactor.
pub(super) struct Hub {
    state: Mutex<State>,
    messages: UnboundedSender<Message>,
    connected: Arc<Connected>,
    started: Instant,
}

#[derive(Default)]
struct State {
    turns: Turns,
    handles: HashMap<HandleId, Known>,
    /// All jobs without an answer, by the ids that workers know them by.
    jobs: HashMap<JobId, PendingJob>,
    /// How often each handle has published each replica.
    replicas: BTreeMap<(Digest, HandleId), usize>,
    /// Why no job can be computed, if so.
    lost: Option<ClusterError>,
    next_handle: u64,
    next_job: u64,
    recent: RecentRate,
}

/// State of a handle.
struct Known {
    results: mpsc::Sender<Outcome>,
    /// Work of each worker for it, in the order of their first answers.
    workers: Vec<WorkerPart>,
}

/// A job without an answer.
struct PendingJob {
    handle: HandleId,
    /// The id that its handle knows it by.
    job: JobId,
    /// Replicas that it needs.
    needs: Vec<Digest>,
    /// While no worker has it.
    request: Option<Request>,
}

impl Hub {
    pub(super) fn new(messages: UnboundedSender<Message>, connected: Arc<Connected>) -> Self {
        Self { state: Mutex::default(), messages, connected, started: Instant::now() }
    }

    /// Hands results to their handles as long as there are any.
    pub(super) async fn hand_over(self: Arc<Self>, mut results: UnboundedReceiver<reactor::Result>) {
        while let Some(result) = results.recv().await {
            self.take(result);
        }
        self.stop();
    }

    /// The first worker is there, or will not come.
    pub(super) fn ready(&self, result: Result<(), ClusterError>) {
        let mut state = self.lock();
        match result {
            Ok(()) => self.feed(&mut state),
            Err(error) => state.fail(&error),
        }
    }

    /// Tells all handles that wait for an answer that none will come.
    pub(super) fn stop(&self) {
        self.lock().fail(&ClusterError::Stopped);
    }

    pub(super) fn tell(&self, message: Message) {
        // Where the reactor is gone, all handles are told.
        let _ = self.messages.send(message);
    }

    /// Workers that are connected, and how many jobs they compute at the same time.
    pub(super) fn connected(&self) -> [usize; 2] {
        [self.connected.workers.load(Relaxed), self.connected.threads.load(Relaxed)]
    }

    /// How many jobs keep all threads busy: those that workers hold, and as many per thread again that are asked for.
    pub(super) fn jobs_ahead(&self) -> usize {
        let [_, threads] = self.connected();
        JOBS_AHEAD_PER_THREAD * threads + self.connected.ahead.load(Relaxed)
    }

    /// What the threads of the workers did so far.
    pub(super) fn thread_time(&self) -> ThreadTime {
        self.connected.ledger.time()
    }

    /// Rays cast per second lately.
    pub(super) fn rays_per_second(&self) -> f64 {
        self.lock().recent.per_second(self.started.elapsed())
    }

    /// A handle joins. Its answers go to `results`.
    pub(super) fn join(&self, priority: i32, results: mpsc::Sender<Outcome>) -> HandleId {
        let mut state = self.lock();
        let id = HandleId(state.next_handle);
        state.next_handle += 1;
        let priority = priority.clamp(-MOST_PRIORITY, MOST_PRIORITY);
        state.turns.join(id, (f64::from(priority) / DOUBLING).exp2());
        state.handles.insert(id, Known { results, workers: vec![] });
        id
    }

    /// A handle leaves, with its jobs and replicas.
    pub(super) fn leave(&self, handle: HandleId) {
        let mut state = self.lock();
        self.end_jobs(&mut state, handle);
        state.turns.leave(handle);
        state.handles.remove(&handle);
        let own: Vec<_> = state.replicas.keys().copied().filter(|(_, of)| *of == handle).collect();
        for key in own {
            state.replicas.remove(&key);
            self.forget_unneeded(&state, key.0);
        }
        self.feed(&mut state);
    }

    /// Work of each worker for a handle.
    pub(super) fn workers(&self, handle: HandleId) -> Vec<WorkerPart> {
        self.lock().handles.get(&handle).map(|known| known.workers.clone()).unwrap_or_default()
    }

    pub(super) fn publish(&self, handle: HandleId, replica: EncodedReplica) {
        let mut state = self.lock();
        let is_new = !state.is_needed(replica.digest);
        *state.replicas.entry((replica.digest, handle)).or_default() += 1;
        if is_new {
            self.tell(Message::Publish(replica));
        }
    }

    pub(super) fn release(&self, handle: HandleId, digest: Digest) {
        let mut state = self.lock();
        let Some(times) = state.replicas.get_mut(&(digest, handle)) else { return };
        *times -= 1;
        if *times == 0 {
            state.replicas.remove(&(digest, handle));
            self.forget_unneeded(&state, digest);
        }
    }

    pub(super) fn submit(&self, handle: HandleId, requests: impl Iterator<Item = (JobId, Request)>) {
        let mut state = self.lock();
        if self.connected.workers.load(Relaxed) > 0 && state.lost != Some(ClusterError::Stopped) {
            state.lost = None;
        }
        if let Some(error) = &state.lost {
            state.send(handle, Err(error.clone()));
        }
        for (job, request) in requests {
            let id = JobId(state.next_job);
            state.next_job += 1;
            let needs = request.needs();
            state.jobs.insert(id, PendingJob { handle, job, needs, request: Some(request) });
            state.turns.submit(handle, id);
        }
        self.feed(&mut state);
    }

    pub(super) fn withdraw(&self, handle: HandleId) {
        let mut state = self.lock();
        self.end_jobs(&mut state, handle);
        self.feed(&mut state);
    }

    fn end_jobs(&self, state: &mut State, handle: HandleId) {
        let sent = state.turns.withdraw(handle);
        state.jobs.retain(|_, pending| pending.handle != handle);
        if !sent.is_empty() {
            self.tell(Message::Withdraw(sent));
        }
    }

    fn forget_unneeded(&self, state: &State, digest: Digest) {
        if !state.is_needed(digest) {
            self.tell(Message::Release(digest));
        }
    }

    /// Gives workers as many jobs as keep them busy.
    fn feed(&self, state: &mut State) {
        let [threads, ahead] =
            [&self.connected.threads, &self.connected.ahead].map(|count| count.load(Relaxed));
        while let Some(id) = state.turns.next(threads, ahead) {
            if let Some(request) = state.jobs.get_mut(&id).and_then(|pending| pending.request.take()) {
                self.tell(Message::Submit(vec![(id, request)]));
            }
        }
    }

    /// Takes the result of a job.
    fn take(&self, result: reactor::Result) {
        let mut state = self.lock();
        match result {
            Ok(delivery) => {
                state.lost = None;
                state.recent.add(self.started.elapsed(), delivery.work.rays());
                let id = delivery.work.job();
                // No handle waits for a withdrawn job.
                if let Some(PendingJob { handle, job, .. }) = state.jobs.remove(&id) {
                    state.turns.answered(handle, id, delivery.work.busy().as_nanos() as f64);
                    if let Some(known) = state.handles.get_mut(&handle) {
                        delivery.add_to(&mut known.workers);
                    }
                    state.send(handle, Ok(delivery.work.named(job)));
                }
            }
            Err(ClusterError::Abandoned { job: id, why, message }) => {
                if let Some(PendingJob { handle, job, .. }) = state.jobs.remove(&id) {
                    state.turns.answered(handle, id, 0.0);
                    state.send(handle, Err(ClusterError::Abandoned { job, why, message }));
                }
            }
            Err(error @ ClusterError::NotPublished(digest)) => {
                let waiting = state.jobs.values().filter(|pending| pending.needs.contains(&digest));
                let mut handles: Vec<HandleId> = waiting.map(|pending| pending.handle).collect();
                handles.sort_unstable();
                handles.dedup();
                handles.into_iter().for_each(|handle| state.send(handle, Err(error.clone())));
            }
            Err(error) => state.fail(&error),
        }
        self.feed(&mut state);
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // No code that holds the lock leaves the state half changed.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn send(&self, handle: HandleId, outcome: Outcome) {
        if let Some(known) = self.handles.get(&handle) {
            // It may be about to leave.
            let _ = known.results.send(outcome);
        }
    }

    /// Tells all handles with unanswered jobs that none can be computed.
    fn fail(&mut self, error: &ClusterError) {
        self.lost = Some(error.clone());
        for (handle, known) in &self.handles {
            if self.jobs.values().any(|pending| pending.handle == *handle) {
                let _ = known.results.send(Err(error.clone()));
            }
        }
    }

    /// Whether any handle has published a replica and not released it.
    fn is_needed(&self, digest: Digest) -> bool {
        self.replicas.range((digest, HandleId(0))..).next().is_some_and(|((first, _), _)| *first == digest)
    }
}
