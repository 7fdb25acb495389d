//! Rooms: shares between which light can pass, directly or by way of others. Light of one tells nothing of that of another.

use std::iter::Sum;

use kernel::disjoint_sets::DisjointSets;
use kernel::row::{GROUP, Row};
use rayon::prelude::*;

use super::{Light, SharesAt};

/// Shares that a thread sums at a time: part of the bits of a sum.
const SHARES_AT_ONCE: usize = 4096;

/// Joins shares that reach each other to rooms.
pub(super) struct RoomFinder {
    shares: usize,
    sets: DisjointSets,
    /// Least share of the set that `joined` is about.
    first: usize,
    /// A bit per receiver whose shares were joined to that set: most rows reach what others have reached before.
    joined: Vec<u32>,
}

impl RoomFinder {
    /// Each share is alone.
    pub(super) fn new(shares: usize, receivers: usize) -> Self {
        Self { shares, sets: DisjointSets::new(shares), first: 0, joined: vec![0; receivers.div_ceil(GROUP)] }
    }

    /// Adds the row of a share.
    pub(super) fn add(&mut self, share: usize, row: &Row, shares_at: &SharesAt) {
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

    /// The rooms, once all rows were added.
    pub(super) fn rooms(mut self) -> Rooms {
        let mut of = vec![0; self.shares];
        let mut count = 0;
        for share in 0..of.len() {
            let first = self.sets.representative(share);
            of[share] = if first == share { count as u32 } else { of[first] };
            count += usize::from(first == share);
        }
        Rooms { of, count }
    }
}

/// The room of each share.
#[derive(Clone)]
pub struct Rooms {
    of: Vec<u32>,
    count: usize,
}

impl Rooms {
    /// One room with all shares, given their number.
    #[must_use]
    pub fn one(shares: usize) -> Self {
        Self { of: vec![0; shares], count: 1 }
    }

    /// Room of each share.
    #[must_use]
    pub fn of(&self) -> &[u32] {
        &self.of
    }

    /// Sums a value of each share by room.
    #[must_use]
    pub fn sums<L: Light>(&self, value: impl Fn(usize) -> L + Sync) -> Vec<L> {
        // Most neighbours are of one room.
        let some = |(chunk, rooms): (usize, &[u32])| {
            let mut runs: Vec<(u32, L)> = vec![];
            for (room, share) in rooms.iter().zip(chunk * SHARES_AT_ONCE..) {
                match runs.last_mut() {
                    Some((own, sum)) if own == room => *sum += value(share),
                    _ => runs.push((*room, value(share))),
                }
            }
            runs
        };
        let chunks: Vec<_> = self.of.par_chunks(SHARES_AT_ONCE).enumerate().map(some).collect();
        let mut sums = vec![L::default(); self.count];
        chunks.into_iter().flatten().for_each(|(room, sum)| sums[room as usize] += sum);
        sums
    }
}

/// Sums a value of each share, given their number.
#[must_use]
pub fn sum<T: Sum + Send>(shares: usize, value: impl Fn(usize) -> T + Sync) -> T {
    let some = |chunk: usize| {
        let first = chunk * SHARES_AT_ONCE;
        (first..(first + SHARES_AT_ONCE).min(shares)).map(&value).sum()
    };
    let chunks = (0..shares.div_ceil(SHARES_AT_ONCE)).into_par_iter().map(some);
    chunks.collect::<Vec<T>>().into_iter().sum()
}
