//! The radiosity solver: rows in, radiosity and irradiance out. Pure: no I/O or clock; threads share work whose bits do not depend on
//! them.
//!
//! | file | what it does |
//! |---|---|
//! | `light` | three channels, or one |
//! | `cache` | rows kept in a given amount of memory |
//! | `slab` | several rows at once, by ranges of receivers |
//! | `shooting` | progressive refinement: which share shoots next, and what its shot gives |
//! | `sweeps` | sweeps over all rows |
//! | `acceleration` | Anderson acceleration of fixed-point passes |
//! | `rooms` | shares between which light can pass |
//! | `balance` | energy balance |
//!
//! Colours are linear RGB in W/m^2 (or the scene's light unit), lengths in the frame.

pub mod acceleration;
pub mod balance;
pub mod bounds;
pub mod cache;
mod light;
pub mod rooms;
pub mod shooting;
pub mod slab;
pub mod sweeps;
#[cfg(test)]
mod tests;

use glam::DVec3;
use kernel::row::{GROUP, Row};

pub use light::Light;

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

/// A share as the solver sees it.
#[derive(Debug, Clone, Copy)]
pub struct ShareEnergy<L = DVec3> {
    /// Index of the share's own receiver.
    pub receiver: usize,
    /// Area in the frame.
    pub area: f64,
    /// Diffuse reflectance, in [0, 1).
    pub reflectance: L,
}

impl ShareEnergy {
    /// The same for light of one colour.
    #[must_use]
    pub fn seen_as<L: Light>(&self) -> ShareEnergy<L> {
        ShareEnergy {
            receiver: self.receiver,
            area: self.area,
            reflectance: L::reflectance(self.reflectance),
        }
    }
}

/// Bound of the missing reflected flux over the unshot flux: rho / (1 - rho) of the brightest surface, per channel.
#[must_use]
pub fn interreflection_bound<L: Light>(shares: &[ShareEnergy<L>]) -> L {
    shares.iter().fold(L::default(), |largest, share| largest.larger(share.reflectance)).interreflected()
}

/// Adds the irradiance that a shooter of this radiosity gives the receivers of its row.
pub fn add_row<L: Light>(irradiance: &mut [L], row: &Row, radiosity: L) {
    for (first, mask, factors) in row.groups() {
        let end = (first + GROUP).min(irradiance.len());
        add_group(&mut irradiance[first..end], mask, factors, radiosity);
    }
}

/// The same for up to 32 receivers, given a bit for each that has a factor, and the factors.
pub fn add_group<L: Light>(irradiance: &mut [L], mask: u32, factors: &[f32], radiosity: L) {
    if mask == u32::MAX {
        for (irradiance, factor) in irradiance.iter_mut().zip(factors) {
            *irradiance += radiosity * f64::from(*factor);
        }
    } else {
        let mut rest = mask;
        for factor in factors {
            irradiance[rest.trailing_zeros() as usize] += radiosity * f64::from(*factor);
            rest &= rest.wrapping_sub(1);
        }
    }
}

/// The shares at each receiver: a vertex between two surfaces has a share on each.
struct SharesAt {
    /// Offsets into `shares`, one per receiver and the end.
    starts: Vec<u32>,
    /// By receiver.
    shares: Vec<ShareId>,
}

impl SharesAt {
    fn new<L>(shares: &[ShareEnergy<L>], receivers: usize) -> Self {
        let mut ids: Vec<ShareId> = (0..shares.len() as u32).map(ShareId).collect();
        ids.sort_by_key(|id| shares[id.index()].receiver);
        let mut starts = vec![0; receivers + 1];
        for share in shares {
            starts[share.receiver + 1] += 1;
        }
        for receiver in 0..receivers {
            starts[receiver + 1] += starts[receiver];
        }
        Self { starts, shares: ids }
    }

    fn receiver(&self, receiver: usize) -> &[ShareId] {
        &self.shares[self.starts[receiver] as usize..self.starts[receiver + 1] as usize]
    }
}
