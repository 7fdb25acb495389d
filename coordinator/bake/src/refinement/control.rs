//! A control variate of the measured error.
//!
//! Most of the error of detailed scenes is that of direct light, and a few points by edges of shadows, or close to a lamp, hold most
//! of that: of some thousand points chance decides what is found. Direct light costs little, though. At the points the squares of
//! its error are taken from those of all light, which leaves what varies little; their mean over many more points is added again.

use glam::DVec3;

use super::samples::{Mean, SamplePoints};
use crate::mesh::Mesh;

/// What many more points tell of direct light alone.
#[derive(Debug, Clone, PartialEq)]
pub struct Control {
    /// Error of the radiosity from direct light at the points.
    own: Vec<DVec3>,
    /// Its mean square over the further points.
    error: Mean,
    /// What is added to the mean square of the radiosity at the points.
    radiosity: f64,
}

impl Control {
    /// Compares direct light of two sets of points, both with their direct light, with that interpolated on the mesh.
    pub fn new(points: &SamplePoints, further: &SamplePoints, mesh: &Mesh, direct: &[DVec3]) -> Self {
        let errors = |of: &SamplePoints| -> Vec<DVec3> {
            of.compare_direct(mesh, direct).into_iter().map(|(_, error)| error).collect()
        };
        let radiosity = |of: &SamplePoints| of.mean_square(&of.direct_radiosity()).value;
        Self {
            own: errors(points),
            error: further.mean_square(&errors(further)),
            radiosity: radiosity(further) - radiosity(points),
        }
    }

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

    /// What is added to the mean square of the radiosity at the points.
    pub fn of_radiosity(&self) -> f64 {
        self.radiosity
    }
}
