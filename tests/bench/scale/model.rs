//! What is simulated: machines, network and policy.

use cluster::scheduler::Policy;

use crate::processor::Nanoseconds;

/// A cluster.
#[derive(Clone)]
pub struct Model {
    /// Speed of each worker, a machine of one thread: 1 as measured, 0 where it hangs.
    pub workers: Vec<f64>,
    /// All that is measured, of workers and coordinator alike, times this.
    pub slowness: f64,
    /// Of the coordinator: what its threads share takes one over this.
    pub cores: u64,
    /// One way.
    pub latency: Nanoseconds,
    /// Of the coordinator's link in each direction, bytes a second.
    pub bandwidth: f64,
    /// Processor time that a message takes of one of the network's threads, beside what is measured: gRPC, HTTP/2, system calls.
    pub per_message: Nanoseconds,
    /// All that the bake's own threads compute takes one over this.
    pub driver: u64,
    /// Workers pass replicas on to each other, over links as fast as the coordinator's.
    pub passes: bool,
    /// Replicas take no time to travel.
    pub free_replicas: bool,
    /// When jobs are sent.
    pub policy: Policy,
    /// From tick to tick, with the periodic policy.
    pub period: Nanoseconds,
    /// Who shoots.
    pub shooting: Where,
}

/// Who shoots.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Where {
    /// The coordinator, once the row has come.
    Locally,
    /// The worker that made the row: it fetches all energies and brings them back, and no two at the same time.
    Remotely {
        /// Energies of all vertices.
        bytes: u64,
    },
}

/// Processor time that a message takes of one of the network's threads.
const PER_MESSAGE: Nanoseconds = 30_000;

/// Time for the driver's thread to wake up.
pub const WAKING: Nanoseconds = 20_000;

/// Cores of the coordinator.
pub const CORES: u64 = 8;

/// Threads that move messages on the coordinator's side: one per core.
pub const NETWORK_THREADS: usize = CORES as usize;

impl Model {
    /// So many even workers on a network of 1 Gbit/s and .2 ms.
    #[must_use]
    pub fn even(workers: usize) -> Self {
        Self {
            workers: vec![1.0; workers],
            slowness: 1.0,
            cores: CORES,
            latency: 200_000,
            bandwidth: 125e6,
            per_message: PER_MESSAGE,
            driver: 1,
            passes: true,
            free_replicas: false,
            policy: Policy::Finished,
            period: 1_000_000,
            shooting: Where::Locally,
        }
    }

    /// Time that so many bytes take of the link.
    #[must_use]
    pub fn travelling(&self, bytes: u64) -> Nanoseconds {
        (bytes as f64 / self.bandwidth * 1e9) as Nanoseconds
    }

    /// A measured time on a machine of this model.
    #[must_use]
    pub fn scaled(&self, measured: Nanoseconds) -> Nanoseconds {
        (measured as f64 * self.slowness) as Nanoseconds
    }
}
