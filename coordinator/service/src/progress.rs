//! The latest state of a running job: its process reports it, watchers read it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use bake::time_of_rows_left;
use protocol::api;
use tokio::sync::watch;

use crate::pipes::JobLink;
use crate::pipes::messages::BakeProgress;
use crate::sync::lock;

/// Least time between two states for watchers: rows come by the ten thousand.
const INTERVAL: Duration = Duration::from_millis(200);

/// How long previews are made after somebody asked for one.
const INTEREST: Duration = Duration::from_secs(30);

/// Seconds over which the rates of rows and rays are averaged.
const RATE_SECONDS: f64 = 3.0;

/// A running job, as seen from outside.
#[derive(Debug)]
pub struct Live {
    /// The way to its process.
    pub link: JobLink,
    state: Mutex<Seen>,
    stopped: AtomicBool,
    begun: AtomicBool,
    changed: watch::Sender<()>,
}

#[derive(Debug)]
struct Seen {
    progress: api::Progress,
    /// When the bake first asked for rows.
    rows_began: Option<Instant>,
    told: Option<(Instant, i32)>,
    /// When rows and rays were counted last, and how many there were.
    counted: (Instant, [u64; 2]),
    changes: u64,
    /// When a preview was asked for last.
    asked: Option<Instant>,
}

impl Live {
    /// A job that begins now; `changed` is notified of every state that watchers should see.
    #[must_use]
    pub fn new(changed: watch::Sender<()>) -> Self {
        let now = Instant::now();
        let state = Seen {
            progress: api::Progress { unshot: 1.0, ..api::Progress::default() },
            rows_began: None,
            told: None,
            counted: (now, [0; 2]),
            changes: 0,
            asked: None,
        };
        Self {
            link: JobLink::default(),
            state: Mutex::new(state),
            stopped: AtomicBool::new(false),
            begun: AtomicBool::new(false),
            changed,
        }
    }

    /// Tells the job to stop.
    pub fn stop(&self) {
        self.stopped.store(true, Ordering::Relaxed);
    }

    /// Hands it to a thread, which removes what is left of it if it is deleted meanwhile.
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

    /// Whether it was told to stop.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    /// Returns its progress, and how often that has changed.
    #[must_use]
    pub fn progress(&self) -> (api::Progress, u64) {
        let seen = lock(&self.state);
        (seen.progress, seen.changes)
    }

    /// Enters a phase outside the bake.
    pub fn enter(&self, phase: i32) {
        let mut seen = lock(&self.state);
        seen.progress.phase = phase;
        seen.progress.time_left = None;
        self.tell(&mut seen);
    }

    /// Whether somebody watches it now.
    fn is_watched(&self) -> bool {
        self.changed.receiver_count() > 0
    }

    /// Whether previews are wanted.
    pub fn wants_previews(&self) -> bool {
        self.is_watched() || lock(&self.state).asked.is_some_and(|asked| asked.elapsed() < INTEREST)
    }

    /// Asks for previews, and returns whether there is one.
    pub fn ask_preview(&self) -> bool {
        let mut seen = lock(&self.state);
        seen.asked = Some(Instant::now());
        seen.progress.present > 0
    }

    /// There is a preview of this number.
    pub fn set_preview(&self, number: u64) {
        let mut seen = lock(&self.state);
        seen.progress.present = number;
        self.tell(&mut seen);
    }

    /// Takes the bake's progress and its number of workers; returns at once while no watcher would be notified.
    pub fn set(&self, progress: &BakeProgress, workers: usize) {
        let mut seen = lock(&self.state);
        let now = Instant::now();
        let phase = progress.phase;
        if seen.told.is_some_and(|(time, told)| told == phase && now - time < INTERVAL) {
            return;
        }
        let (counted, [rows, rays]) = seen.counted;
        let seconds = (now - counted).as_secs_f64();
        let part = (seconds / RATE_SECONDS).min(1.0);
        let rate = |before: f64, count: u64| (1.0 - part) * before + part * count as f64 / seconds.max(1e-3);
        let rows_per_second = rate(seen.progress.rows_per_second, progress.rows.saturating_sub(rows));
        let rays_per_second = rate(seen.progress.rays_per_second, progress.rays.saturating_sub(rays));
        seen.counted = (now, [progress.rows, progress.rays]);
        if progress.rows_needed > 0 {
            seen.rows_began.get_or_insert(now);
        }
        let left = seen
            .rows_began
            .and_then(|began| time_of_rows_left(now - began, progress.rows, progress.rows_needed));
        seen.progress = api::Progress {
            phase,
            unshot: progress.unshot,
            error: progress.error,
            rows: progress.rows,
            rows_needed: progress.rows_needed,
            rows_per_second,
            rays_per_second,
            vertices: progress.vertices,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn watchers_are_told_of_steps_and_not_of_every_row() {
        let (changed, mut watcher) = watch::channel(());
        let live = Live::new(changed);
        let mut progress = BakeProgress {
            phase: api::Phase::Light.into(),
            unshot: 0.5,
            error: None,
            rows: 1,
            rows_needed: 4,
            rays: 9,
            vertices: 7,
            time: None,
        };
        live.set(&progress, 2);
        assert!(watcher.has_changed().unwrap());
        watcher.mark_unchanged();
        let (seen, first) = live.progress();
        assert_eq!((seen.rows, seen.rows_needed, seen.workers), (1, 4, 2));
        assert!(seen.rows_per_second > 0.0 && seen.rays_per_second > seen.rows_per_second);
        progress.rows = 2;
        live.set(&progress, 2);
        assert_eq!(live.progress().1, first);
        assert!(!watcher.has_changed().unwrap());
        progress.phase = api::Phase::Shoot.into();
        live.set(&progress, 2);
        assert_eq!(live.progress().0.phase(), api::Phase::Shoot);
        assert!(live.progress().1 > first);
        assert!(live.is_watched());
        drop(watcher);
        assert!(!live.is_watched());
    }
}
