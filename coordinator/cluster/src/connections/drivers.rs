//! One set of workers for several drivers at a time, each in a thread of its own.
//!
//! Drivers hand their jobs to [`super::sharing`], which says whose goes next. Workers are given no more of them than keeps all
//! threads busy: what they have cannot be overtaken any more, and is what a new driver waits for.
//!
//! Without any worker the jobs wait, for [`ClusterSettings::grace`] at most: then every driver that waits for an answer gets the
//! error, and so does whoever asks later, until a worker is there again. A service that has workers elsewhere waits on
//! ([`ClusterSettings::ENDLESS_GRACE`]): they come back, and its bakes go on where they were. Where no worker can be of any use,
//! because all are of another release, there is nothing to wait for, and the error comes at once.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use kernel::replica::{Digest, EncodedReplica};
use kernel::row::RowRequest;
use tokio::runtime::Runtime;
use tokio::sync::{mpsc as asynchronous, oneshot};
use tokio_util::sync::DropGuard;

use super::asynchronous::{Connected, Started};
use super::message::Message;
use super::recent::RecentRate;
use super::request::Request;
use super::sharing::{DriverId, Sharing};
use super::summary::{Delivery, FinishedWork, WorkerPart};
use super::{
    ClusterError, ClusterSettings, FinishedJob, GOODBYE_TIMEOUT, JobId, NETWORK_THREADS, network, reactor,
};
use bake::{BakeError, RowService};

/// Jobs that workers have for each of their threads: one that is computed, one that waits there, one on its way.
const JOBS_PER_THREAD: usize = 3;

/// And so many in addition, so that whoever comes first finds some.
const JOBS_AHEAD: usize = 2;

/// A driver of so much more priority gets twice as much.
const DOUBLING: f64 = 20.0;

/// Highest priority; the lowest is its negative.
const MOST_PRIORITY: i32 = 100;

/// All workers of a service, for several drivers at a time. To be dropped outlives its drivers: what they still ask for is then
/// answered with an error.
pub struct SharedCluster {
    hub: Arc<Hub>,
    /// Until it is dropped, with what ends the embedded worker and all dialling.
    runtime: Option<(Runtime, DropGuard)>,
}

/// What workers do now.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ClusterStatus {
    /// Workers that are connected.
    pub workers: usize,
    /// Jobs that they compute at the same time.
    pub threads: usize,
    /// Rays cast for a second lately, for all drivers.
    pub rays_per_second: f64,
}

/// One of those who share the workers: a [`RowService`] with jobs and replicas of its own, which are forgotten when it is dropped.
pub struct Driver {
    id: DriverId,
    hub: Arc<Hub>,
    results: mpsc::Receiver<Outcome>,
}

type Outcome = Result<FinishedJob, ClusterError>;

/// What drivers and workers have in common.
struct Hub {
    state: Mutex<State>,
    messages: asynchronous::UnboundedSender<Message>,
    connected: Arc<Connected>,
    started: Instant,
}

#[derive(Default)]
struct State {
    sharing: Sharing,
    drivers: HashMap<DriverId, Known>,
    /// All jobs without an answer, by the names that workers know them by.
    jobs: HashMap<JobId, Asked>,
    /// Replicas that are published, and for how many drivers.
    replicas: HashMap<Digest, usize>,
    /// Why no rows can be had, where that is so.
    lost: Option<ClusterError>,
    next_driver: u64,
    next_job: u64,
    recent: RecentRate,
}

/// What is known of a driver.
struct Known {
    results: mpsc::Sender<Outcome>,
    /// What it has published, and how often.
    replicas: HashMap<Digest, usize>,
    /// Who computed for it, in the order of their first answers.
    workers: Vec<WorkerPart>,
}

/// A job without an answer.
struct Asked {
    driver: DriverId,
    /// What its driver calls it.
    job: JobId,
    /// Replicas that it needs.
    needs: Vec<Digest>,
    /// While no worker has it.
    request: Option<RowRequest>,
}

impl SharedCluster {
    /// Dials all workers, or starts one. Waits for none of them: jobs do.
    ///
    /// # Errors
    /// When an address makes no sense, or this process cannot start its threads.
    pub fn start(settings: &ClusterSettings) -> Result<Self, ClusterError> {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(NETWORK_THREADS)
            .thread_name("network")
            .enable_all()
            .build()
            .map_err(|error| ClusterError::Start(error.to_string()))?;
        let started = {
            let _within = runtime.enter();
            Started::new(settings, Arc::new(network::Sockets), ())
        };
        let Started { messages, results, connected, is_ready, leaving } = match started {
            Ok(started) => started,
            Err(error) => {
                runtime.shutdown_background();
                return Err(error);
            }
        };
        let hub = Arc::new(Hub { state: Mutex::default(), messages, connected, started: Instant::now() });
        runtime.spawn(hand_over(Arc::clone(&hub), results, is_ready));
        Ok(Self { hub, runtime: Some((runtime, leaving)) })
    }

