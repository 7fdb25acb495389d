//! Sweeps over all rows: shares reflect what others gave them in the sweep before, accelerated.
//!
//! In bright rooms (rho .99) plain sweeps take hundreds of rounds to spread a general level of light: radiosity in proportion to
//! reflectance. The pass before the first sweep finds what a sweep makes of that level, so that its error is removed at once.
//!
//! Closed rooms of one file each have their own level, and each is solved to the tolerance, however much brighter another is.

use std::convert::Infallible;

use kernel::row::Row;

use super::acceleration::Acceleration;
use super::rooms::{RoomFinder, Rooms};
use super::slab::Slab;
use super::{Light, ShareEnergy, SharesAt, add_group, interreflection_bound};

/// Sweeps after which no more is gained: what is missing is rounding.
const MOST_IN_VAIN: u32 = 10;

/// Rows of all shares in order. A solution passes over them once to begin with and once per sweep; rows that are not kept are
/// made in each pass.
pub trait Transfer {
    /// Why a row cannot be had.
    type Error;

    /// Hands over the row of every share, in the order of the shares: the irradiance that each receiver gets from its unit
    /// radiosity. Several at a time, with the index of the first share; how many makes no difference to the solution.
    ///
    /// # Errors
    /// When a row cannot be had.
    fn pass(&mut self, take: &mut dyn FnMut(usize, &[&Row])) -> Result<(), Self::Error>;
}

/// Rows in memory.
impl Transfer for Vec<Row> {
    type Error = Infallible;

    fn pass(&mut self, take: &mut dyn FnMut(usize, &[&Row])) -> Result<(), Infallible> {
        take(0, &self.iter().collect::<Vec<_>>());
        Ok(())
    }
}

/// A finished solution.
pub struct Solution<L> {
    /// Radiosity reflected by each share.
    pub radiosity: Vec<L>,
    /// Flux not yet shot: area times radiosity.
    pub unshot: L,
    /// Flux by which shares differ from what they should have shot, relative to the reflected flux of their room.
    pub residual: f64,
    /// Bound of the missing flux, relative to the reflected flux of its room.
    pub missing: f64,
    /// Sweeps made.
    pub sweeps: u32,
}

impl<L> Solution<L> {
    /// Converts the light.
    #[must_use]
    pub fn map<M>(self, see: impl Fn(L) -> M) -> Solution<M> {
        let Self { radiosity, unshot, residual, missing, sweeps } = self;
        Solution {
            radiosity: radiosity.into_iter().map(&see).collect(),
            unshot: see(unshot),
            residual,
            missing,
            sweeps,
        }
    }
}

/// Solves b = rho (direct + K b) to the relative accuracy `tolerance`, from a first guess of b. `direct` has a value for each
/// receiver of the rows.
///
/// # Errors
/// When a row cannot be had.
pub fn solve<L: Light, T: Transfer>(
    shares: &[ShareEnergy<L>],
    transfer: &mut T,
    direct: Vec<L>,
    guess: Vec<L>,
    tolerance: f64,
    max_sweeps: u32,
) -> Result<Solution<L>, T::Error> {
    let reflected = |irradiance: &[L]| -> Vec<L> {
        shares.iter().map(|share| share.reflectance * irradiance[share.receiver]).collect()
    };
    let mut radiosity = guess;
    let mut irradiance = direct.clone();
    let mut level_irradiance = vec![L::default(); direct.len()];
    let level: Vec<L> = shares.iter().map(|share| share.reflectance).collect();
    let shares_at = SharesAt::new(shares, irradiance.len());
    let mut finder = RoomFinder::new(shares.len(), irradiance.len());
    transfer.pass(&mut |first, rows| {
        let slab = Slab::new(rows);
        add_light(&slab, &radiosity[first..], &mut irradiance);
        add_light(&slab, &level[first..], &mut level_irradiance);
        (first..).zip(rows).for_each(|(share, row)| finder.add(share, row, &shares_at));
    })?;
    let rooms = finder.rooms();
    let mut acceleration = Acceleration::new(shares.iter().map(|share| share.area).collect(), rooms.clone());
    let passed = reflected(&level_irradiance);
    acceleration.keep_direction(level, &passed);
    let bound = interreflection_bound(shares);
    let mut sweeps = 0;
    let (mut least_missing, mut in_vain) = (f64::INFINITY, 0);
    loop {
        let passed = reflected(&irradiance);
        let relative = relative_residual(shares, &rooms, &radiosity, &passed);
        let missing = (relative * bound).largest_channel();
        in_vain = if missing < least_missing { 0 } else { in_vain + 1 };
        least_missing = least_missing.min(missing);
        if missing <= tolerance || sweeps >= max_sweeps || in_vain >= MOST_IN_VAIN {
            let all = shares.iter().zip(&radiosity).zip(&passed);
            let unshot = all.map(|((share, shot), passed)| (*passed - *shot) * share.area).sum();
            let residual = relative.largest_channel();
            return Ok(Solution { radiosity, unshot, residual, missing, sweeps });
        }
        radiosity = acceleration.next(radiosity, &passed);
        irradiance.clone_from(&direct);
        transfer.pass(&mut |first, rows| {
            add_light(&Slab::new(rows), &radiosity[first..], &mut irradiance);
        })?;
        sweeps += 1;
    }
}

/// Adds the light of shares of this radiosity, the first that of the first row.
fn add_light<L: Light>(slab: &Slab, radiosity: &[L], irradiance: &mut [L]) {
    slab.add(irradiance, |row, part, mask, factors| add_group(part, mask, factors, radiosity[row]));
}

/// Residual flux over reflected flux, per channel, of the room where it is largest. `passed` is what shares of this radiosity
/// have each other reflect.
fn relative_residual<L: Light>(shares: &[ShareEnergy<L>], rooms: &Rooms, radiosity: &[L], passed: &[L]) -> L {
    let residual = rooms.sums(|i| (passed[i] - radiosity[i]).magnitude() * shares[i].area);
    let reflected = rooms.sums(|i| passed[i].larger(radiosity[i]) * shares[i].area);
    residual
        .iter()
        .zip(&reflected)
        .fold(L::default(), |most, (part, whole)| most.larger(L::ratio(*part, *whole)))
}
