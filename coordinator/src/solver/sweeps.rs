//! Finishes a solution whose rows are all there: Gauss-Seidel sweeps over the shares, with a correction of the whole after
//! each.
//!
//! In bright rooms (rho .99) plain sweeps take hundreds of rounds because they spread a general level of light slowly. Adding
//! the one multiple of a fixed vector that makes the residual's flux vanish finds that level at once; the sweeps are left
//! with the differences.

use glam::DVec3;

use super::{ShareEnergy, add_row, interreflection_bound, ratio};

/// Factors between shares: `columns[x][a]` is the irradiance that share a gets from unit radiosity of share x.
pub struct Transfer {
    /// One column per shooting share.
    pub columns: Vec<Vec<f32>>,
}

/// A finished solution.
pub struct Solution {
    /// Radiosity reflected by each share.
    pub radiosity: Vec<DVec3>,
    /// Flux not yet shot: area times radiosity.
    pub unshot: DVec3,
    /// Flux by which shares differ from what they should have shot, relative to the reflected flux.
    pub residual: f64,
    /// Bound of what is missing, relative to the reflected flux.
    pub missing: f64,
    /// Sweeps made.
    pub sweeps: u32,
}

/// Solves b = rho (direct + K b) to the relative accuracy `tolerance`, from a first guess of b.
#[must_use]
pub fn solve(
    shares: &[ShareEnergy],
    transfer: &Transfer,
    direct: &[DVec3],
    guess: Vec<DVec3>,
    tolerance: f64,
    max_sweeps: u32,
) -> Solution {
    let mut radiosity = guess;
    let mut irradiance = direct.to_vec();
    for (column, radiosity) in transfer.columns.iter().zip(&radiosity) {
        add_row(&mut irradiance, column, *radiosity);
    }
    let level = Level::new(shares, transfer);
    let bound = interreflection_bound(shares);
    let (mut residual, mut missing) = (f64::INFINITY, f64::INFINITY);
    let mut sweeps = 0;
    while sweeps < max_sweeps && missing > tolerance {
        for (index, share) in shares.iter().enumerate() {
            let change = share.reflectance * irradiance[index] - radiosity[index];
            radiosity[index] += change;
            add_row(&mut irradiance, &transfer.columns[index], change);
        }
        level.correct(shares, &mut radiosity, &mut irradiance);
        sweeps += 1;
        let relative = relative_residual(shares, &radiosity, &irradiance);
        residual = relative.max_element();
        missing = (relative * bound).max_element();
    }
    let unshot = (0..shares.len())
        .map(|i| (shares[i].reflectance * irradiance[i] - radiosity[i]) * shares[i].area)
        .sum();
    Solution { unshot, radiosity, residual, missing, sweeps }
}

/// Absolute residual flux over reflected flux, per channel.
fn relative_residual(shares: &[ShareEnergy], radiosity: &[DVec3], irradiance: &[DVec3]) -> DVec3 {
    let (mut residual, mut reflected) = (DVec3::ZERO, DVec3::ZERO);
    for (index, share) in shares.iter().enumerate() {
        let target = share.reflectance * irradiance[index];
        residual += (target - radiosity[index]).abs() * share.area;
        reflected += target * share.area;
    }
    ratio(residual, reflected)
}

/// The general level of light: radiosity in proportion to reflectance.
struct Level {
    /// Irradiance that it gives each share.
    irradiance: Vec<DVec3>,
    /// Flux of the level that it does not sustain itself.
    deficit: DVec3,
}

impl Level {
    fn new(shares: &[ShareEnergy], transfer: &Transfer) -> Self {
        let mut irradiance = vec![DVec3::ZERO; shares.len()];
        for (column, share) in transfer.columns.iter().zip(shares) {
            add_row(&mut irradiance, column, share.reflectance);
        }
        let lost = |(share, irradiance): (&ShareEnergy, &DVec3)| {
            (share.reflectance - share.reflectance * *irradiance) * share.area
        };
        let deficit = shares.iter().zip(&irradiance).map(lost).sum();
        Self { irradiance, deficit }
    }

    /// Adds the multiple of the level that makes the sum of the residual flux vanish.
    fn correct(&self, shares: &[ShareEnergy], radiosity: &mut [DVec3], irradiance: &mut [DVec3]) {
        let residual: DVec3 = (0..shares.len())
            .map(|i| (shares[i].reflectance * irradiance[i] - radiosity[i]) * shares[i].area)
            .sum();
        // Without a deficit (rows that sum to more than 1 by noise) the step would run away.
        let step = ratio(residual, self.deficit);
        for i in 0..shares.len() {
            radiosity[i] += step * shares[i].reflectance;
            irradiance[i] += step * self.irradiance[i];
        }
    }
}
