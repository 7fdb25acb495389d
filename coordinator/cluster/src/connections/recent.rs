//! Recent rate of work.

use std::collections::VecDeque;
use std::time::Duration;

/// Window of the rate.
const LATELY: Duration = Duration::from_secs(5);

/// Shortest time that a rate is taken over: one fast job is no rate.
const LEAST: Duration = Duration::from_millis(500);

/// Rate over the last seconds. Times are of one monotonic clock of the caller.
#[derive(Debug, Clone, Default)]
pub struct RecentRate {
    first: Option<Duration>,
    amounts: VecDeque<(Duration, u64)>,
}

impl RecentRate {
    /// Adds an amount done by `now`.
    pub fn add(&mut self, now: Duration, amount: u64) {
        self.first.get_or_insert(now);
        self.forget(now);
        self.amounts.push_back((now, amount));
    }

    /// Amount per second; 0 if nothing was done for some seconds.
    pub fn per_second(&mut self, now: Duration) -> f64 {
        self.forget(now);
        let sum: u64 = self.amounts.iter().map(|(_, amount)| amount).sum();
        let since = self.first.map_or(Duration::ZERO, |first| now.saturating_sub(first));
        sum as f64 / since.clamp(LEAST, LATELY).as_secs_f64()
    }

    fn forget(&mut self, now: Duration) {
        while self.amounts.front().is_some_and(|(time, _)| *time + LATELY < now) {
            self.amounts.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_long_past_does_not_count() {
        let mut rate = RecentRate::default();
        assert_eq!(rate.per_second(Duration::ZERO), 0.0);
        for tenths in 0..=100 {
            rate.add(Duration::from_millis(100 * tenths), 7);
        }
        let found = rate.per_second(Duration::from_secs(10));
        assert!((found - 70.0).abs() < 2.0, "{found}");
        assert_eq!(rate.per_second(Duration::from_secs(16)), 0.0);
    }

    #[test]
    fn a_single_fast_job_is_no_rate() {
        let mut rate = RecentRate::default();
        rate.add(Duration::from_millis(1), 100);
        assert_eq!(rate.per_second(Duration::from_millis(2)), 200.0);
    }
}
