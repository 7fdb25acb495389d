//! Gauss-Seidel sweeps over all rows, with a correction of the general level of light after each.
//!
//! In bright rooms (rho .99) plain sweeps take hundreds of rounds to spread a general level of light. Adding
//! the multiple of a fixed vector that makes the residual's flux vanish finds that level at once.
//!
//! Closed rooms of one file each have their own level, and each is solved to the tolerance, however much brighter another is.

use std::convert::Infallible;

use kernel::disjoint_sets::DisjointSets;
use kernel::row::{GROUP, Row};

use super::slab::{Slab, each_slab};
use super::{Light, ShareEnergy, SharesAt, add_group, add_row, interreflection_bound};

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
    let mut radiosity = guess;
    let mut irradiance = direct;
    let shares_at = SharesAt::new(shares, irradiance.len());
    let mut level_irradiance = vec![L::default(); irradiance.len()];
    let mut reach = Reach::new(shares.len(), irradiance.len());
    transfer.pass(&mut |first, rows| {
        each_slab(rows, |own, slab| {
            let first = first + own;
            slab.add(&mut irradiance, |row, part, mask, factors| {
                add_group(part, mask, factors, radiosity[first + row]);
            });
            slab.add(&mut level_irradiance, |row, part, mask, factors| {
                add_group(part, mask, factors, shares[first + row].reflectance);
            });
            (first..).zip(slab.rows()).for_each(|(share, row)| reach.add(share, row, &shares_at));
        });
    })?;
    let rooms = Rooms::new(&mut reach.sets, shares.len());
    let level = Level::new(shares, level_irradiance, &rooms);
    let bound = interreflection_bound(shares);
    let (mut residual, mut missing) = (f64::INFINITY, f64::INFINITY);
    let mut sweeps = 0;
    while sweeps < max_sweeps && missing > tolerance {
        transfer.pass(&mut |first, rows| {
            each_slab(rows, |own, slab| {
                let own = first + own..first + own + slab.rows().len();
                sweep(&shares[own.clone()], slab, &mut radiosity[own], &mut irradiance);
            });
        })?;
        level.correct(shares, &shares_at, &rooms, &mut radiosity, &mut irradiance);
        sweeps += 1;
        let relative = relative_residual(shares, &rooms, &radiosity, &irradiance);
        residual = relative.largest_channel();
        missing = (relative * bound).largest_channel();
    }
    let unshot = shares
        .iter()
        .zip(&radiosity)
        .map(|(share, radiosity)| (share.reflectance * irradiance[share.receiver] - *radiosity) * share.area)
        .sum();
    Ok(Solution { unshot, radiosity, residual, missing, sweeps })
}

/// Lets consecutive shares reflect what they receive, one after the other.
fn sweep<L: Light>(shares: &[ShareEnergy<L>], slab: &Slab, radiosity: &mut [L], irradiance: &mut [L]) {
    if !slab.is_shared() {
        for ((share, row), radiosity) in shares.iter().zip(slab.rows()).zip(radiosity) {
            let change = share.reflectance * irradiance[share.receiver] - *radiosity;
            *radiosity += change;
            add_row(irradiance, row, change);
        }
        return;
    }
    // What these shares give each other comes first, then threads add all to all others: the same sums in the same order.
    let receivers: Vec<usize> = shares.iter().map(|share| share.receiver).collect();
    let factors = slab.factors(&receivers);
    let mut received: Vec<L> = receivers.iter().map(|receiver| irradiance[*receiver]).collect();
    let mut changes = Vec::with_capacity(shares.len());
    for (index, share) in shares.iter().enumerate() {
        let change = share.reflectance * received[index] - radiosity[index];
        radiosity[index] += change;
        for (received, factor) in received.iter_mut().zip(&factors[index]).skip(index + 1) {
            if *factor != 0.0 {
                *received += change * f64::from(*factor);
            }
        }
        changes.push(change);
    }
    slab.add(irradiance, |row, part, mask, factors| add_group(part, mask, factors, changes[row]));
}

