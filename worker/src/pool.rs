//! Work that takes a processor: always on the worker's own threads, never on those that answer the network. Only simulations,
//! in which nothing may depend on threads, have it done where it is asked for.

use std::any::Any;
use std::num::NonZeroUsize;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use tokio::sync::{Semaphore, oneshot};
use tokio::time::sleep;

/// How a worker computes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Compute {
    /// On threads of its own.
    #[default]
    Threads,
    /// For simulations: in the task that asks, which has the result after so long on the runtime's clock. With a clock that is
    /// simulated, the same happens at the same time in every run.
    InTask {
        /// Time for each piece of work.
        time: Duration,
    },
}

/// The threads that compute. A clone is another handle to the same threads.
#[derive(Clone)]
pub struct ComputePool(Pool);

#[derive(Clone)]
enum Pool {
    Threads(Arc<ThreadPool>),
    InTask {
        time: Duration,
        /// One place for each thread that there would be; given away in the order in which they are asked for.
        places: Arc<Semaphore>,
    },
}

/// Work did not come to its end.
#[derive(Debug, thiserror::Error)]
#[error("the computation panicked: {0}")]
pub struct Panicked(String);

impl ComputePool {
    /// Starts the threads.
    ///
    /// # Errors
    /// When the system refuses to start a thread.
    pub fn new(threads: usize) -> Result<Self, ThreadPoolBuildError> {
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|index| format!("compute-{index}"))
            .build()?;
        Ok(Self(Pool::Threads(Arc::new(pool))))
    }

    /// A pool that does this many pieces of work at the same time.
    ///
    /// # Errors
    /// When the system refuses to start a thread.
    pub fn of(compute: Compute, threads: NonZeroUsize) -> Result<Self, ThreadPoolBuildError> {
        match compute {
            Compute::Threads => Self::new(threads.get()),
            Compute::InTask { time } => {
                Ok(Self(Pool::InTask { time, places: Arc::new(Semaphore::new(threads.get())) }))
            }
        }
    }

    /// Queues work after all that was queued before, and waits for its result without holding a thread.
    ///
    /// # Errors
    /// When the work panics; the thread goes on with other work.
    pub async fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Panicked> {
        match &self.0 {
            Pool::Threads(threads) => {
                let (sender, receiver) = oneshot::channel();
                threads.spawn_fifo(move || {
                    // The caller may have left meanwhile.
                    let _ = sender.send(caught(work));
                });
                receiver.await.unwrap_or_else(|_| Err(Panicked("its thread is gone".into())))
            }
            Pool::InTask { time, places } => {
                // Nobody ever closes it.
                let _place = places.acquire().await;
                let result = caught(work);
                sleep(*time).await;
                result
            }
        }
    }
}

/// Does work that may panic.
fn caught<T>(work: impl FnOnce() -> T) -> Result<T, Panicked> {
    // The work owns all that it touches, so nobody sees what a panic left half done.
    catch_unwind(AssertUnwindSafe(work)).map_err(|payload| Panicked(message(&*payload)))
}

/// The words of a panic.
fn message(payload: &(dyn Any + Send)) -> String {
    payload
        .downcast_ref::<String>()
        .cloned()
        .or_else(|| payload.downcast_ref::<&str>().map(ToString::to_string))
        .unwrap_or_else(|| "without a message".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_panic_is_caught_and_the_thread_lives_on() {
        let pool = ComputePool::new(1).unwrap();
        let failed = pool.run(|| -> u32 { panic!("no {}", "way") }).await;
        assert_eq!(failed.unwrap_err().to_string(), "the computation panicked: no way");
        assert_eq!(pool.run(|| 7).await.unwrap(), 7);
    }

    #[tokio::test(start_paused = true)]
    async fn in_the_task_work_takes_its_time_and_no_more_places_than_there_are() {
        let time = Duration::from_millis(30);
        let pool = ComputePool::of(Compute::InTask { time }, NonZeroUsize::new(2).unwrap()).unwrap();
        let start = tokio::time::Instant::now();
        let (a, b, c) = tokio::join!(pool.run(|| 1), pool.run(|| 2), pool.run(|| 3));
        assert_eq!((a.unwrap(), b.unwrap(), c.unwrap()), (1, 2, 3));
        assert_eq!(start.elapsed(), 2 * time);
    }
}
