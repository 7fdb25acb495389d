//! Measuring the error of a solution.

use glam::DVec3;

use super::refine::Refined;
use super::solved::Solved;
use super::validation::Validation;
use crate::context::Context;
use crate::error::Result;
use crate::error_budget::{
    ErrorBudget, INTERPOLATED_NOISE, RETURNING, rounding_error, without, without_noise,
};
use crate::mesh::PatchId;
use crate::observer::Phase;
use crate::refinement::{FIRST, Obstacle, SamplePoints};

/// What is left of the error that was measured of the shooters when the leaves of the refined mesh become the shares. Where light
/// changes, their edges are half as long, though there may be few more of them. The error falls with the square of the edge, next to
/// contacts with the edge.
const LEFT: f64 = 0.4;

/// Leaves per share where all edges are half as long.
const LEAVES_PER_HALVING: f64 = 4.0;

/// A bake whose error is known.
pub struct Measured {
    pub solved: Solved,
    /// Why refinement ended before its limit was met.
    pub obstacle: Option<Obstacle>,
    pub error: ErrorBudget,
    /// What the error of the shooters is at least, by its own standard error.
    pub shooters_at_least: f64,
    /// The part of the receivers' error that is due to light between gather points, not to the mesh,
    pub between: f64,
    /// and the leaves in which it was found, with errors of the radiosity.
    pub found_between: Vec<(PatchId, DVec3)>,
    /// Where it was measured, with the light there.
    pub validation: SamplePoints,
}

impl Refined {
    /// Estimates the error of the solution. That of the shooters, and what it is at least, are measured unless they are given: they
    /// hardly change from round to round, and cost a row for each leaf.
    #[tracing::instrument(skip_all)]
    pub fn measure(self, cx: &mut Context, shooters: Option<[f64; 2]>) -> Result<Measured> {
        let Self { mut solved, obstacle } = self;
        cx.client.monitor.enter(Phase::Measure, solved.mesh.mesh.vertices.len());
        let fitted = solved.fitted();
        let prediction = solved.predict(cx, &fitted);
        solved.rounds_measured += 1;
        let Validation { samples: validation, receivers, found_between } =
            solved.validate(cx, &fitted, prediction.parts())?;
        let noise = solved.noise();
        let reflectance = solved.mean_reflectance();
        let [receivers, receivers_at_least] =
            receivers.unwrap_or([solved.found_per_predicted * prediction.relative(); 2]);
        let errors: Vec<DVec3> = found_between.iter().map(|(_, error)| *error).collect();
        let between = without_noise(validation.relative(&errors), noise);
        // As the next refinement will predict it.
        let prediction = if solved.measured.is_empty() { prediction } else { solved.predict(cx, &fitted) };
        if prediction.relative() > 0.0 && validation.count() > 0 {
            // Where few points hold most of it, chance would decide how far to refine.
            let of_mesh = without(receivers_at_least, between);
            solved.found_per_predicted = (of_mesh / prediction.relative()).clamp(0.2, 5.0);
        }
        let [shooters, shooters_at_least] = match shooters {
            Some(shooters) => shooters,
            None => solved.error_of_shooters(cx, &validation, &fitted)?,
        };
        let form_factors =
            cx.client.monitor.factor_error() + rounding_error(cx.client.precision().factor_rounding);
        let visibility = noise * INTERPOLATED_NOISE.sqrt();
        let unshot = solved.solution.residual / (1.0 - RETURNING * reflectance);
        let error = ErrorBudget::new(unshot, visibility, form_factors, receivers, shooters);
        tracing::debug!(?error, between, receivers_at_least, "measured");
        cx.client.monitor.set_error(Some(error.total));
        cx.end_step("measure");
        Ok(Measured { solved, obstacle, error, shooters_at_least, between, found_between, validation })
    }
}

impl Measured {
    /// Makes the leaves of the refined mesh the shares, and measures again.
    pub fn follow_mesh(self, cx: &mut Context) -> Result<Self> {
        let Self { mut solved, obstacle, error, shooters_at_least, .. } = self;
        let part = part_left(solved.leaves_per_share());
        solved.shooters_expected = [error.shooters, shooters_at_least].map(|error| error * part);
        solved.follow_mesh(cx)?;
        let shooters = Some(solved.shooters_expected);
        Refined { solved, obstacle }.measure(cx, shooters)
    }

    /// Measures the error of the shooters.
    #[tracing::instrument(skip_all)]
    pub fn measure_shooters(mut self, cx: &mut Context) -> Result<Self> {
        let fitted = self.solved.fitted();
        let [shooters, at_least] = self.solved.error_of_shooters(cx, &self.validation, &fitted)?;
        self.error = self.error.with_shooters(shooters);
        self.shooters_at_least = at_least;
        cx.client.monitor.set_error(Some(self.error.total));
        cx.end_step("measure");
        Ok(self)
    }
}

impl Solved {
    /// Relative error of the light of shares that count as wholes: against that of the leaves of the refined mesh, each with its own
    /// mean, at all samples, or at the first where leaves cost rows. Returns what it is at least, too.
    fn error_of_shooters(
        &self,
        cx: &mut Context,
        samples: &SamplePoints,
        irradiance: &[DVec3],
    ) -> Result<[f64; 2]> {
        let most = if self.rows.source.leaves_cost_rows() { FIRST } else { usize::MAX };
        let count = samples.count().min(most);
        if count == 0 {
            return Ok([0.0; 2]);
        }
        let receivers = samples.receivers(count);
        let light = (irradiance, &*self.exposed, &self.solution.middles);
        let light = self.rows.source.light_of_leaves(cx, &self.mesh, &receivers, light)?;
        let differences = samples.differences(&light.irradiance);
        let at_least = samples.relative_at_least(&differences);
        let noise = light.rows.map_or(0.0, |rows| self.noise().hypot(samples.noise(rows.into_iter(), count)));
        let all =
            |differences| without_noise(differences, noise) / (1.0 - RETURNING * self.mean_reflectance());
        let [measured, at_least] = [samples.relative(&differences), at_least].map(all);
        let [expected, expected_at_least] = self.shooters_expected;
        Ok([measured.max(expected), at_least.max(expected_at_least)])
    }
}

/// What is left of the error that was measured of the shooters once the leaves are the shares, by the number of leaves per share.
fn part_left(leaves_per_share: f64) -> f64 {
    LEFT.powf(leaves_per_share.log(LEAVES_PER_HALVING).max(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_leaves_leave_less_of_the_error_of_the_shooters() {
        // Few more leaves are where light changes.
        assert!((part_left(1.2) - LEFT).abs() < 1e-12);
        assert!((part_left(4.0) - LEFT).abs() < 1e-12);
        // Edges a quarter as long are halved twice.
        assert!((part_left(16.0) - LEFT * LEFT).abs() < 1e-12);
    }
}
