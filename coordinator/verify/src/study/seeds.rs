//! Bias and spread over seeds.

use super::{Measurement, Part, Setting};

/// Mean of a figure over seeds, and how it varies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// Standard deviation from seed to seed.
    pub deviation: f64,
    /// Standard error of the mean.
    pub standard_error: f64,
}

impl Spread {
    /// Of two values or more; NaN for the deviation of fewer.
    fn of(values: &[f64]) -> Self {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
        let deviation = (squares / (count - 1.0)).sqrt();
        Self { mean, deviation, standard_error: deviation / count.sqrt() }
    }
}

/// The same setting with different seeds.
#[derive(Debug, Clone, PartialEq)]
pub struct SeedFigures {
    /// How they were baked.
    pub setting: Setting,
    /// Seeds.
    pub seeds: usize,
    /// Energy ratio less 1: the mean is the bias.
    pub bias: Spread,
    /// Relative L2 error against the reference.
    pub error: Spread,
    /// Estimated error over measured error: 1 would be right.
    pub estimate: Spread,
}

/// The figures of every setting that was run with different seeds, in the order of the plan.
#[must_use]
pub fn seed_figures(measurements: &[Measurement]) -> Vec<SeedFigures> {
    let seeded: Vec<&Measurement> = measurements.iter().filter(|m| m.step.part == Part::Seeds).collect();
    seeded
        .chunk_by(|a, b| a.step.setting == b.step.setting)
        .map(|equal| {
            let figure = |of: fn(&Measurement) -> f64| {
                Spread::of(&equal.iter().map(|&run| of(run)).collect::<Vec<_>>())
            };
            SeedFigures {
                setting: equal[0].step.setting,
                seeds: equal.len(),
                bias: figure(|run| run.score.energy_ratio - 1.0),
                error: figure(|run| run.score.relative_l2),
                estimate: figure(|run| run.report.bake.error.total / run.score.relative_l2),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::Curve;
    use super::super::test_measurements::measurement;
    use super::*;

    #[test]
    fn bias_and_spread_are_those_computed_by_hand() {
        let seed = |curve, seed: u64, ratio: f64, error: f64| {
            let mut run = measurement(curve, None, 1.0, error);
            run.step.part = Part::Seeds;
            run.step.seed = seed;
            run.score.energy_ratio = ratio;
            run
        };
        let runs = [
            measurement(Curve::Defaults, None, 1.0, 0.5),
            seed(Curve::Defaults, 0, 1.01, 0.01),
            seed(Curve::Defaults, 1, 1.02, 0.02),
            seed(Curve::Defaults, 2, 1.03, 0.02),
            seed(Curve::Rays, 0, 0.98, 0.04),
            seed(Curve::Rays, 1, 0.98, 0.04),
        ];
        let figures = seed_figures(&runs);
        assert_eq!(figures.len(), 2);
        assert_eq!((figures[0].seeds, figures[1].seeds), (3, 2));
        let near = |value: f64, expected: f64| {
            assert!((value - expected).abs() < 1e-12, "{value} is not {expected}");
        };
        near(figures[0].bias.mean, 0.02);
        near(figures[0].bias.deviation, 0.01);
        near(figures[0].bias.standard_error, 0.01 / 3.0_f64.sqrt());
        near(figures[0].error.mean, 0.05 / 3.0);
        near(figures[0].error.deviation, (1e-4_f64 / 3.0).sqrt());
        // The estimate is 1 % in all runs: over 1, 2 and 2 %.
        near(figures[0].estimate.mean, 2.0 / 3.0);
        near(figures[1].bias.mean, -0.02);
        near(figures[1].bias.deviation, 0.0);
    }
}
