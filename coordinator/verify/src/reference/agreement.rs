//! One reference against another of the same points.

use glam::DVec3;

use super::ReferencePoint;

/// How well two references of the same points agree, in standard errors of their difference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Agreement {
    /// Part of all values (three channels of every point) within 3 standard errors; 0.995 of them would be, were both
    /// references of 32 groups.
    pub within_3_sigma: f64,
    /// Mean of the differences in standard errors: 0 without bias.
    pub mean_sigma: f64,
    /// Root mean square of the differences in standard errors: 1 if the errors are what they claim to be.
    pub rms_sigma: f64,
    /// Sum of the radiosity over the other's.
    pub energy_ratio: f64,
    /// Standard error of the energy ratio.
    pub energy_ratio_error: f64,
}

impl Agreement {
    /// Compares two references; points are matched by their order.
    #[must_use]
    pub fn of(points: &[ReferencePoint], others: &[ReferencePoint]) -> Self {
        let pairs = || points.iter().zip(others);
        let values = |of: fn(&ReferencePoint) -> DVec3| {
            move |(a, b): (&ReferencePoint, &ReferencePoint)| {
                of(a).to_array().into_iter().zip(of(b).to_array()).collect::<Vec<_>>()
            }
        };
        let radiosities: Vec<(f64, f64)> = pairs().flat_map(values(|point| point.radiosity)).collect();
        let errors: Vec<(f64, f64)> = pairs().flat_map(values(|point| point.standard_error)).collect();
        let deviations: Vec<f64> = radiosities
            .iter()
            .zip(&errors)
            .map(|((a, b), (error, other))| {
                // Where nothing is random, as in the dark, equal values are no deviation.
                if a == b { 0.0 } else { (a - b) / error.hypot(*other) }
            })
            .collect();
        let count = deviations.len() as f64;
        let total: f64 = radiosities.iter().map(|(a, _)| a).sum();
        let other: f64 = radiosities.iter().map(|(_, b)| b).sum();
        // The channels of a point come from the same paths: their errors add up.
        let variance: f64 = pairs()
            .map(|(a, b)| {
                let [own, their] = [a, b].map(|point| point.standard_error.element_sum());
                own * own + their * their
            })
            .sum();
        Self {
            within_3_sigma: deviations.iter().filter(|z| z.abs() <= 3.0).count() as f64 / count,
            mean_sigma: deviations.iter().sum::<f64>() / count,
            rms_sigma: (deviations.iter().map(|z| z * z).sum::<f64>() / count).sqrt(),
            energy_ratio: total / other,
            energy_ratio_error: variance.sqrt() / other,
        }
    }
}
