//! How the wall time of a bake divides, from what its thread and those of the workers did meanwhile: pure.

use std::ops::{Add, Sub};
use std::time::Duration;

use crate::observer::TimeParts;

/// Time of the threads of all workers so far, summed over the threads.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ThreadTime {
    /// Since their workers are connected.
    pub connected: Duration,
    /// While their workers held a job for them.
    pub occupied: Duration,
    /// Without a job, while a replica was on its way to their workers.
    pub loading: Duration,
    /// Of computing, by the workers' own account: of the time occupied, all but the ways of messages.
    pub busy: Duration,
}

impl Sub for ThreadTime {
    type Output = Self;

    /// The time since an earlier one.
    fn sub(self, earlier: Self) -> Self {
        Self {
            connected: self.connected.saturating_sub(earlier.connected),
            occupied: self.occupied.saturating_sub(earlier.occupied),
            loading: self.loading.saturating_sub(earlier.loading),
            busy: self.busy.saturating_sub(earlier.busy),
        }
    }
}

impl Add for ThreadTime {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            connected: self.connected + other.connected,
            occupied: self.occupied + other.occupied,
            loading: self.loading + other.loading,
            busy: self.busy + other.busy,
        }
    }
}

/// Divides the wall time as it passes.
#[derive(Debug, Default)]
pub struct Division {
    /// Time up to which all is divided, since the start of the bake, and of the threads.
    divided: (f64, ThreadTime),
    /// Seconds passed since, of waiting and of the coordinator's own arithmetic.
    pending: [f64; 2],
    /// Seconds divided, times the part of the threads that was occupied.
    occupied: f64,
    /// The same of threads that loaded a replica while the bake waited.
    loading: f64,
    /// Seconds of waiting, times the part of the threads that neither was occupied nor loaded.
    waiting: f64,
    /// Seconds of own arithmetic, times the part of the threads that was not occupied: by steps, and in the present one.
    own: f64,
    step: f64,
    /// Time of the threads since the start.
    threads: ThreadTime,
}

impl Division {
    /// Begins where the threads have worked for others this long.
    pub fn new(threads: ThreadTime) -> Self {
        Self { divided: (0.0, threads), ..Self::default() }
    }

    /// The bake has waited for rows until now, `seconds` after its start, or done something else.
    pub fn pass(&mut self, seconds: f64, threads: ThreadTime, waited: bool) {
        let [of_waiting, of_own] = self.pending;
        let passed = (seconds - self.divided.0 - of_waiting - of_own).max(0.0);
        self.pending[usize::from(!waited)] += passed;
        let since = threads - self.divided.1;
        if !since.connected.is_zero() {
            self.divide(since);
        }
    }

    /// Divides what has passed.
    fn divide(&mut self, since: ThreadTime) {
        let connected = since.connected.as_secs_f64();
        let part =
            |time: Duration| if connected > 0.0 { (time.as_secs_f64() / connected).min(1.0) } else { 0.0 };
        let occupied = part(since.occupied);
        let loading = part(since.loading).min(1.0 - occupied);
        let [waiting, own] = std::mem::take(&mut self.pending);
        self.occupied += occupied * (waiting + own);
        self.loading += loading * waiting;
        self.waiting += (1.0 - occupied - loading) * waiting;
        self.own += (1.0 - occupied) * own;
        self.step += (1.0 - occupied) * own;
        self.divided = (self.divided.0 + waiting + own, self.divided.1 + since);
        self.threads = self.threads + since;
    }

    /// Ends a step: the seconds of own arithmetic in it.
    pub fn end_step(&mut self) -> f64 {
        if self.pending != [0.0; 2] {
            self.divide(ThreadTime::default());
        }
        std::mem::take(&mut self.step)
    }

    /// The parts so far, where the rows of this bake took threads this long.
    pub fn parts(&self, busy: Duration) -> TimeParts {
        let ThreadTime { occupied, busy: all, .. } = self.threads;
        // Where no thread is known to be occupied, nothing was.
        let whole = occupied.as_secs_f64().max(f64::MIN_POSITIVE);
        let all = (all.as_secs_f64() / whole).min(1.0);
        let rows = (busy.as_secs_f64() / whole).min(all);
        TimeParts {
            rows: rows * self.occupied,
            other_rows: (all - rows) * self.occupied,
            network: (1.0 - all) * self.occupied + self.loading,
            waiting: self.waiting + self.pending[0],
            own: self.own + self.pending[1],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn threads(millis: [u64; 4]) -> ThreadTime {
        let [connected, occupied, loading, busy] = millis.map(Duration::from_millis);
        ThreadTime { connected, occupied, loading, busy }
    }

    fn is_near(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-9
    }

    #[test]
    fn each_part_gets_its_share_of_the_threads() {
        let before = threads([9000, 5000, 0, 5000]);
        let mut division = Division::new(before);
        // Four threads. A second of arithmetic, half of them busy.
        division.pass(1.0, before + threads([4000, 2000, 0, 2000]), false);
        assert!(is_near(division.end_step(), 0.5));
        // Two seconds of waiting: one thread computes, one loads, two have nothing to do.
        division.pass(3.0, before + threads([12000, 4000, 2000, 3600]), true);
        assert!(is_near(division.end_step(), 0.0));
        let parts = division.parts(Duration::from_millis(3000));
        let whole = 4.0 * 0.25;
        assert!(is_near(parts.rows, 0.75 * whole), "three of four seconds are its own: {parts:?}");
        assert!(is_near(parts.other_rows, 0.15 * whole), "{parts:?}");
        assert!(is_near(parts.network, 0.1 * whole + 0.5), "messages on their way, and replicas: {parts:?}");
        assert!(is_near(parts.waiting, 1.0) && is_near(parts.own, 0.5), "{parts:?}");
        assert!(is_near(parts.total(), 3.0), "{parts:?}");
    }

    #[test]
    fn time_is_divided_once_it_is_known_what_the_threads_did() {
        let mut division = Division::default();
        division.pass(1.0, ThreadTime::default(), false);
        division.pass(3.0, ThreadTime::default(), true);
        let parts = division.parts(Duration::ZERO);
        assert_eq!((parts.own, parts.waiting), (1.0, 2.0), "no worker is there");
        division.pass(4.0, threads([2000, 1000, 0, 1000]), true);
        let parts = division.parts(Duration::from_secs(1));
        assert_eq!((parts.own, parts.waiting, parts.rows), (0.5, 1.5, 2.0));
        // What a step took is not left to the next one.
        division.pass(5.0, threads([2000, 1000, 0, 1000]), false);
        assert_eq!((division.end_step(), division.end_step()), (1.5, 0.0));
        assert_eq!(division.parts(Duration::from_secs(1)).total(), 5.0);
    }

    #[test]
    fn rows_of_a_checkpoint_took_no_time_now() {
        let mut division = Division::default();
        division.pass(2.0, threads([2000, 1000, 0, 500]), true);
        let parts = division.parts(Duration::from_secs(100));
        assert_eq!((parts.rows, parts.other_rows, parts.network, parts.total()), (0.5, 0.0, 0.5, 2.0));
    }
}
