//! The error of a bake by origin.

use serde::{Deserialize, Serialize};

/// Estimated relative L2 error of the radiosity over the reflecting surfaces, sqrt(int (B' - B)^2 / int B^2), split by origin. Where it is
/// more with the brightest .2 % of the area capped, it is that: else a lamp's housing would hide errors in all the room.
/// The parts are independent of each other: their squares add up.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct ErrorBudget {
    /// Unshot light and its interreflection. The bake's `unshot_bound` is its bound.
    pub unshot: f64,
    /// Noise of sampled visibility: standard error, from the spread between halves of the rays. 0 where all visibility is exact.
    pub visibility: f64,
    /// Arithmetic of form factors: mean quadrature error, and rounding of stored rows.
    pub form_factors: f64,
    /// The mesh: receivers and shooters.
    pub mesh: f64,
    /// Interpolation between vertices: measured at validation samples.
    pub receivers: f64,
    /// Shares that count as wholes, each with one radiosity: measured at validation samples, against the light of the refined mesh.
    pub shooters: f64,
    /// All parts.
    pub total: f64,
}

/// Noise at a random point of a triangle over that of its vertices: mean of the sum of squared interpolation weights.
pub const INTERPOLATED_NOISE: f64 = 0.5;

/// Part of misplaced light that comes back after reflection: transfer in a room evens out fine patterns.
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

/// Part of the error asked for that rounded factors may take.
const PART_OF_ROUNDING: f64 = 0.1;

/// Rounding of factors at which a scene of this largest reflectance keeps to its part of an error, at light that stays between few
/// shares. Elsewhere rounding errors cancel.
#[must_use]
pub fn most_rounding(error: f64, reflectance: f64) -> f64 {
    PART_OF_ROUNDING * error * (1.0 - reflectance) / ROUNDED
}

impl ErrorBudget {
    /// Adds up the parts.
    #[must_use]
    pub fn new(unshot: f64, visibility: f64, form_factors: f64, receivers: f64, shooters: f64) -> Self {
        let mesh = receivers.hypot(shooters);
        let total = mesh.hypot(visibility).hypot(form_factors).hypot(unshot);
        Self { unshot, visibility, form_factors, mesh, receivers, shooters, total }
    }

    /// The same where the output interpolates between fewer vertices.
    #[must_use]
    pub fn with_simplification(&self, difference: f64) -> Self {
        let receivers = self.receivers.hypot(difference);
        Self::new(self.unshot, self.visibility, self.form_factors, receivers, self.shooters)
    }

    /// The same with another error of the shooters.
    #[must_use]
    pub fn with_shooters(&self, shooters: f64) -> Self {
        Self::new(self.unshot, self.visibility, self.form_factors, self.receivers, shooters)
    }

    /// All parts but the interpolation.
    #[must_use]
    pub fn without_receivers(&self) -> f64 {
        self.shooters.hypot(self.visibility).hypot(self.form_factors).hypot(self.unshot)
    }
}

/// Subtracts the noise from a measured error. The noise is itself an estimate, often too high: at most three quarters of the
/// square are attributed to it.
#[must_use]
pub fn without_noise(measured: f64, noise: f64) -> f64 {
    without(measured, noise).max(measured / 2.0)
}

/// Subtracts an independent error.
#[must_use]
pub fn without(all: f64, other: f64) -> f64 {
    (all * all - other * other).max(0.0).sqrt()
}