/// Finds the rooms: shares between which light can pass.
struct Reach {
    sets: DisjointSets,
    /// Least share of the set that `joined` is about.
    first: usize,
    /// A bit per receiver whose shares were joined to that set: most rows reach what others have reached before.
    joined: Vec<u32>,
}

impl Reach {
    fn new(shares: usize, receivers: usize) -> Self {
        Self { sets: DisjointSets::new(shares), first: 0, joined: vec![0; receivers.div_ceil(GROUP)] }
    }

    /// Adds the row of a share.
    fn add(&mut self, share: usize, row: &Row, shares_at: &SharesAt) {
        if self.sets.count() <= 1 {
            return;
        }
        let first = self.sets.representative(share);
        if first != self.first {
            self.joined.fill(0);
        }
        for (start, mask, factors) in row.groups() {
            let joined = &mut self.joined[start / GROUP];
            if mask & !*joined == 0 {
                continue;
            }
            let mut rest = mask;
            for factor in factors {
                let receiver = rest.trailing_zeros();
                rest &= rest.wrapping_sub(1);
                if *factor > 0.0 && *joined & (1 << receiver) == 0 {
                    *joined |= 1 << receiver;
                    for to in shares_at.receiver(start + receiver as usize) {
                        self.sets.join(share, to.index());
                    }
                }
            }
        }
        self.first = self.sets.representative(share);
    }
}

/// Shares between which light can pass, directly or by way of others.
struct Rooms {
    /// Room of each share.
    of: Vec<usize>,
    count: usize,
}

impl Rooms {
    fn new(sets: &mut DisjointSets, shares: usize) -> Self {
        let mut of = vec![0; shares];
        let mut count = 0;
        for share in 0..shares {
            let first = sets.representative(share);
            of[share] = if first == share { count } else { of[first] };
            count += usize::from(first == share);
        }
        Self { of, count }
    }

    /// Sums a value of each share by room.
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
    let target = |i: usize| shares[i].reflectance * irradiance[shares[i].receiver];
    let residual = rooms.sums(|i| (target(i) - radiosity[i]).magnitude() * shares[i].area);
    let reflected = rooms.sums(|i| target(i) * shares[i].area);
    residual
        .iter()
        .zip(&reflected)
        .fold(L::default(), |most, (part, whole)| most.larger(L::ratio(*part, *whole)))
}

/// The general level of light in each room: radiosity in proportion to reflectance.
struct Level<L> {
    /// Irradiance that it gives each receiver.
    irradiance: Vec<L>,
    /// Flux by which each room does not sustain its level.
    deficits: Vec<L>,
}

impl<L: Light> Level<L> {
    fn new(shares: &[ShareEnergy<L>], irradiance: Vec<L>, rooms: &Rooms) -> Self {
        let lost = |i: usize| {
            let ShareEnergy { receiver, reflectance, area } = shares[i];
            (reflectance - reflectance * irradiance[receiver]) * area
        };
        let deficits = rooms.sums(lost);
        Self { irradiance, deficits }
    }

    /// Adds the multiple of each room's level that makes the sum of its residual flux vanish.
    fn correct(
        &self,
        shares: &[ShareEnergy<L>],
        shares_at: &SharesAt,
        rooms: &Rooms,
        radiosity: &mut [L],
        irradiance: &mut [L],
    ) {
        let residual = |i: usize| {
            let ShareEnergy { receiver, reflectance, area } = shares[i];
            (reflectance * irradiance[receiver] - radiosity[i]) * area
        };
        // Without a deficit (rows that sum to more than 1 by noise) the step would run away.
        let steps: Vec<L> = rooms
            .sums(residual)
            .iter()
            .zip(&self.deficits)
            .map(|(part, whole)| L::ratio(*part, *whole))
            .collect();
        for (i, room) in rooms.of.iter().enumerate() {
            radiosity[i] += steps[*room] * shares[i].reflectance;
        }
        for (receiver, irradiance) in irradiance.iter_mut().enumerate() {
            // Shares at one receiver are lit by the same others, and so are in the same room, or they are not lit at all.
            if let Some(share) = shares_at.receiver(receiver).first() {
                *irradiance += steps[rooms.of[share.index()]] * self.irradiance[receiver];
            }
        }
    }
}
