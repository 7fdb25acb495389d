//! What is seen of a job while it runs. The bake tells; whoever watches reads the latest state, whenever it comes to it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use protocol::api;
use tokio::sync::watch;

use crate::present::Present;
use bake::lit::LitMesh;
use bake::{Observer, Phase, Progress};
use cluster::SharedCluster;

/// Between two states that watchers are told of: rows come by the ten thousand.
const INTERVAL: Duration = Duration::from_millis(200);

/// Over so many seconds the rate of rays is taken.
const RATE_SECONDS: f64 = 3.0;

/// A mutex that a panic elsewhere does not close: what these hold is whole after each statement.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A running job, as seen from outside.
#[derive(Debug)]
pub struct Live {
    /// What it knows of the answer by now.
    pub present: Present,
    state: Mutex<Seen>,
    stopped: AtomicBool,
    begun: AtomicBool,
    changed: watch::Sender<()>,
}

#[derive(Debug)]
struct Seen {
    progress: api::Progress,
    began: Instant,
    told: Option<(Instant, i32)>,
    /// When rays were counted last, and how many there were.
    counted: (Instant, u64),
    changes: u64,
}

impl Live {
    /// A job that begins now; `changed` is told of every state that watchers should see.
    #[must_use]
    pub fn new(changed: watch::Sender<()>) -> Self {
        let now = Instant::now();
        let state = Seen {
            progress: api::Progress { unshot: 1.0, ..api::Progress::default() },
            began: now,
            told: None,
            counted: (now, 0),
            changes: 0,
        };
        Self {
            present: Present::default(),
            state: Mutex::new(state),
            stopped: AtomicBool::new(false),
            begun: AtomicBool::new(false),
            changed,
        }
    }

    /// Tells the job to end.
    pub fn stop(&self) {
        self.stopped.store(true, Ordering::Relaxed);
    }

    /// From now on a thread has it, and removes what is left of it where it was deleted meanwhile.
    #[must_use]
    pub fn begin(self: &Arc<Self>) -> Arc<Self> {
        self.begun.store(true, Ordering::Relaxed);
        Arc::clone(self)
    }

    /// Whether a thread has it.
    #[must_use]
    pub fn has_begun(&self) -> bool {
        self.begun.load(Ordering::Relaxed)
    }

    /// Whether it was told to end.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    /// How far it is, and how often that has changed.
    #[must_use]
    pub fn progress(&self) -> (api::Progress, u64) {
        let seen = lock(&self.state);
        (seen.progress, seen.changes)
    }

    /// It does something that is no step of the bake.
    pub fn enter(&self, phase: api::Phase) {
        let mut seen = lock(&self.state);
        seen.progress.phase = phase.into();
        seen.progress.time_left = None;
        self.tell(&mut seen);
    }

    /// Whether somebody looks at it now.
    fn is_watched(&self) -> bool {
        self.changed.receiver_count() > 0
    }

    /// The bake has come so far, by so many workers. Cheap where nobody would be told yet.
    fn set(&self, progress: &Progress, workers: usize) {
        let mut seen = lock(&self.state);
        let now = Instant::now();
        let phase = i32::from(api_phase(progress.phase));
        if seen.told.is_some_and(|(time, told)| told == phase && now - time < INTERVAL) {
            return;
        }
        let (counted, rays) = seen.counted;
        let seconds = (now - counted).as_secs_f64();
        let rate = progress.rays.saturating_sub(rays) as f64 / seconds.max(1e-3);
        let part = (seconds / RATE_SECONDS).min(1.0);
        let rate = (1.0 - part) * seen.progress.rays_per_second + part * rate;
        seen.counted = (now, progress.rays);
        let done = progress.rows as f64 / progress.rows_needed.max(1) as f64;
        let elapsed = (now - seen.began).as_secs_f64();
        let left = (done > 0.0).then(|| elapsed * (1.0 - done).max(0.0) / done);
        let left = left.and_then(|left| Duration::try_from_secs_f64(left).ok());
        seen.progress = api::Progress {
            phase,
            unshot: progress.unshot,
            error: progress.error,
            rows: progress.rows,
            rows_needed: progress.rows_needed,
            rays_per_second: rate,
            vertices: progress.vertices as u64,
            workers: workers.try_into().unwrap_or(u32::MAX),
            time_left: left.and_then(|left| left.try_into().ok()),
            ..seen.progress
        };
        self.tell(&mut seen);
    }

    fn tell(&self, seen: &mut Seen) {
        seen.told = Some((Instant::now(), seen.progress.phase));
        seen.changes += 1;
        self.changed.send_replace(());
    }
}

/// A bake is seen by those who look at its job.
pub struct Watched<'a> {
    /// The job.
    pub live: &'a Live,
    /// Its workers, and everybody's.
    pub workers: &'a SharedCluster,
}

impl Observer for Watched<'_> {
    fn progress(&mut self, progress: &Progress) {
        self.live.set(progress, self.workers.status().workers);
    }

    fn is_cancelled(&mut self) -> bool {
        self.live.is_stopped()
    }

    fn wants_preview(&mut self) -> bool {
        self.live.present.is_wanted(self.live.is_watched())
    }

    fn preview(&mut self, lit: LitMesh) {
        let number = self.live.present.set(Arc::new(lit));
        let mut seen = lock(&self.live.state);
        seen.progress.present = number;
        self.live.tell(&mut seen);
    }
}

fn api_phase(phase: Phase) -> api::Phase {
    match phase {
        Phase::Light => api::Phase::Light,
        Phase::Shoot => api::Phase::Shoot,
        Phase::Refine => api::Phase::Refine,
        Phase::Measure => api::Phase::Measure,
        Phase::Settle => api::Phase::Settle,
        Phase::Groups => api::Phase::Groups,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn watchers_are_told_of_steps_and_not_of_every_row() {
        let (changed, mut watcher) = watch::channel(());
        let live = Live::new(changed);
        let mut progress = Progress {
            phase: Phase::Light,
            unshot: 0.5,
            error: None,
            rows: 1,
            rows_needed: 4,
            rays: 9,
            vertices: 7,
        };
        live.set(&progress, 2);
        assert!(watcher.has_changed().unwrap());
        watcher.mark_unchanged();
        let (seen, first) = live.progress();
        assert_eq!((seen.rows, seen.rows_needed, seen.workers), (1, 4, 2));
        progress.rows = 2;
        live.set(&progress, 2);
        assert_eq!(live.progress().1, first);
        assert!(!watcher.has_changed().unwrap());
        progress.phase = Phase::Shoot;
        live.set(&progress, 2);
        assert_eq!(live.progress().0.phase(), api::Phase::Shoot);
        assert!(live.progress().1 > first);
        assert!(live.is_watched());
        drop(watcher);
        assert!(!live.is_watched());
    }
}
