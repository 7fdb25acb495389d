use glam::DVec3;
use rayon::prelude::*;

use super::local_radiosity::{LocalRadiosity, Radiosity};
use crate::error::{BakeError, Result};
use crate::refinement::SamplePoints;

/// Vertices that a thread takes at a time.
const VERTICES_AT_ONCE: usize = 4096;

/// A solution of the light.
#[derive(Clone, Default)]
pub struct Solution {
    /// Radiosity of each share.
    pub radiosity: Vec<DVec3>,
    /// How it differs within them, where the strategy needs that.
    pub local: Option<LocalRadiosity>,
    /// Irradiance of each vertex.
    pub irradiance: Vec<DVec3>,
    /// The refinement samples, with the light there.
    pub samples: SamplePoints,
    /// Middles of large leaves, with the light there; none where each would cost a row.
    pub middles: SamplePoints,
    /// Flux not yet shot.
    pub unshot: DVec3,
    /// Bound of what is missing, relative to the reflected flux.
    pub unshot_bound: f64,
    /// Flux by which shares differ from what they should have shot, relative to the reflected flux.
    pub residual: f64,
}

impl Solution {
    /// Radiosity of the shares, and within them.
    pub fn radiosity(&self) -> Radiosity<'_> {
        Radiosity { shares: &self.radiosity, local: self.local.as_ref() }
    }

    /// Sets the irradiance of the vertices: direct and reflected light.
    pub fn set_irradiance(&mut self, direct: &[DVec3], reflected: Vec<DVec3>) -> Result<()> {
        self.irradiance = reflected;
        let all = self.irradiance.par_iter_mut().zip(direct).with_min_len(VERTICES_AT_ONCE);
        let is_finite = all
            .map(|(light, direct)| {
                *light = *direct + *light;
                light.is_finite()
            })
            .reduce(|| true, |one, other| one && other);
        if is_finite { Ok(()) } else { Err(BakeError::NotFinite) }
    }
}
