//! How many rows a job should have. A pair is a shooter and a receiver.

/// Least pairs of a job: some milliseconds of work, so that the end of a batch does not wait for one worker and the message
/// costs little beside it.
const LEAST_PAIRS: usize = 16_000;

/// Most pairs of a job: a message of a megabyte or two.
const MOST_PAIRS: usize = 512_000;

/// Time that a job should take between these bounds.
const JOB_NANOSECONDS: f64 = 25e6;

/// The rest of a batch is cut into this many jobs per thread: they become smaller towards its end.
const JOBS_PER_THREAD: usize = 8;

/// Pairs computed so far, and the time they took.
#[derive(Debug, Clone, Copy, Default)]
pub struct Pace {
    pairs: f64,
    nanoseconds: f64,
}

impl Pace {
    /// Adds a finished job.
    pub fn add(&mut self, pairs: usize, nanoseconds: u64) {
        self.pairs += pairs as f64;
        self.nanoseconds += nanoseconds as f64;
    }

    /// Most rows of a job, given the pairs of each.
    pub fn most_rows(&self, pairs_per_row: usize) -> usize {
        let in_time =
            if self.nanoseconds > 0.0 { self.pairs * JOB_NANOSECONDS / self.nanoseconds } else { 0.0 };
        rows((in_time as usize).clamp(LEAST_PAIRS, MOST_PAIRS), pairs_per_row)
    }

    /// Rows of the next job of a batch that has `left` rows: few messages to begin with, then jobs so small that all threads
    /// are done at the same time.
    pub fn rows_of_next_job(&self, pairs_per_row: usize, left: usize, threads: usize) -> usize {
        let each = left / (JOBS_PER_THREAD * threads);
        each.clamp(rows(LEAST_PAIRS, pairs_per_row), self.most_rows(pairs_per_row)).min(left)
    }
}

/// Rows that make this number of pairs, at least one.
fn rows(pairs: usize, pairs_per_row: usize) -> usize {
    (pairs / pairs_per_row.max(1)).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jobs_become_smaller_towards_the_end_of_a_batch() {
        let mut pace = Pace::default();
        assert_eq!(pace.rows_of_next_job(1000, 10_000, 2), 16, "nothing is known of the pace");
        pace.add(1_000_000, 100_000_000);
        assert_eq!(pace.most_rows(1000), 250, "25 ms");
        let sizes = [10_000, 2000, 100, 3].map(|left| pace.rows_of_next_job(1000, left, 2));
        assert_eq!(sizes, [250, 125, 16, 3]);
        assert_eq!(pace.most_rows(10_000_000), 1, "a row is never cut");
    }
}
