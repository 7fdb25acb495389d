//! A control variate of the measured error.
//!
//! Most of the error of detailed scenes is that of direct light, and a few points by edges of shadows, or close to a lamp, hold most
//! of that: of some thousand points chance decides what is found. Direct light costs little, though. At the points the squares of
//! its error are taken from those of all light, which leaves what varies little; their mean over many more points is added again.

use glam::DVec3;

/// A mean over the area, and its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mean {
    pub value: f64,
    pub standard_error: f64,
}

impl Mean {
    /// The mean of values at points.
    pub fn of(values: &[f64]) -> Self {
        let count = values.len().max(1) as f64;
        let value = values.iter().sum::<f64>() / count;
        let variance = values.iter().map(|each| (each - value).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
        Self { value, standard_error: (variance / count).sqrt() }
    }
}

/// What many more points tell of direct light alone.
#[derive(Debug, Clone, PartialEq)]
pub struct Control {
    /// Error of the radiosity from direct light at the points.
    pub own: Vec<DVec3>,
    /// Its mean square over the further points.
    pub error: Mean,
    /// What is added to the mean square of the radiosity at the points.
    pub radiosity: f64,
}

impl Control {
    /// The mean square of errors at the points, given the squares of those and of the direct ones there by `squares`.
    pub fn mean_square(&self, errors: &[DVec3], squares: impl Fn(&[DVec3]) -> Vec<f64>) -> Mean {
        let own = squares(&self.own);
        let rest: Vec<f64> = squares(errors).into_iter().zip(own).map(|(all, own)| all - own).collect();
        let rest = Mean::of(&rest);
        Mean {
            value: rest.value + self.error.value,
            standard_error: rest.standard_error.hypot(self.error.standard_error),
        }
    }
}
