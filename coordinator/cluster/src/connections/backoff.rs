use std::time::Duration;

/// Delay before a worker that was lost is dialled again; doubled with each dial or session in vain up to the longest.
const FIRST_DELAY: Duration = Duration::from_millis(250);
const LONGEST_DELAY: Duration = Duration::from_secs(2);

/// How long to wait before an address is dialled again.
#[derive(Debug, Default)]
pub(super) struct Backoff {
    /// Dials without an answer, since the last one with.
    dials: u32,
    /// Sessions that answered no job, since the last one that did.
    sessions: u32,
}

impl Backoff {
    /// The delay after a dial that nobody answered.
    pub(super) fn not_reached(&mut self) -> Duration {
        self.dials = self.dials.saturating_add(1);
        delay(self.dials)
    }

    /// The delay after a session. A worker that breaks in each before it answers a job is dialled ever more rarely, however often it
    /// says hello.
    pub(super) fn lost(&mut self, useful: bool) -> Duration {
        self.dials = 0;
        self.sessions = if useful { 0 } else { self.sessions.saturating_add(1) };
        delay(self.sessions)
    }
}

fn delay(in_vain: u32) -> Duration {
    FIRST_DELAY.saturating_mul(2_u32.saturating_pow(in_vain)).min(LONGEST_DELAY)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delays_grow_until_somebody_answers() {
        let mut backoff = Backoff::default();
        let delays = [(); 100].map(|()| backoff.not_reached());
        assert_eq!(delays[0], 2 * FIRST_DELAY);
        assert!(delays.is_sorted() && delays[99] == LONGEST_DELAY, "{delays:?}");
        assert_eq!(backoff.lost(false), 2 * FIRST_DELAY);
        assert_eq!(backoff.lost(false), 4 * FIRST_DELAY);
        assert_eq!(backoff.lost(true), FIRST_DELAY);
        assert_eq!(backoff.not_reached(), 2 * FIRST_DELAY);
    }
}
