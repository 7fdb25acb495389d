//! How many rows a job should have. A pair is a shooter and a receiver.

/// Most pairs of a job whose time is not known: some milliseconds of work, so that the end of a batch does not wait for one worker and
/// the message costs little beside it.
const FIRST_PAIRS: usize = 16_000;

/// Most pairs of a job: a message of a megabyte or two.
const MOST_PAIRS: usize = 512_000;

/// Longest time that a job should take.
const JOB_NANOSECONDS: f64 = 25e6;

/// Time below which jobs do not get smaller towards the end of a batch, if they have [`FIRST_PAIRS`] no sooner.
const LEAST_NANOSECONDS: f64 = 5e6;

/// The rest of a batch is cut into this many jobs per thread: they become smaller towards its end.
const JOBS_PER_THREAD: usize = 8;

/// Computing time that is remembered: what a pair takes differs by the place in the scene, and by the phase of the bake.
const MEMORY_NANOSECONDS: f64 = 2e9;

/// Kinds of rows: a pair of one takes some hundred times as long as one of another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowKind {
    /// Of shooters with few polygons, over receivers.
    Plain,
    /// Of shooters with many polygons, over receivers.
    Many,
    /// Of hemispheres, over the polygons of a scene.
    Hemispheres,
}

/// How long pairs take, of each kind by itself.
#[derive(Debug, Clone, Copy, Default)]
pub struct Pace {
    rates: [Rate; 3],
}

/// Pairs computed lately, and the time they took.
#[derive(Debug, Clone, Copy, Default)]
struct Rate {
    pairs: f64,
    nanoseconds: f64,
}

impl Rate {
    /// Pairs that take this long; none where nothing is known of them.
    fn pairs_in(self, nanoseconds: f64) -> Option<usize> {
        (self.nanoseconds > 0.0).then(|| (self.pairs * nanoseconds / self.nanoseconds) as usize)
    }
}

impl Pace {
    /// Adds a finished job.
    pub fn add(&mut self, kind: RowKind, pairs: usize, nanoseconds: u64) {
        let rate = &mut self.rates[kind as usize];
        let latest = nanoseconds as f64;
        let kept = 1.0 / (1.0 + latest / MEMORY_NANOSECONDS);
        rate.pairs = kept * rate.pairs + pairs as f64;
        rate.nanoseconds = kept * rate.nanoseconds + latest;
    }

    /// Most rows of a job, given the pairs of each.
    pub fn most_rows(&self, kind: RowKind, pairs_per_row: usize) -> usize {
        let pairs = self.rates[kind as usize].pairs_in(JOB_NANOSECONDS).unwrap_or(FIRST_PAIRS);
        rows(pairs.min(MOST_PAIRS), pairs_per_row)
    }

    /// Rows of the next job of a batch that has `left` rows: few messages to begin with, then jobs so small that all threads
    /// are done at the same time.
    pub fn rows_of_next_job(
        &self,
        kind: RowKind,
        pairs_per_row: usize,
        left: usize,
        threads: usize,
    ) -> usize {
        let each = left / (JOBS_PER_THREAD * threads);
        let least = self.rates[kind as usize].pairs_in(LEAST_NANOSECONDS).unwrap_or(FIRST_PAIRS);
        let least = rows(least.min(FIRST_PAIRS), pairs_per_row);
        each.clamp(least, self.most_rows(kind, pairs_per_row).max(least)).min(left)
    }
}

/// Rows that make this number of pairs, at least one.
fn rows(pairs: usize, pairs_per_row: usize) -> usize {
    (pairs / pairs_per_row.max(1)).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use RowKind::{Hemispheres, Many, Plain};

    #[test]
    fn jobs_become_smaller_towards_the_end_of_a_batch() {
        let mut pace = Pace::default();
        assert_eq!(pace.rows_of_next_job(Plain, 1000, 10_000, 2), 16, "nothing is known of the pace");
        pace.add(Plain, 1_000_000, 100_000_000);
        assert_eq!(pace.most_rows(Plain, 1000), 250, "25 ms");
        let sizes = [10_000, 2000, 100, 3].map(|left| pace.rows_of_next_job(Plain, 1000, left, 2));
        assert_eq!(sizes, [250, 125, 16, 3]);
        assert_eq!(pace.most_rows(Plain, 10_000_000), 1, "a row is never cut");
    }

    #[test]
    fn expensive_pairs_make_small_jobs_and_leave_others_alone() {
        let mut pace = Pace::default();
        pace.add(Plain, 1_000_000, 100_000_000);
        // 100 us a pair.
        pace.add(Many, 1000, 100_000_000);
        assert_eq!(pace.most_rows(Many, 50), 5, "25 ms");
        assert_eq!(pace.rows_of_next_job(Many, 50, 16, 2), 1, "5 ms, however few pairs that is");
        assert_eq!((pace.most_rows(Plain, 1000), pace.most_rows(Hemispheres, 1000)), (250, 16));
    }

    #[test]
    fn the_pace_follows_a_change() {
        let mut pace = Pace::default();
        (0..1000).for_each(|_| pace.add(Plain, 1_000_000, 100_000_000));
        (0..200).for_each(|_| pace.add(Plain, 10_000, 100_000_000));
        let rows = pace.most_rows(Plain, 100);
        assert!((25..28).contains(&rows), "{rows}");
    }
}
