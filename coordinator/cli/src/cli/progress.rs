use std::fmt::Display;
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use bake::{Observer, Progress, RATED, time_left, time_of_rows_left};
use cluster::metrics::{BakeMetrics, Metrics};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use pipeline::run::RunObserver;
use scene::Scene;

use super::console::say;

/// Least time between two lines, where standard error is not a terminal.
const PLAIN_INTERVAL: Duration = Duration::from_secs(1);

/// Between two looks of the bar.
const BAR_INTERVAL: Duration = Duration::from_millis(100);

/// What was said so long ago is not what is done now.
const STALE: Duration = Duration::from_millis(1500);

/// The progress bar, or a line each second where there is no terminal. It goes on by itself through steps that say nothing.
pub struct ProgressLine {
    state: Arc<Mutex<State>>,
    /// Ends the thread that goes on when it is dropped.
    _ticking: Sender<()>,
}

struct State {
    bar: ProgressBar,
    /// Rates and the time left count from here.
    started: Instant,
    /// Whether a bake has asked for rows.
    has_rows: bool,
    step: &'static str,
    entered: Instant,
    /// What there was to say last, and when.
    message: Option<(Instant, String)>,
    shown: Instant,
    /// Whether a step has said something of itself: the first word waits for nothing.
    has_spoken: bool,
    is_over: bool,
}

impl ProgressLine {
    /// Begins with this step.
    pub fn new(step: &'static str) -> Self {
        let bar = ProgressBar::with_draw_target(Some(1), ProgressDrawTarget::stderr_with_hz(10));
        let template = "{prefix:11} [{bar:32}] {msg}";
        // The template is fixed and right.
        bar.set_style(
            ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()),
        );
        let now = Instant::now();
        // The first line comes soon.
        let shown = now.checked_sub(PLAIN_INTERVAL / 2).unwrap_or(now);
        let state = State {
            bar,
            started: now,
            has_rows: false,
            step,
            entered: now,
            message: None,
            shown,
            has_spoken: false,
            is_over: false,
        };
        let state = Arc::new(Mutex::new(state));
        let (ticking, ended) = mpsc::channel();
        let ticked = Arc::clone(&state);
        // Without it, silent steps are silent.
        let _ = thread::Builder::new().name("progress".into()).spawn(move || {
            while ended.recv_timeout(BAR_INTERVAL) == Err(RecvTimeoutError::Timeout) {
                lock(&ticked).tick();
            }
        });
        Self { state, _ticking: ticking }
    }

    /// Shows how far the bake has come; before it asks for rows there is only the step to tell.
    pub fn show(&self, progress: &Progress) {
        let step = progress.phase.name();
        if progress.rows_needed == 0 {
            return self.enter(step);
        }
        lock(&self.state).begin_rows();
        self.show_step(step, (progress.rows, progress.rows_needed), |elapsed| {
            let speed = if elapsed < RATED {
                String::new()
            } else {
                let rates = [progress.rows, progress.rays].map(|count| count as f64 / elapsed.as_secs_f64());
                let left = time_of_rows_left(elapsed, progress.rows, progress.rows_needed);
                format!(" · {}{}", rate(rates), words(left))
            };
            format!(
                "unshot {:.2} % · rows {}/{} · {} vertices{speed}",
                progress.unshot * 100.0,
                progress.rows,
                progress.rows_needed,
                progress.vertices,
            )
        });
    }

    /// Shows a step of which so much is done; what there is to say is asked for where it is time to, with the time since
    /// [`Self::restart`], or since a bake first asked for rows.
    pub fn show_step(
        &self,
        step: &'static str,
        (done, all): (u64, u64),
        message: impl FnOnce(Duration) -> String,
    ) {
        let mut state = lock(&self.state);
        state.enter(step);
        let interval = if state.bar.is_hidden() { PLAIN_INTERVAL } else { BAR_INTERVAL };
        if state.message.as_ref().is_some_and(|(said, _)| said.elapsed() < interval) {
            return;
        }
        state.message = Some((Instant::now(), message(state.started.elapsed())));
        state.bar.set_length(all);
        state.bar.set_position(done);
        state.show();
    }

    /// Shows so many done of `all`, and the time left.
    pub fn show_part(&self, step: &'static str, (done, all): (u64, u64), what: &str) {
        self.show_step(step, (done, all), |elapsed| {
            format!("{done}/{all} {what}{}", words(time_left(elapsed, done, all)))
        });
    }

    /// Enters a step that cannot say how far it is.
    pub fn enter(&self, step: &'static str) {
        lock(&self.state).enter(step);
    }

    /// Counts the time left from now on.
    pub fn restart(&self) {
        lock(&self.state).started = Instant::now();
    }

    /// Tells the user a line.
    pub fn say(&self, line: impl Display) {
        lock(&self.state).bar.suspend(|| say(line));
    }

    /// Removes the bar: the table follows.
    pub fn finish(&self) {
        let mut state = lock(&self.state);
        state.is_over = true;
        state.bar.finish_and_clear();
    }
}

