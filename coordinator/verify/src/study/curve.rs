//! Medians of equal runs, and the time at which a curve meets an error.

use super::{Curve, Measurement, Part, Setting};
use crate::picture::Flip;

/// Errors under this, .001 %, count as this: no reference is so exact, and an error of 0 has no logarithm.
pub(super) const LEAST_ERROR: f64 = 1e-5;

/// The runs of one setting: medians of their figures.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// How they were baked.
    pub setting: Setting,
    /// Wall time of the whole program.
    pub seconds: f64,
    /// Relative L2 error of the radiosity against the reference.
    pub error: f64,
    /// The same as the bake estimated it.
    pub estimated_error: f64,
    /// Radiosity over the reference's.
    pub energy_ratio: f64,
    /// The error that the eye sees; none where no pictures were made.
    pub flip: Option<Flip>,
    /// Vertices of the refined mesh.
    pub vertices: f64,
    /// Rows made.
    pub rows: f64,
    /// Form factors computed.
    pub factors: f64,
    /// Rays cast.
    pub rays: f64,
    /// Seconds that workers computed, over all threads.
    pub busy_seconds: f64,
    /// Largest memory of the process; none where the system does not say.
    pub peak_memory_bytes: Option<f64>,
}

/// The points of a curve, in the order of the plan: from coarse to fine. Empty where nothing was run.
#[must_use]
pub fn points(measurements: &[Measurement], curve: Curve) -> Vec<Point> {
    let of_curve: Vec<&Measurement> = measurements
        .iter()
        .filter(|m| m.step.part == Part::Curves && m.step.setting.curve == curve)
        .collect();
    let mut settings: Vec<Setting> = vec![];
    for measurement in &of_curve {
        if !settings.contains(&measurement.step.setting) {
            settings.push(measurement.step.setting);
        }
    }
    settings
        .into_iter()
        .filter_map(|setting| {
            let equal: Vec<_> =
                of_curve.iter().copied().filter(|measurement| measurement.step.setting == setting).collect();
            point(setting, &equal)
        })
        .collect()
}

/// Medians of equal runs; `None` where there are none.
fn point(setting: Setting, equal: &[&Measurement]) -> Option<Point> {
    let figure = |of: fn(&Measurement) -> f64| median(&equal.iter().map(|&run| of(run)).collect::<Vec<_>>());
    let memories: Vec<f64> =
        equal.iter().filter_map(|run| run.report.peak_memory_bytes).map(|bytes| bytes as f64).collect();
    let flips = |of: fn(&Flip) -> f64| {
        median(&equal.iter().filter_map(|run| run.flip.as_ref()).map(of).collect::<Vec<_>>())
    };
    let flip = flips(|flip| flip.mean).zip(flips(|flip| flip.p99)).map(|(mean, p99)| Flip { mean, p99 });
    Some(Point {
        setting,
        flip,
        seconds: figure(|run| run.seconds)?,
        error: figure(|run| run.score.relative_l2)?,
        estimated_error: figure(|run| run.report.bake.error.total)?,
        energy_ratio: figure(|run| run.score.energy_ratio)?,
        vertices: figure(|run| run.report.bake.vertices as f64)?,
        rows: figure(|run| run.report.bake.rows as f64)?,
        factors: figure(|run| run.report.bake.factors as f64)?,
        rays: figure(|run| run.report.bake.rays as f64)?,
        busy_seconds: figure(|run| run.report.bake.busy_seconds)?,
        peak_memory_bytes: median(&memories),
    })
}

/// The median: of an even number of values the mean of the middle two. `None` of none. NaN counts as larger than any number.
#[must_use]
pub fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let upper = *sorted.get(sorted.len() / 2)?;
    Some(if sorted.len() % 2 == 1 { upper } else { f64::midpoint(sorted[sorted.len() / 2 - 1], upper) })
}

/// When a curve meets an error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TimeTo {
    /// Already at its coarsest point: its time, or that of a finer one that was faster.
    AtMost(f64),
    /// After this time, in seconds.
    Seconds(f64),
    /// Nowhere; its least error is this (NaN where none is a number).
    NotReached(f64),
}

/// The least time at which a curve, with its points from coarse to fine, meets an error; never more for a larger error. Between
/// two points the logarithm of the error is taken to be linear in that of the time: exact where the error is a power of the
/// time.
#[must_use]
pub fn time_to(error: f64, points: &[Point]) -> TimeTo {
    let met = |point: &&Point| point.error <= error;
    let at_points = points.iter().filter(met).map(|point| point.seconds);
    let crossings = points.windows(2).filter_map(|pair| {
        let crossed = met(&&pair[0]) != met(&&pair[1]);
        crossed.then(|| crossing(&pair[0], &pair[1], error)).flatten()
    });
    match at_points.chain(crossings).reduce(f64::min) {
        Some(least) if points.first().is_some_and(|first| met(&first)) => TimeTo::AtMost(least),
        Some(least) => TimeTo::Seconds(least),
        None => TimeTo::NotReached(points.iter().map(|point| point.error).fold(f64::NAN, f64::min)),
    }
}

