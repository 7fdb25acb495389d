//! Work that takes a processor: always on the worker's own threads, never on those that answer the network.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use tokio::sync::oneshot;

/// The threads that compute. A clone is another handle to the same threads.
#[derive(Clone)]
pub struct ComputePool {
    threads: Arc<ThreadPool>,
}

/// Work did not come to its end.
#[derive(Debug, thiserror::Error)]
#[error("the computation panicked: {0}")]
pub struct Panicked(String);

impl ComputePool {
    /// Starts so many threads.
    ///
    /// # Errors
    /// When the system refuses to start a thread.
    pub fn new(threads: usize) -> Result<Self, ThreadPoolBuildError> {
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|index| format!("compute-{index}"))
            .build()?;
        Ok(Self { threads: Arc::new(pool) })
    }

    /// Queues work behind all that was queued before, and waits for its result without holding a thread.
    ///
    /// # Errors
    /// When the work panics; the thread goes on with other work.
    pub async fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Panicked> {
        let (sender, receiver) = oneshot::channel();
        self.threads.spawn_fifo(move || {
            // The work owns all that it touches, so nobody sees what a panic left half done.
            let result = catch_unwind(AssertUnwindSafe(work)).map_err(|payload| Panicked(message(&*payload)));
            // Whoever asked may have left meanwhile.
            let _ = sender.send(result);
        });
        receiver.await.unwrap_or_else(|_| Err(Panicked("its thread is gone".into())))
    }
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
}