    /// One more driver. Where all are busy, one whose `priority` is higher by 20 has twice as much computed; from -100 to 100.
    #[must_use]
    pub fn driver(&self, priority: i32) -> Driver {
        let mut state = self.hub.lock();
        let id = DriverId(state.next_driver);
        state.next_driver += 1;
        let priority = priority.clamp(-MOST_PRIORITY, MOST_PRIORITY);
        state.sharing.join(id, (f64::from(priority) / DOUBLING).exp2());
        let (sender, results) = mpsc::channel();
        state.drivers.insert(id, Known { results: sender, replicas: HashMap::new(), workers: vec![] });
        Driver { id, hub: Arc::clone(&self.hub), results }
    }

    /// What the workers do now.
    #[must_use]
    pub fn status(&self) -> ClusterStatus {
        let now = self.hub.started.elapsed();
        ClusterStatus {
            workers: self.hub.connected.workers.load(Relaxed),
            threads: self.hub.connected.threads.load(Relaxed),
            rays_per_second: self.hub.lock().recent.per_second(now),
        }
    }
}

impl Drop for SharedCluster {
    /// Says goodbye to all workers, and leaves within about a second.
    fn drop(&mut self) {
        let Some((runtime, leaving)) = self.runtime.take() else { return };
        let (done, all_gone) = oneshot::channel::<()>();
        self.hub.tell(Message::Shutdown(done));
        // In a thread of its own: whoever drops it may be a task of another runtime, where nothing may wait.
        let waiting = std::thread::spawn(move || {
            // Those that do not answer in time are left.
            let _ = runtime.block_on(async { tokio::time::timeout(GOODBYE_TIMEOUT, all_gone).await });
            runtime.shutdown_background();
            drop(leaving);
        });
        let _ = waiting.join();
        self.hub.lock().fail(&ClusterError::Stopped);
    }
}

/// Hands results to the drivers that they are for, as long as there are any.
async fn hand_over(
    hub: Arc<Hub>,
    mut results: asynchronous::UnboundedReceiver<reactor::Result>,
    is_ready: oneshot::Receiver<Result<(), ClusterError>>,
) {
    let told = Arc::clone(&hub);
    let first = async move {
        // Where the reactor is gone, the results say so.
        match is_ready.await {
            Ok(Err(error)) => told.lock().fail(&error),
            Ok(Ok(())) => told.feed(&mut told.lock()),
            Err(_) => {}
        }
    };
    tokio::join!(first, async {
        while let Some(result) = results.recv().await {
            hub.take(result);
        }
        hub.lock().fail(&ClusterError::Stopped);
    });
}

impl Hub {
    fn lock(&self) -> MutexGuard<'_, State> {
        // Whoever holds it leaves it whole.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn tell(&self, message: Message) {
        // Where the reactor is gone, all drivers are told.
        let _ = self.messages.send(message);
    }

    /// Gives workers as many jobs as keep them busy.
    fn feed(&self, state: &mut State) {
        let most = JOBS_PER_THREAD * self.connected.threads.load(Relaxed) + JOBS_AHEAD;
        while state.sharing.under_way() < most
            && let Some(id) = state.sharing.next()
        {
            if let Some(request) = state.jobs.get_mut(&id).and_then(|asked| asked.request.take()) {
                self.tell(Message::Submit(vec![(id, Request::Rows(request))]));
            }
        }
    }

    /// Takes what came of a job.
    fn take(&self, result: reactor::Result) {
        let mut state = self.lock();
        let result = result.map(|delivery| {
            state.count(&delivery);
            delivery.work
        });
        match result {
            Ok(FinishedWork::Rows(finished)) => {
                state.lost = None;
                let rays: u64 = finished.statistics.iter().map(|row| row.rays).sum();
                state.recent.add(self.started.elapsed(), rays);
                let busy: u64 = finished.statistics.iter().map(|row| row.busy_nanoseconds).sum();
                // Nobody waits for what was withdrawn.
                if let Some(Asked { driver, job, .. }) = state.jobs.remove(&finished.job) {
                    state.sharing.answered(driver, finished.job, busy as f64);
                    state.send(driver, Ok(FinishedJob { job, ..finished }));
                }
            }
            // No driver asks for tiles.
            Ok(FinishedWork::Tile(_)) => {}
            Err(ClusterError::Abandoned { job: id, why, message }) => {
                if let Some(Asked { driver, job, .. }) = state.jobs.remove(&id) {
                    state.sharing.answered(driver, id, 0.0);
                    state.send(driver, Err(ClusterError::Abandoned { job, why, message }));
                }
            }
            Err(error @ ClusterError::NotPublished(digest)) => {
                let waiting = state.jobs.values().filter(|asked| asked.needs.contains(&digest));
                let mut drivers: Vec<DriverId> = waiting.map(|asked| asked.driver).collect();
                drivers.sort_unstable();
                drivers.dedup();
                drivers.into_iter().for_each(|driver| state.send(driver, Err(error.clone())));
            }
            Err(error) => state.fail(&error),
        }
        self.feed(&mut state);
    }

    fn withdraw(&self, state: &mut State, driver: DriverId) {
        let sent = state.sharing.withdraw(driver);
        state.jobs.retain(|_, asked| asked.driver != driver);
        if !sent.is_empty() {
            self.tell(Message::Withdraw(sent));
        }
    }
}

