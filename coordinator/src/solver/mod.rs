//! The radiosity solver: pure, no I/O, no clock, no threads; rows go in, shots and irradiances come out.
//!
//! | file | what it does |
//! |---|---|
//! | `shooting` | progressive refinement: which share shoots next, and what its shot gives |
//! | `sweeps` | finishes the solution once all rows are there |
//! | `refinement` | where the mesh needs more vertices |
//! | `fit` | vertex values with the least error between the vertices |
//! | `balance` | where the energy went |
//!
//! Colours are linear RGB in W/m^2 (or the scene's light unit), lengths in the frame.

pub mod balance;
pub mod fit;
pub mod refinement;
pub mod shooting;
pub mod sweeps;
#[cfg(test)]
mod tests;

use glam::DVec3;

/// Index of a share among those that shoot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ShareId(pub u32);

impl ShareId {
    /// As an index into arrays over shares.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// What the solver knows of a share: the geometry stays with the mesh.
#[derive(Debug, Clone, Copy)]
pub struct ShareEnergy {
    /// Index of the receiver that is the share's own vertex.
    pub receiver: usize,
    /// Area in the frame.
    pub area: f64,
    /// Diffuse reflectance, in [0, 1).
    pub reflectance: DVec3,
}

/// Largest factor by which unshot flux can still grow through interreflection: rho / (1 - rho) of the brightest surface, per
/// channel. What is missing from the reflected flux is at most this times the unshot flux.
#[must_use]
pub fn interreflection_bound(shares: &[ShareEnergy]) -> DVec3 {
    let largest = shares.iter().fold(DVec3::ZERO, |largest, share| largest.max(share.reflectance));
    largest / (1.0 - largest)
}

/// Adds what `radiosity` of a row's shooter gives to the receivers of the row.
pub fn add_row(irradiance: &mut [DVec3], row: &[f32], radiosity: DVec3) {
    for (irradiance, factor) in irradiance.iter_mut().zip(row) {
        *irradiance += radiosity * f64::from(*factor);
    }
}

/// Part of a whole, per channel; 0 of a channel that has nothing.
fn ratio(part: DVec3, whole: DVec3) -> DVec3 {
    DVec3::select(whole.cmpgt(DVec3::ZERO), part / whole, DVec3::ZERO)
}
