//! Processor time of a thread: what others do on the machine does not count.

use rustix::time::{ClockId, clock_gettime};

/// A time, or a difference of two.
pub type Nanoseconds = u64;

/// Processor time that the calling thread has had so far.
#[must_use]
pub fn processor_time() -> Nanoseconds {
    of(ClockId::ThreadCPUTime)
}

/// Processor time of all threads so far.
#[must_use]
pub fn processor_time_of_all() -> Nanoseconds {
    of(ClockId::ProcessCPUTime)
}

fn of(clock: ClockId) -> Nanoseconds {
    let time = clock_gettime(clock);
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}