impl Drop for ProgressLine {
    fn drop(&mut self) {
        self.finish();
    }
}

impl State {
    /// The rates of a bake are those since it first asked for rows.
    fn begin_rows(&mut self) {
        if !self.has_rows {
            (self.has_rows, self.started) = (true, Instant::now());
        }
    }

    fn enter(&mut self, step: &'static str) {
        if self.step != step {
            (self.step, self.entered, self.message) = (step, Instant::now(), None);
        }
    }

    /// Shows what is due, and that something is done where nothing else says so.
    fn tick(&mut self) {
        let is_stale = self.message.as_ref().is_none_or(|(said, _)| said.elapsed() >= STALE);
        if is_stale || self.bar.is_hidden() {
            self.show();
        }
    }

    fn show(&mut self) {
        let fresh = self.message.as_ref().filter(|(said, _)| said.elapsed() < STALE);
        let text = match fresh {
            Some((_, text)) => text.clone(),
            None => format!("{:.0} s", self.entered.elapsed().as_secs_f64()),
        };
        if self.is_over {
            return;
        }
        if !self.bar.is_hidden() {
            self.bar.set_prefix(self.step);
            self.bar.set_message(text);
        } else if self.shown.elapsed() >= PLAIN_INTERVAL || (fresh.is_some() && !self.has_spoken) {
            self.has_spoken |= fresh.is_some();
            self.shown = Instant::now();
            say(format_args!("{}: {text}", self.step));
        }
    }
}

/// Rows and rays per second; exact visibility needs no rays.
pub fn rate([rows, rays]: [f64; 2]) -> String {
    let rows = format!("{} rows/s", short(rows));
    if rays > 0.0 { format!("{rows} · {} rays/s", short(rays)) } else { rows }
}

/// The time left, if it is known, as the end of a line.
fn words(left: Option<Duration>) -> String {
    left.map_or_else(String::new, |left| format!(" · {:.0} s left", left.as_secs_f64()))
}

fn lock(state: &Mutex<State>) -> MutexGuard<'_, State> {
    // What it protects is shown, and no more.
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Shows a run on standard error and to Prometheus.
pub struct Shown {
    line: ProgressLine,
    metrics: BakeMetrics,
}

impl Shown {
    /// The scene is read first.
    pub fn new(metrics: &Metrics) -> Self {
        Self { line: ProgressLine::new("import"), metrics: metrics.bake() }
    }
}

impl Observer for Shown {
    fn progress(&mut self, progress: &Progress) {
        self.metrics.progress(progress);
        self.line.show(progress);
    }
}

impl RunObserver for Shown {
    fn warn(&mut self, warnings: &[String]) {
        for warning in warnings {
            self.line.say(format_args!("warning: {warning}"));
        }
    }

    fn imported(&mut self, _scene: &Arc<Scene>) {
        self.line.enter("mesh");
    }

    fn exporting(&mut self) {
        self.line.enter("export");
    }
}

/// A number with three digits and a letter.
pub fn short(value: f64) -> String {
    match value {
        v if v >= 1e9 => format!("{:.2} G", v * 1e-9),
        v if v >= 1e6 => format!("{:.2} M", v * 1e-6),
        v if v >= 1e3 => format!("{:.1} k", v * 1e-3),
        v => format!("{v:.0}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_rows_have_a_rate_without_rays() {
        assert_eq!(rate([1234.0, 0.0]), "1.2 k rows/s");
        assert_eq!(rate([17.0, 2.5e6]), "17 rows/s · 2.50 M rays/s");
    }
}
