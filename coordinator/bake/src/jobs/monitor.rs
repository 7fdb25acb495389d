//! What a bake has had computed so far, and who is told of it.

use kernel::messages::RowStatistics;
use kernel::row::FinishedJob;

use crate::error::{BakeError, Result};
use crate::lit::LitMesh;
use crate::observer::{Observer, Phase, Progress, TimeParts};

/// Form factors are summed up in this unit: 2^-50, far below the rounding of a row.
const SUM_UNIT: f64 = 1.0 / (1_u64 << 50) as f64;

/// Progress and counters of a bake, with its observer.
pub struct Monitor<'a> {
    observer: &'a mut dyn Observer,
    progress: Progress,
    /// Counts of all different rows. Busy time includes rows made again.
    pub statistics: RowStatistics,
    /// Sums of all form factors and of their errors, in units of [`SUM_UNIT`]: jobs finish in any order, and only sums of
    /// integers are the same in all.
    factor_sums: [u128; 2],
    /// Times that a row was made again because it was not kept.
    pub rows_again: u64,
    /// Factors that are not 0, of all rows received.
    pub visible_factors: u64,
}

impl<'a> Monitor<'a> {
    /// Nothing so far.
    pub fn new(observer: &'a mut dyn Observer) -> Self {
        Self {
            observer,
            progress: Progress {
                phase: Phase::Light,
                unshot: 1.0,
                error: None,
                rows: 0,
                rows_needed: 0,
                rays: 0,
                vertices: 0,
                time: TimeParts::default(),
            },
            statistics: RowStatistics::default(),
            factor_sums: [0; 2],
            rows_again: 0,
            visible_factors: 0,
        }
    }

    /// Counts a finished job and reports progress. `again` tells which rows were made before. Returns the nanoseconds that
    /// it took.
    pub fn count(&mut self, finished: &FinishedJob, again: &[bool]) -> u64 {
        for (row, again) in finished.statistics.iter().zip(again) {
            self.count_row(row, *again);
        }
        self.visible_factors += finished.rows.iter().map(|row| row.count() as u64).sum::<u64>();
        self.observer.progress(&self.progress);
        finished.statistics.iter().map(|row| row.busy_nanoseconds).sum()
    }

    fn count_row(&mut self, row: &RowStatistics, again: bool) {
        self.progress.rows += 1;
        self.progress.rays += row.rays;
        self.statistics.busy_nanoseconds += row.busy_nanoseconds;
        if again {
            self.rows_again += 1;
            return;
        }
        self.statistics.rays += row.rays;
        self.statistics.pairs += row.pairs;
        self.statistics.factors += row.factors;
        self.statistics.occluded_pairs += row.occluded_pairs;
        self.statistics.sampled_pairs += row.sampled_pairs;
        for (sum, part) in self.factor_sums.iter_mut().zip([row.factor_sum, row.factor_error_sum]) {
            *sum += (part / SUM_UNIT) as u128;
        }
    }

    /// Mean relative error of the form factors' quadrature.
    pub fn factor_error(&self) -> f64 {
        let [factors, errors] = self.factor_sums.map(|sum| sum as f64);
        if factors > 0.0 { errors / factors } else { 0.0 }
    }

    /// Number of different rows made.
    pub fn rows_made(&self) -> u64 {
        self.progress.rows - self.rows_again
    }

    /// Announces that this number of rows will be needed in addition.
    pub fn expect_rows(&mut self, rows: u64) {
        self.progress.rows_needed = (self.progress.rows + rows).max(self.progress.rows_needed);
    }

    /// Begins a phase.
    pub fn enter(&mut self, phase: Phase, vertices: usize) {
        self.progress.phase = phase;
        self.progress.vertices = vertices;
        self.observer.progress(&self.progress);
    }

    /// Sets the unshot flux, relative to the reflected flux.
    pub fn set_unshot(&mut self, unshot: f64) {
        self.progress.unshot = unshot;
    }

    /// Sets how the wall time divides so far.
    pub fn set_time(&mut self, time: TimeParts) {
        self.progress.time = time;
    }

    /// How the wall time divides so far.
    pub fn time(&self) -> TimeParts {
        self.progress.time
    }

    /// Sets the error of the present solution, once it is known.
    pub fn set_error(&mut self, error: Option<f64>) {
        self.progress.error = error;
    }

    /// Returns an error once the bake is cancelled.
    pub fn check(&mut self) -> Result<()> {
        if self.observer.is_cancelled() { Err(BakeError::Cancelled) } else { Ok(()) }
    }

    /// Hands a preview to the observer, if it wants one. The light of a group alone is no preview of the bake.
    pub fn preview(&mut self, lit: impl FnOnce() -> LitMesh) {
        if self.progress.phase != Phase::Groups && self.observer.wants_preview() {
            self.observer.preview(lit());
        }
    }
}
