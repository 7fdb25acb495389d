//! Finishes a solution whose rows are all there: Gauss-Seidel sweeps over the shares, with a correction of the whole after
//! each.
//!
//! In bright rooms (rho .99) plain sweeps take hundreds of rounds because they spread a general level of light slowly. Adding
//! the one multiple of a fixed vector that makes the residual's flux vanish finds that level at once; the sweeps are left
//! with the differences.
//!
//! Closed rooms that share a file each have a level of their own, and each is solved to the wanted accuracy: light that is a
//! millionth of the next room's is not an error of that.

use super::{Light, ShareEnergy, add_row, interreflection_bound};
use crate::disjoint_sets::DisjointSets;

/// Factors between shares: `columns[x][a]` is the irradiance that share a gets from unit radiosity of share x.
pub struct Transfer {
    /// One column per shooting share.
    pub columns: Vec<Vec<f32>>,
}

/// A finished solution.
pub struct Solution<L> {
    /// Radiosity reflected by each share.
    pub radiosity: Vec<L>,
    /// Flux not yet shot: area times radiosity.
    pub unshot: L,
    /// Flux by which shares differ from what they should have shot, relative to the reflected flux of their room.
    pub residual: f64,
    /// Bound of what is missing, relative to the reflected flux of its room.
    pub missing: f64,
    /// Sweeps made.
    pub sweeps: u32,
}

/// Solves b = rho (direct + K b) to the relative accuracy `tolerance`, from a first guess of b.
#[must_use]
pub fn solve<L: Light>(
    shares: &[ShareEnergy<L>],
    transfer: &Transfer,
    direct: &[L],
    guess: Vec<L>,
    tolerance: f64,
    max_sweeps: u32,
) -> Solution<L> {
    let mut radiosity = guess;
    let mut irradiance = direct.to_vec();
    for (column, radiosity) in transfer.columns.iter().zip(&radiosity) {
        add_row(&mut irradiance, column, *radiosity);
    }
    let rooms = Rooms::new(transfer);
    let level = Level::new(shares, transfer, &rooms);
    let bound = interreflection_bound(shares);
    let (mut residual, mut missing) = (f64::INFINITY, f64::INFINITY);
    let mut sweeps = 0;
    while sweeps < max_sweeps && missing > tolerance {
        for (index, share) in shares.iter().enumerate() {
            let change = share.reflectance * irradiance[index] - radiosity[index];
            radiosity[index] += change;
            add_row(&mut irradiance, &transfer.columns[index], change);
        }
        level.correct(shares, &rooms, &mut radiosity, &mut irradiance);
        sweeps += 1;
        let relative = relative_residual(shares, &rooms, &radiosity, &irradiance);
        residual = relative.largest_channel();
        missing = (relative * bound).largest_channel();
    }
    let unshot = (0..shares.len())
        .map(|i| (shares[i].reflectance * irradiance[i] - radiosity[i]) * shares[i].area)
        .sum();
    Solution { unshot, radiosity, residual, missing, sweeps }
}

/// Shares between which light can pass, by way of others too.
struct Rooms {
    /// Room of each share.
    of: Vec<usize>,
    count: usize,
}

impl Rooms {
    fn new(transfer: &Transfer) -> Self {
        let shares = transfer.columns.len();
        let mut sets = DisjointSets::new(shares);
        for (from, column) in transfer.columns.iter().enumerate() {
            if sets.count() <= 1 {
                break;
            }
            let lit = column.iter().enumerate().filter(|(_, factor)| **factor > 0.0);
            lit.for_each(|(to, _)| sets.join(from, to));
        }
        let mut of = vec![0; shares];
        let mut count = 0;
        for share in 0..shares {
            let first = sets.representative(share);
            of[share] = if first == share { count } else { of[first] };
            count += usize::from(first == share);
        }
        Self { of, count }
    }

    /// Sum of a figure of each share, by room.
    fn sums<L: Light>(&self, figure: impl Fn(usize) -> L) -> Vec<L> {
        let mut sums = vec![L::default(); self.count];
        for (share, room) in self.of.iter().enumerate() {
            sums[*room] += figure(share);
        }
        sums
    }
}

/// Absolute residual flux over reflected flux, per channel, of the room where it is largest.
fn relative_residual<L: Light>(
    shares: &[ShareEnergy<L>],
    rooms: &Rooms,
    radiosity: &[L],
    irradiance: &[L],
) -> L {
    let target = |i: usize| shares[i].reflectance * irradiance[i];
    let residual = rooms.sums(|i| (target(i) - radiosity[i]).magnitude() * shares[i].area);
    let reflected = rooms.sums(|i| target(i) * shares[i].area);
    residual
        .iter()
        .zip(&reflected)
        .fold(L::default(), |most, (part, whole)| most.larger(L::ratio(*part, *whole)))
}

/// The general level of light in each room: radiosity in proportion to reflectance.
struct Level<L> {
    /// Irradiance that it gives each share.
    irradiance: Vec<L>,
    /// Flux of the level that each room does not sustain itself.
    deficits: Vec<L>,
}

impl<L: Light> Level<L> {
    fn new(shares: &[ShareEnergy<L>], transfer: &Transfer, rooms: &Rooms) -> Self {
        let mut irradiance = vec![L::default(); shares.len()];
        for (column, share) in transfer.columns.iter().zip(shares) {
            add_row(&mut irradiance, column, share.reflectance);
        }
        let lost = |i: usize| {
            let ShareEnergy { reflectance, area, .. } = shares[i];
            (reflectance - reflectance * irradiance[i]) * area
        };
        let deficits = rooms.sums(lost);
        Self { irradiance, deficits }
    }

    /// Adds the multiple of each room's level that makes the sum of its residual flux vanish.
    fn correct(&self, shares: &[ShareEnergy<L>], rooms: &Rooms, radiosity: &mut [L], irradiance: &mut [L]) {
        let residuals =
            rooms.sums(|i| (shares[i].reflectance * irradiance[i] - radiosity[i]) * shares[i].area);
        // Without a deficit (rows that sum to more than 1 by noise) the step would run away.
        let steps: Vec<L> =
            residuals.iter().zip(&self.deficits).map(|(part, whole)| L::ratio(*part, *whole)).collect();
        for (i, room) in rooms.of.iter().enumerate() {
            radiosity[i] += steps[*room] * shares[i].reflectance;
            irradiance[i] += steps[*room] * self.irradiance[i];
        }
    }
}
