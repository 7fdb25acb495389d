//! How many jobs a worker may hold, so that its threads go on while answers and jobs travel.

use std::time::Duration;

/// Most jobs per thread that a worker may hold: what it holds a job of another bake has to wait for.
const MOST_PER_THREAD: usize = 60;

/// Jobs that a worker may hold, given the round trip of a message to it and the time that a job takes it: one computed and one waiting
/// per thread and one on its way, and twice those that its threads compute in a round trip, since some jobs take less than others.
#[must_use]
pub fn room(threads: usize, round_trip: Duration, job: Duration) -> usize {
    let threads = threads.max(1);
    let most = MOST_PER_THREAD - 2;
    // A round trip of no more than a part of a job is what the waiting job is for.
    let jobs = 2.0 * round_trip.as_secs_f64() / job.as_secs_f64().max(1e-6);
    let ahead = if jobs < 1.0 { 0 } else { (jobs.ceil() as usize).min(most) };
    threads * (2 + ahead) + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_worker_far_away_holds_more_jobs() {
        let millis = Duration::from_millis;
        assert_eq!(room(4, millis(1), millis(25)), 9);
        assert_eq!(room(1, millis(200), millis(25)), 19);
        assert_eq!(room(2, millis(200), millis(25)), 37);
        assert_eq!(room(1, millis(200), Duration::ZERO), MOST_PER_THREAD + 1, "however short jobs are");
    }
}
