//! The latest state of a running job: the bake writes it, watchers read it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use bake::lit::LitMesh;
use bake::{Observer, Phase, Progress};
use cluster::Cluster;
use output::export::ExportSettings;
use pipeline::run::RunObserver;
use protocol::api;
use scene::Scene;
use tokio::sync::watch;

use crate::preview::{Preview, PreviewSource};
use crate::sync::lock;

/// Least time between two states for watchers: rows come by the ten thousand.
const INTERVAL: Duration = Duration::from_millis(200);

/// Seconds over which the rate of rays is averaged.
const RATE_SECONDS: f64 = 3.0;

/// A running job, as seen from outside.
#[derive(Debug)]
pub struct Live {
    /// Its preview.
    pub preview: Preview,
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
    /// A job that begins now; `changed` is notified of every state that watchers should see.
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
            preview: Preview::default(),
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
    pub fn enter(&self, phase: api::Phase) {
        let mut seen = lock(&self.state);
        seen.progress.phase = phase.into();
        seen.progress.time_left = None;
        self.tell(&mut seen);
    }

    /// Whether somebody watches it now.
    fn is_watched(&self) -> bool {
        self.changed.receiver_count() > 0
    }

    /// Takes the bake's progress and its number of workers; returns at once while no watcher would be notified.
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

/// Passes a run's progress on to the watchers of its job, and their wish to cancel it back.
pub struct Watched<'a> {
    /// What the scene file and the output lack, so far.
    pub warnings: Vec<String>,
    live: &'a Live,
    workers: &'a Cluster,
    export: ExportSettings,
}

impl<'a> Watched<'a> {
    /// A run that has not begun; previews are written as `export` says.
    pub fn new(live: &'a Live, workers: &'a Cluster, export: &ExportSettings) -> Self {
        Self { warnings: vec![], live, workers, export: export.clone() }
    }
}

impl Observer for Watched<'_> {
    fn progress(&mut self, progress: &Progress) {
        self.live.set(progress, self.workers.status().workers);
    }

    fn is_cancelled(&mut self) -> bool {
        self.live.is_stopped()
    }

    fn wants_preview(&mut self) -> bool {
        self.live.preview.is_wanted(self.live.is_watched())
    }

    fn preview(&mut self, lit: LitMesh) {
        let number = self.live.preview.set(Arc::new(lit));
        let mut seen = lock(&self.live.state);
        seen.progress.present = number;
        self.live.tell(&mut seen);
    }
}

impl RunObserver for Watched<'_> {
    fn warn(&mut self, warnings: &[String]) {
        self.warnings.extend_from_slice(warnings);
    }

    fn imported(&mut self, scene: &Arc<Scene>) {
        let source = PreviewSource { scene: Arc::clone(scene), export: self.export.clone() };
        self.live.preview.begin(source);
    }

    fn exporting(&mut self) {
        self.live.enter(api::Phase::Export);
    }
}

fn api_phase(phase: Phase) -> api::Phase {
    match phase {
        Phase::Light => api::Phase::Light,
        Phase::Shoot => api::Phase::Shoot,
        Phase::Refine => api::Phase::Refine,
        Phase::Measure => api::Phase::Measure,
        Phase::FinalSolve => api::Phase::FinalSolve,
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
