use std::sync::Arc;
use std::time::{Duration, Instant};

use bake::{Observer, Progress};
use cluster::metrics::Metrics;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use pipeline::run::RunObserver;
use scene::Scene;

use super::console::say;

/// Between plain lines of one step, where standard error is not a terminal.
const PLAIN_INTERVAL: Duration = Duration::from_secs(5);

/// Between two looks of the bar.
const BAR_INTERVAL: Duration = Duration::from_millis(100);

/// The progress bar; plain lines now and then where there is no terminal.
pub struct ProgressLine {
    bar: ProgressBar,
    started: Instant,
    last: Option<(Instant, &'static str)>,
}

impl ProgressLine {
    /// Shows an empty bar.
    pub fn new() -> Self {
        let bar = ProgressBar::with_draw_target(Some(1), ProgressDrawTarget::stderr_with_hz(10));
        let template = "{prefix:11} [{bar:32}] {msg}";
        // The template is fixed and right.
        bar.set_style(
            ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()),
        );
        Self { bar, started: Instant::now(), last: None }
    }

    /// Shows how far the bake has come.
    pub fn show(&mut self, progress: &Progress) {
        let step = progress.phase.name();
        self.show_step(step, (progress.rows, progress.rows_needed), |elapsed| {
            let part = progress.rows as f64 / progress.rows_needed.max(1) as f64;
            let left = if part > 0.0 { elapsed * (1.0 - part) / part } else { 0.0 };
            format!(
                "unshot {:.2} % · rows {}/{} · {} rays/s · {} vertices · {:.0} s left",
                progress.unshot * 100.0,
                progress.rows,
                progress.rows_needed,
                short(progress.rays as f64 / elapsed.max(1e-9)),
                progress.vertices,
                left,
            )
        });
    }

    /// Shows a step with so many of its rows done; what there is to say is asked for where it is time to, with the seconds that have
    /// passed.
    pub fn show_step(
        &mut self,
        step: &'static str,
        (rows, needed): (u64, u64),
        message: impl FnOnce(f64) -> String,
    ) {
        // Rows come by the ten thousand, and each would be a line.
        let interval = if self.bar.is_hidden() { PLAIN_INTERVAL } else { BAR_INTERVAL };
        let is_due = |(time, last): (Instant, &str)| last != step || time.elapsed() >= interval;
        if !self.last.is_none_or(is_due) {
            return;
        }
        self.last = Some((Instant::now(), step));
        let message = message(self.started.elapsed().as_secs_f64());
        if self.bar.is_hidden() {
            say(format_args!("{step}: {message}"));
            return;
        }
        self.bar.set_prefix(step);
        self.bar.set_length(needed);
        self.bar.set_position(rows);
        self.bar.set_message(message);
    }

    /// Removes the bar: the table follows.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// Shows a run on standard error and to Prometheus.
pub struct Shown {
    line: ProgressLine,
    metrics: Metrics,
}

impl Shown {
    /// Shows nothing yet.
    pub fn new(metrics: &Metrics) -> Self {
        Self { line: ProgressLine::new(), metrics: metrics.clone() }
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
            say(format_args!("warning: {warning}"));
        }
    }

    fn imported(&mut self, _scene: &Arc<Scene>) {
        // Rates and the time left are those of the bake alone.
        self.line = ProgressLine::new();
    }

    fn exporting(&mut self) {
        self.line.finish();
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
