//! Where the error of a bake comes from.

use serde::{Deserialize, Serialize};

/// Estimated relative L2 error of the radiosity over the reflecting surfaces, sqrt(int (B' - B)^2 / int B^2), split by origin.
/// The parts are independent of each other: their squares add up.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct ErrorBudget {
    /// Light not yet shot, and what reflection would make of it. The bake's `unshot_bound` is the worst that it can be.
    pub unshot: f64,
    /// Noise of visibility that was sampled with rays: standard error, from the spread between halves of the rays. 0 where all
    /// visibility was computed.
    pub visibility: f64,
    /// Arithmetic of the form factors: mean error of the rules that were used for them, and the rounding of stored rows.
    pub form_factors: f64,
    /// Of the mesh, in all: receivers and shooters.
    pub mesh: f64,
    /// Interpolation between vertices: measured at random points between them.
    pub receivers: f64,
    /// Constant radiosity of each share, where it varies: measured at random points, against the light of the refined mesh.
    pub shooters: f64,
    /// All of them.
    pub total: f64,
}

/// Mean square of the weights with which a random point of a triangle takes the noise of its three vertices.
pub const INTERPOLATED_NOISE: f64 = 0.5;

/// Part of misplaced light that comes back after reflection: transfer between the surfaces of
/// a room evens out the finer patterns and keeps the coarse ones.
pub const RETURNING: f64 = 0.5;

/// Rows are stored in f32.
const STORED: f64 = f32::EPSILON as f64 / 2.0;

/// Standard deviation of a rounded factor, at most, over the largest error that rounding may have: sqrt(1/6) for a place at random
/// between two numbers, times sqrt(.75 / ln 4) for where factors lie between two powers of two.
const ROUNDED: f64 = 0.3;

/// Error of the light from one shooter, when factors are rounded so. That from several cancels in part.
#[must_use]
pub fn rounding_error(factor_rounding: f64) -> f64 {
    STORED.max(ROUNDED * factor_rounding)
}

impl ErrorBudget {
    /// Adds up the parts.
    #[must_use]
    pub fn new(unshot: f64, visibility: f64, form_factors: f64, receivers: f64, shooters: f64) -> Self {
        let mesh = receivers.hypot(shooters);
        let total = mesh.hypot(visibility).hypot(form_factors).hypot(unshot);
        Self { unshot, visibility, form_factors, mesh, receivers, shooters, total }
    }

    /// What all parts but the interpolation amount to.
    #[must_use]
    pub fn without_receivers(&self) -> f64 {
        self.shooters.hypot(self.visibility).hypot(self.form_factors).hypot(self.unshot)
    }
}

/// What is left of a measured error without its noise. The noise is itself an estimate, often too high: no more than three
/// quarters of the square are taken for it.
#[must_use]
pub fn without_noise(measured: f64, noise: f64) -> f64 {
    without(measured, noise).max(measured / 2.0)
}

/// What is left of an error when an independent one is taken out.
#[must_use]
pub fn without(all: f64, other: f64) -> f64 {
    (all * all - other * other).max(0.0).sqrt()
}
