//! Several rows at once, added to what their receivers have: by ranges of receivers, each by one thread, and at each receiver in the
//! order of the rows. So the bits are those of one row after the other, whatever the number of threads.

use kernel::row::{GROUP, Place, Row};
use rayon::prelude::*;

/// Receivers of a range: what they have fits the innermost caches.
const RANGE: usize = 64 * GROUP;

/// Rows with fewer factors than this are not worth more than one thread: to wake another takes as long as adding some ten thousand.
const LEAST_FACTORS: usize = 1 << 18;

/// Rows that go well together.
const ROWS: usize = 64;

/// Cuts rows into slabs, and hands these over in order, each with the number of its first row.
pub fn each_slab(rows: &[&Row], mut take: impl FnMut(usize, &Slab) + Send) {
    let mut all = || {
        for (number, rows) in rows.chunks(ROWS).enumerate() {
            take(number * ROWS, &Slab::new(rows));
        }
    };
    // Threads that share any are best handed all at once: to wake them for each takes longer than most.
    if rows.chunks(ROWS).any(is_worth_sharing) { rayon::scope(|_| all()) } else { all() }
}

fn is_worth_sharing(rows: &[&Row]) -> bool {
    let receivers = rows.first().map_or(0, |row| row.receivers());
    let factors = || rows.iter().map(|row| row.count()).sum::<usize>();
    rows.len() > 1 && receivers > RANGE && factors() >= LEAST_FACTORS
}

/// Some rows over the same receivers.
pub struct Slab<'a> {
    rows: &'a [&'a Row],
    /// By row, where ranges begin and the last one ends; empty where one thread does.
    places: Vec<Vec<Place>>,
}

impl<'a> Slab<'a> {
    /// The slab of these rows.
    #[must_use]
    pub fn new(rows: &'a [&'a Row]) -> Self {
        let is_shared = is_worth_sharing(rows);
        let places = if is_shared { rows.par_iter().map(|row| row.places(RANGE)).collect() } else { vec![] };
        Self { rows, places }
    }

    /// The rows.
    #[must_use]
    pub fn rows(&self) -> &[&'a Row] {
        self.rows
    }

    /// Whether several threads share the work.
    #[must_use]
    pub fn is_shared(&self) -> bool {
        !self.places.is_empty()
    }

    /// Adds each row to what the receivers have. `add` gets the number of the row, what up to 32 receivers have, a bit for each of
    /// these that has a factor, and the factors.
    pub fn add<T: Send>(&self, to: &mut [T], add: impl Fn(usize, &mut [T], u32, &[f32]) + Sync) {
        if self.places.is_empty() {
            for (number, row) in self.rows.iter().enumerate() {
                for (first, mask, factors) in row.groups() {
                    let end = (first + GROUP).min(to.len());
                    add(number, &mut to[first..end], mask, factors);
                }
            }
            return;
        }
        to.par_chunks_mut(RANGE).enumerate().for_each(|(range, part)| {
            for (number, (row, places)) in self.rows.iter().zip(&self.places).enumerate() {
                for (first, mask, factors) in row.groups_between(places[range], places[range + 1]) {
                    let first = first - range * RANGE;
                    let end = (first + GROUP).min(part.len());
                    add(number, &mut part[first..end], mask, factors);
                }
            }
        });
    }

    /// The factors of these receivers, by row. For slabs that threads share.
    #[must_use]
    pub fn factors(&self, receivers: &[usize]) -> Vec<Vec<f32>> {
        let mut rising: Vec<(usize, usize)> = receivers.iter().copied().zip(0..).collect();
        rising.sort_unstable();
        let of_row = |(row, places): (&&Row, &Vec<Place>)| {
            let mut factors = vec![0.0; receivers.len()];
            for some in rising.chunk_by(|a, b| a.0 / RANGE == b.0 / RANGE) {
                let mut cursor = row.cursor(places[some[0].0 / RANGE]);
                some.iter().for_each(|(receiver, index)| factors[*index] = cursor.factor(*receiver));
            }
            factors
        };
        self.rows.par_iter().zip(&self.places).map(of_row).collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::solver::{add_group, add_row};

    #[test]
    fn the_bits_are_those_of_one_row_after_the_other() {
        let receivers = 4 * RANGE + 77;
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
                assert!(slab.is_shared());
                let mut found = vec![DVec3::ONE; receivers];
                slab.add(&mut found, |row, part, mask, factors| add_group(part, mask, factors, light(row)));
                assert_eq!(found, expected, "{threads} threads");
                let some = [receivers - 1, 0, RANGE, RANGE - 1, 5, 5, 2 * RANGE + 1];
                for (row, factors) in rows.iter().zip(slab.factors(&some)) {
                    assert_eq!(factors, some.map(|receiver| row.factor(receiver)));
                }
            });
        }
    }
}