impl State {
    /// Puts work on the account of the driver that it was done for.
    fn count(&mut self, delivery: &Delivery) {
        let asked = self.jobs.get(&delivery.work.job());
        if let Some(known) = asked.and_then(|asked| self.drivers.get_mut(&asked.driver)) {
            delivery.add_to(&mut known.workers);
        }
    }

    fn send(&self, driver: DriverId, outcome: Outcome) {
        if let Some(known) = self.drivers.get(&driver) {
            // It may be about to leave.
            let _ = known.results.send(outcome);
        }
    }

    /// No rows can be had: all who wait for some are told.
    fn fail(&mut self, error: &ClusterError) {
        self.lost = Some(error.clone());
        for (driver, known) in &self.drivers {
            if self.jobs.values().any(|asked| asked.driver == *driver) {
                let _ = known.results.send(Err(error.clone()));
            }
        }
    }

    /// One driver fewer needs a replica; whether none does now.
    fn release(&mut self, digest: Digest) -> bool {
        let Entry::Occupied(mut drivers) = self.replicas.entry(digest) else { return false };
        *drivers.get_mut() -= 1;
        let is_last = *drivers.get() == 0;
        if is_last {
            drivers.remove();
        }
        is_last
    }
}

impl Driver {
    /// What each worker did for this driver, in the order of their first answers.
    #[must_use]
    pub fn workers(&self) -> Vec<WorkerPart> {
        self.hub.lock().drivers.get(&self.id).map(|known| known.workers.clone()).unwrap_or_default()
    }
}

impl RowService for Driver {
    fn publish(&mut self, replica: EncodedReplica) {
        let mut state = self.hub.lock();
        let Some(known) = state.drivers.get_mut(&self.id) else { return };
        let own = known.replicas.entry(replica.digest).or_default();
        *own += 1;
        if *own > 1 {
            return;
        }
        let drivers = state.replicas.entry(replica.digest).or_default();
        *drivers += 1;
        if *drivers == 1 {
            self.hub.tell(Message::Publish(replica));
        }
    }

    fn release(&mut self, digest: Digest) {
        let mut state = self.hub.lock();
        let Some(known) = state.drivers.get_mut(&self.id) else { return };
        let Entry::Occupied(mut own) = known.replicas.entry(digest) else { return };
        *own.get_mut() -= 1;
        if *own.get() == 0 {
            own.remove();
            if state.release(digest) {
                self.hub.tell(Message::Release(digest));
            }
        }
    }

    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>) {
        let mut state = self.hub.lock();
        if self.hub.connected.workers.load(Relaxed) > 0 && state.lost != Some(ClusterError::Stopped) {
            state.lost = None;
        }
        if let Some(error) = &state.lost {
            state.send(self.id, Err(error.clone()));
        }
        for (job, request) in requests {
            let id = JobId(state.next_job);
            state.next_job += 1;
            let pairs = request.shooters.len() as f64 * f64::from(request.receiver_count);
            let needs = vec![request.scene, request.receivers];
            state.jobs.insert(id, Asked { driver: self.id, job, needs, request: Some(request) });
            state.sharing.submit(self.id, id, pairs);
        }
        self.hub.feed(&mut state);
    }

    fn withdraw(&mut self) {
        let mut state = self.hub.lock();
        self.hub.withdraw(&mut state, self.id);
        // Results are sent while the state is held: none follows.
        while self.results.try_recv().is_ok() {}
        self.hub.feed(&mut state);
    }

    fn threads(&self) -> usize {
        self.hub.connected.threads.load(Relaxed).max(1)
    }

    fn next(&mut self, patience: Duration) -> Result<Option<FinishedJob>, BakeError> {
        match self.results.recv_timeout(patience) {
            Ok(Ok(finished)) => Ok(Some(finished)),
            Ok(Err(error)) => Err(BakeError::Rows(Box::new(error))),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(BakeError::Rows(Box::new(ClusterError::Stopped))),
        }
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        let mut state = self.hub.lock();
        self.hub.withdraw(&mut state, self.id);
        state.sharing.leave(self.id);
        let replicas = state.drivers.remove(&self.id).map(|known| known.replicas).unwrap_or_default();
        for digest in replicas.into_keys() {
            if state.release(digest) {
                self.hub.tell(Message::Release(digest));
            }
        }
        self.hub.feed(&mut state);
    }
}
