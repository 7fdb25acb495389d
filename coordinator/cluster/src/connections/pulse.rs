//! Keep-alives of one session: whether the worker is there, how long its answers take, and whether uploads to it get on.

use std::collections::VecDeque;
use std::time::Duration;

use protocol::worker::KeepAlive;
use tokio::time::Instant;

/// Interval between keep-alives of a session. They take the way of the jobs and answers, so that a stall of the process, its machine
/// or the network is noticed.
pub(super) const KEEP_ALIVE: Duration = Duration::from_millis(800);

/// Keep-alives without any message from a worker before it is lost: after four seconds at most. Counted rather than timed, so that a
/// coordinator that was stopped for a while does not blame the worker.
const MOST_UNANSWERED: u32 = 4;

/// Keep-alives without an answer from a worker that holds jobs before it is lost: after ten minutes. Jobs take milliseconds to seconds.
const MOST_IDLE: u32 = 750;

/// Keep-alives from one in which uploads got on, or the first of an upload, to the one that gives up on them: a stall is found after
/// four seconds at most, and the time of an answer.
const MOST_STALLED: u64 = 4;

/// Keep-alives whose times are remembered: more than can be unanswered on a session that lives.
const MOST_REMEMBERED: usize = 64;

/// Why a session is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Lapse {
    /// Nothing comes from the worker.
    Silent,
    /// It answers none of its jobs.
    Idle,
    /// An upload to it does not get on.
    Stalled,
}

/// State of the keep-alives of a session.
#[derive(Debug, Default)]
pub(super) struct Pulse {
    /// Number of the next keep-alive.
    next: u64,
    /// Those without an answer, and when they were sent.
    sent: VecDeque<(u64, Instant)>,
    /// Keep-alives since the last message.
    unanswered: u32,
    /// Keep-alives since the last answer to a job, while the worker holds any.
    idle: u32,
    /// How far uploads had come by the last answer; see [`KeepAlive::uploaded`].
    uploaded: u64,
    /// The keep-alive in whose answer uploads got on last, or the first after one began.
    stalled_since: u64,
}

impl Pulse {
    /// The next keep-alive, when it is due.
    pub(super) fn beat(&mut self, now: Instant, holds_jobs: bool) -> Result<KeepAlive, Lapse> {
        self.unanswered += 1;
        self.idle = if holds_jobs { self.idle + 1 } else { 0 };
        if self.unanswered > MOST_UNANSWERED {
            return Err(Lapse::Silent);
        }
        if self.idle > MOST_IDLE {
            return Err(Lapse::Idle);
        }
        let number = self.next;
        self.next += 1;
        self.sent.push_back((number, now));
        if self.sent.len() > MOST_REMEMBERED {
            self.sent.pop_front();
        }
        Ok(KeepAlive { number, uploaded: 0 })
    }

    /// A message came.
    pub(super) fn heard(&mut self) {
        self.unanswered = 0;
    }

    /// A job was answered.
    pub(super) fn worked(&mut self) {
        self.idle = 0;
    }

    /// An upload begins.
    pub(super) fn uploads(&mut self) {
        self.stalled_since = self.next;
    }

    /// A keep-alive was answered. Returns the time that it took, if that is known.
    pub(super) fn answered(
        &mut self,
        KeepAlive { number, uploaded }: KeepAlive,
        now: Instant,
        is_uploading: bool,
    ) -> Result<Option<Duration>, Lapse> {
        if uploaded != self.uploaded {
            self.uploaded = uploaded;
            self.stalled_since = number;
        } else if is_uploading && number < self.next && number >= self.stalled_since + MOST_STALLED {
            return Err(Lapse::Stalled);
        }
        // They are answered in their order.
        let passed = self.sent.partition_point(|(sent, _)| *sent <= number);
        let last = self.sent.drain(..passed).next_back();
        Ok(last.filter(|(sent, _)| *sent == number).map(|(_, time)| now - time))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Beats and answers `times` times, the answers `late` beats after; the first lapse.
    fn answer(pulse: &mut Pulse, times: u64, late: u64, uploaded: impl Fn(u64) -> u64) -> Result<(), Lapse> {
        let now = Instant::now();
        for beat in 0..times {
            pulse.beat(now, false)?;
            pulse.heard();
            if let Some(number) = beat.checked_sub(late) {
                pulse.answered(KeepAlive { number, uploaded: uploaded(number) }, now, true)?;
            }
        }
        Ok(())
    }

    #[tokio::test(start_paused = true)]
    async fn answers_tell_how_long_they_took() {
        let mut pulse = Pulse::default();
        let began = Instant::now();
        let first = pulse.beat(began, false).unwrap();
        let second = pulse.beat(began + KEEP_ALIVE, false).unwrap();
        let late = Duration::from_millis(30);
        // Messages of a session keep their order: what a later answer overtook is lost.
        assert_eq!(pulse.answered(second, began + KEEP_ALIVE + late, false), Ok(Some(late)));
        assert_eq!(pulse.answered(first, began + KEEP_ALIVE + late, false), Ok(None));
        assert_eq!(pulse.answered(KeepAlive { number: 99, uploaded: 0 }, began, false), Ok(None));
    }

    #[test]
    fn silence_and_idleness_end_a_session() {
        let (mut silent, now) = (Pulse::default(), Instant::now());
        let beats = (0..).take_while(|_| silent.beat(now, false).is_ok()).count();
        assert_eq!(beats, MOST_UNANSWERED as usize);
        let mut idle = Pulse::default();
        let mut beat = || {
            idle.heard();
            idle.beat(now, true)
        };
        assert!((0..MOST_IDLE).all(|_| beat().is_ok()));
        assert_eq!(beat(), Err(Lapse::Idle));
    }

    #[test]
    fn an_upload_that_gets_on_is_waited_for_whatever_the_delay_of_answers() {
        for late in [0, 3, 20] {
            let mut gets_on = Pulse::default();
            gets_on.uploads();
            assert_eq!(answer(&mut gets_on, 100, late, |number| number / 3), Ok(()), "{late}");
            let mut stalls = Pulse::default();
            stalls.uploads();
            assert_eq!(answer(&mut stalls, MOST_STALLED + late, late, |_| 0), Ok(()), "{late}");
            let mut stalls = Pulse::default();
            stalls.uploads();
            assert_eq!(answer(&mut stalls, MOST_STALLED + late + 1, late, |_| 0), Err(Lapse::Stalled));
        }
    }
}
