//! Several rows at once, added to what their receivers have: by ranges of receivers, each by one thread, and at each receiver in the
//! order of the rows. So the bits are those of one row after the other, whatever the number of threads.

use kernel::row::{GROUP, Place, Row};
use rayon::prelude::*;

/// Ranges that receivers are cut into, and threads that can share them, at most. With four times as many what lies together of a row
/// is so short that adding takes twice as long.
const RANGES: usize = 16;

/// Rows that tell where the ranges end.
const ROWS_LOOKED_AT: usize = 512;

/// Rows with fewer factors than this are not worth more than one thread: to wake another takes as long as adding some ten thousand.
const LEAST_FACTORS: usize = 1 << 17;

/// Some rows over the same receivers.
pub struct Slab<'a> {
    rows: &'a [&'a Row],
    /// First receiver of each range; none where one thread adds all.
    firsts: Vec<usize>,
    /// By row, where the ranges begin, and where the last one ends.
    places: Vec<Place>,
}

impl<'a> Slab<'a> {
    /// The slab of these rows.
    #[must_use]
    pub fn new(rows: &'a [&'a Row]) -> Self {
        let count: usize = rows.iter().map(|row| row.count()).sum();
        if rows.len() < 2 || count < LEAST_FACTORS {
            return Self { rows, firsts: vec![], places: vec![] };
        }
        let firsts = even_ranges(rows);
        let mut places = vec![Place::default(); rows.len() * (firsts.len() + 1)];
        let by_row = places.par_chunks_mut(firsts.len() + 1).zip(rows);
        by_row.for_each(|(places, row)| row.find_places(&firsts, places));
        Self { rows, firsts, places }
    }

    /// The rows.
    #[must_use]
    pub fn rows(&self) -> &[&'a Row] {
        self.rows
    }

    /// Adds each row to what the receivers have. `add` gets the number of the row, what up to 32 receivers have, a bit for each of
    /// these that has a factor, and the factors.
    pub fn add<T: Send>(&self, to: &mut [T], add: impl Fn(usize, &mut [T], u32, &[f32]) + Sync) {
        if self.firsts.is_empty() {
            for (number, row) in self.rows.iter().enumerate() {
                for (first, mask, factors) in row.groups() {
                    let end = (first + GROUP).min(to.len());
                    add(number, &mut to[first..end], mask, factors);
                }
            }
            return;
        }
        let mut parts = vec![];
        let mut rest = to;
        for first in self.firsts.iter().rev() {
            let part;
            (rest, part) = rest.split_at_mut(*first);
            parts.push((*first, part));
        }
        parts.into_par_iter().rev().enumerate().for_each(|(range, (start, part))| {
            let places = self.places.chunks_exact(self.firsts.len() + 1);
            for (number, (row, places)) in self.rows.iter().zip(places).enumerate() {
                for (first, mask, factors) in row.groups_between(places[range], places[range + 1]) {
                    let first = first - start;
                    let end = (first + GROUP).min(part.len());
                    add(number, &mut part[first..end], mask, factors);
                }
            }
        });
    }
}

/// The first receivers of ranges that have about as many factors each.
fn even_ranges(rows: &[&Row]) -> Vec<usize> {
    let mut counts = vec![0; rows[0].receivers().div_ceil(GROUP)];
    for row in rows.iter().step_by(rows.len().div_ceil(ROWS_LOOKED_AT)) {
        row.groups().for_each(|(first, _, factors)| counts[first / GROUP] += factors.len());
    }
    let per_range = counts.iter().sum::<usize>().div_ceil(RANGES).max(1);
    let mut firsts = vec![0];
    let mut sum = 0;
    for (group, count) in counts.iter().enumerate() {
        if firsts.len() < RANGES && sum >= firsts.len() * per_range {
            firsts.push(group * GROUP);
        }
        sum += count;
    }
    firsts
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::solver::{add_group, add_row};

    /// Rows of the slab.
    const ROWS: usize = 64;

    #[test]
    fn the_bits_are_those_of_one_row_after_the_other() {
        let receivers = 8269;
        let factor = |x: usize, a: usize| {
            if (a / 100 + x).is_multiple_of(3) { 0.0 } else { 1.0 / (1 + (7 * x + 13 * a) % 1000) as f32 }
        };
        let rows: Vec<Row> =
            (0..ROWS).map(|x| Row::new(&(0..receivers).map(|a| factor(x, a)).collect::<Vec<_>>())).collect();
        let rows: Vec<&Row> = rows.iter().collect();
        let light = |x: usize| DVec3::new(1.0 / (1.0 + x as f64), 0.3 * x as f64, 7.0);
        let mut expected = vec![DVec3::ONE; receivers];
        rows.iter().enumerate().for_each(|(x, row)| add_row(&mut expected, row, light(x)));
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let slab = Slab::new(&rows);
                assert!(slab.firsts.len() > 4);
                let mut found = vec![DVec3::ONE; receivers];
                slab.add(&mut found, |row, part, mask, factors| add_group(part, mask, factors, light(row)));
                assert_eq!(found, expected, "{threads} threads");
            });
        }
    }
}
