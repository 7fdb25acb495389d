//! All workers, from the first dial to the last goodbye.

use std::sync::Arc;
use std::time::Duration;

use bake::ThreadTime;
use tokio::runtime::Runtime;
use tokio::sync::oneshot;
use tokio_util::sync::DropGuard;

use super::error::ClusterError;
use super::handle::Handle;
use super::hub::Hub;
use super::message::Message;
use super::settings::ClusterSettings;
use super::start::Started;
use super::summary::{ClusterCounts, WorkerSummary};
use crate::metrics::Metrics;
use protocol::network::Sockets;

/// Threads that move messages, at least and at most: one per core between. They decode all rows, and two were busy with those of 19
/// workers.
const NETWORK_THREADS: [usize; 2] = [2, 8];

/// How long workers have to answer a goodbye.
const GOODBYE_TIMEOUT: Duration = Duration::from_secs(1);

/// All workers, shared by the handles that it gives out. Handles may outlive it: their jobs are then answered with an error.
pub struct Cluster {
    hub: Arc<Hub>,
    metrics: Metrics,
    /// Until it is dropped, with what ends the embedded worker and all dialling.
    runtime: Option<(Runtime, DropGuard)>,
}

/// Present state of the workers.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ClusterStatus {
    /// Workers that are connected.
    pub workers: usize,
    /// Number of jobs that they compute at the same time.
    pub threads: usize,
    /// Rays cast per second lately, for all handles.
    pub rays_per_second: f64,
}

impl Cluster {
    /// Dials all workers, or starts one, and waits until one has said hello and all others were tried, but for these no longer than
    /// a quarter of a second. Those that could not be reached are tried again later.
    ///
    /// # Errors
    /// When an address is malformed; when no worker was reached within the grace, or none of them can be of use (another release,
    /// not a worker); when this process cannot start its threads.
    pub fn start(settings: &ClusterSettings) -> Result<Self, ClusterError> {
        let (cluster, is_ready) = Self::launch(settings)?;
        is_ready.blocking_recv().map_err(|_| ClusterError::Stopped)??;
        Ok(cluster)
    }

    /// As [`Self::start`], but does not wait for workers: jobs do, for [`ClusterSettings::grace`] at most. Without any worker by then
    /// every handle that waits for an answer gets the error, and so does one that submits later, until a worker is there again.
    ///
    /// # Errors
    /// When an address is malformed, or this process cannot start its threads.
    pub fn start_in_background(settings: &ClusterSettings) -> Result<Self, ClusterError> {
        let (cluster, is_ready) = Self::launch(settings)?;
        if let Some((runtime, _)) = &cluster.runtime {
            let hub = Arc::clone(&cluster.hub);
            runtime.spawn(async move {
                // Where the reactor is gone, the results say so.
                if let Ok(result) = is_ready.await {
                    hub.ready(result);
                }
            });
        }
        Ok(cluster)
    }

    fn launch(settings: &ClusterSettings) -> Result<(Self, Ready), ClusterError> {
        let [least, most] = NETWORK_THREADS;
        let threads =
            std::thread::available_parallelism().map_or(least, |cores| cores.get().clamp(least, most));
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(threads)
            .thread_name("network")
            .enable_all()
            .build()
            .map_err(|error| ClusterError::Start(error.to_string()))?;
        let started = {
            let _within = runtime.enter();
            Started::new(settings, Arc::new(Sockets), ())
        };
        match started {
            Ok(Started { messages, results, connected, is_ready, leaving }) => {
                let hub = Arc::new(Hub::new(messages, connected));
                runtime.spawn(Arc::clone(&hub).hand_over(results));
                let metrics = settings.metrics.clone();
                Ok((Self { hub, metrics, runtime: Some((runtime, leaving)) }, is_ready))
            }
            Err(error) => {
                // The caller may be a task of another runtime, where nothing may wait.
                runtime.shutdown_background();
                Err(error)
            }
        }
    }

    /// Gives out one more handle. Where all workers are busy, a handle whose `priority` is higher by 20 gets twice as much computed;
    /// from -100 to 100.
    #[must_use]
    pub fn handle(&self, priority: i32) -> Handle {
        Handle::new(Arc::clone(&self.hub), priority)
    }

    /// Its metrics, for those of bakes.
    #[must_use]
    pub fn metrics(&self) -> &Metrics {
        &self.metrics
    }

    /// Present state of the workers.
    #[must_use]
    pub fn status(&self) -> ClusterStatus {
        let [workers, threads] = self.hub.connected();
        ClusterStatus { workers, threads, rays_per_second: self.hub.rays_per_second() }
    }

    /// How many jobs keep all threads busy: those computed, those that wait there, and those on their way.
    #[must_use]
    pub fn jobs_ahead(&self) -> usize {
        self.hub.jobs_ahead()
    }

    /// What the threads of the workers did so far.
    #[must_use]
    pub fn thread_time(&self) -> ThreadTime {
        self.hub.thread_time()
    }

    /// Summaries of all workers, lost ones included, in the order in which they were first connected.
    #[must_use]
    pub fn workers(&self) -> Vec<WorkerSummary> {
        self.summarise().0
    }

    /// Counts over all workers.
    #[must_use]
    pub fn counts(&self) -> ClusterCounts {
        self.summarise().1
    }

    fn summarise(&self) -> (Vec<WorkerSummary>, ClusterCounts) {
        let (reply, summaries) = oneshot::channel();
        self.hub.tell(Message::Summarise(reply));
        // Nothing comes where the reactor is gone.
        summaries.blocking_recv().unwrap_or_default()
    }

    /// Says goodbye to all workers and leaves, within about a second. Dropping the cluster does the same.
    pub fn shutdown(self) {}
}

/// Told once there is a worker and the others had a moment to answer, or why there is none.
type Ready = oneshot::Receiver<Result<(), ClusterError>>;

impl Drop for Cluster {
    fn drop(&mut self) {
        let Some((runtime, leaving)) = self.runtime.take() else { return };
        let (done, all_gone) = oneshot::channel::<()>();
        self.hub.tell(Message::Shutdown(done));
        // In a thread of its own: the caller may be a task of another runtime, where nothing may wait.
        let waiting = std::thread::spawn(move || {
            // Those that do not answer in time are left.
            let _ = runtime.block_on(async { tokio::time::timeout(GOODBYE_TIMEOUT, all_gone).await });
            runtime.shutdown_background();
            drop(leaving);
        });
        let _ = waiting.join();
        self.hub.stop();
    }
}