/// The time between two points at which this error lies; `None` where that is not known.
fn crossing(from: &Point, to: &Point, error: f64) -> Option<f64> {
    let log = |error: f64| error.max(LEAST_ERROR).ln();
    let fall = log(from.error) - log(to.error);
    if from.error.is_nan() || to.error.is_nan() || fall == 0.0 {
        return None;
    }
    let part = (log(from.error) - log(error)) / fall;
    Some((from.seconds.ln() * (1.0 - part) + to.seconds.ln() * part).exp())
}

#[cfg(test)]
mod tests {
    use super::super::test_measurements::{measurement, power_laws};
    use super::*;

    #[test]
    fn median_is_the_middle_or_between_the_middle_two() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[3.0]), Some(3.0));
        assert_eq!(median(&[5.0, 1.0, 100.0, 2.0, 3.0]), Some(3.0));
        assert_eq!(median(&[4.0, 1.0, 2.0, 100.0]), Some(3.0));
        assert_eq!(median(&[f64::NAN, 1.0, 2.0]), Some(2.0));
    }

    #[test]
    fn points_are_medians_in_the_order_of_the_plan() {
        let mut runs = vec![];
        for seconds in [9.0, 2.0, 3.0] {
            runs.push(measurement(Curve::Depth, Some(0.1), seconds, 0.1));
            runs.push(measurement(Curve::Depth, Some(0.01), 10.0 * seconds, 0.02));
        }
        let mut seeds = measurement(Curve::Depth, Some(0.1), 1.0, 0.5);
        seeds.step.part = Part::Seeds;
        runs.push(seeds);
        let found = points(&runs, Curve::Depth);
        let figures: Vec<_> = found.iter().map(|point| (point.seconds, point.error)).collect();
        assert_eq!(figures, [(3.0, 0.1), (30.0, 0.02)]);
        assert_eq!(found[0].peak_memory_bytes, Some(f64::from(50 << 20)));
        assert_eq!(points(&runs, Curve::Rays), []);
    }

    #[test]
    fn power_laws_are_interpolated_exactly() {
        let runs = power_laws();
        for (curve, exponent) in [(Curve::Together, 1.0), (Curve::Depth, 0.75), (Curve::Threshold, 0.5)] {
            let points = points(&runs, curve);
            for error in [0.1, 0.05, 0.041] {
                let TimeTo::Seconds(seconds) = time_to(error, &points) else { panic!("{curve:?} {error}") };
                let exact = (0.16_f64 / error).powf(1.0 / exponent);
                assert!((seconds / exact - 1.0).abs() < 1e-12, "{curve:?} {error}: {seconds}, not {exact}");
            }
        }
    }

    #[test]
    fn errors_beside_the_curve_are_not_extrapolated() {
        let points = points(&power_laws(), Curve::Together);
        assert_eq!(time_to(0.2, &points), TimeTo::AtMost(1.0));
        assert_eq!(time_to(0.005, &points), TimeTo::NotReached(0.01));
        assert!(matches!(time_to(0.1, &[]), TimeTo::NotReached(least) if least.is_nan()));
    }

    #[test]
    fn the_least_time_counts_and_what_is_no_number_meets_nothing() {
        let curve = |errors: &[f64]| -> Vec<Point> {
            let runs: Vec<_> = errors
                .iter()
                .enumerate()
                .map(|(i, &error)| {
                    measurement(Curve::Depth, Some(1.0 / i as f64), 4.0_f64.powi(i as i32), error)
                })
                .collect();
            points(&runs, Curve::Depth)
        };
        let seconds = |error: f64, errors: &[f64]| match time_to(error, &curve(errors)) {
            TimeTo::Seconds(seconds) => seconds,
            other => panic!("{other:?}"),
        };
        assert!((seconds(0.1, &[0.2, 0.05, 0.3, 0.01]) - 2.0).abs() < 1e-12);
        // A finer setting that was faster.
        let mut points = curve(&[0.3, 0.2, 0.01]);
        points[2].seconds = 0.5;
        assert_eq!(time_to(0.01, &points), TimeTo::Seconds(0.5));
        points[0].error = 0.05;
        assert_eq!(time_to(0.1, &points), TimeTo::AtMost(0.5));
        assert_eq!(seconds(0.1, &[f64::NAN, 0.05]), 4.0);
        assert_eq!(time_to(0.1, &curve(&[0.3, f64::NAN])), TimeTo::NotReached(0.3));
        // From .1 to nothing: half of the decades down to the least error that counts.
        assert!((seconds(0.001, &[0.1, 0.0]) - 2.0).abs() < 1e-12);
        assert_eq!(seconds(1e-6, &[2e-6, 0.0]), 4.0);
    }
}
