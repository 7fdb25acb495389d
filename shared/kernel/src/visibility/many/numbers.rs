//! The numbers that the rays of a receiver are drawn by.

use std::sync::OnceLock;

use sobol_burley::parts::hash;
use sobol_burley::sample_4d;

use super::MOST_RAYS;

/// Sequences that are computed once. Computing each receiver's own anew takes a fifth of the time of its rays.
const SETS: usize = 16;

/// Coordinates are parts of this.
const WHOLE: f64 = (1_u64 << u32::BITS) as f64;

/// By set.
static KEPT: [OnceLock<Vec<[u32; 3]>>; SETS] = [const { OnceLock::new() }; SETS];

/// Points of the unit cube, as many as a receiver has rays at most: one of a few Owen-scrambled Sobol' sequences, the digits of which are
/// shifted at random. However many of them are taken, they are as even as those of the sequence.
///
/// T. Kollig and A. Keller, Efficient multidimensional sampling, 2002.
pub(super) struct Numbers {
    kept: &'static [[u32; 3]],
    shift: [u32; 3],
}

impl Numbers {
    /// The points of this seed.
    pub(super) fn new(seed: u32) -> Self {
        let mut last = seed;
        let mut random = || {
            last = hash(last);
            last
        };
        let set = random() as usize % SETS;
        let point = |index| {
            let [x, y, z, _] = sample_4d(index, 0, set as u32);
            [x, y, z].map(|coordinate| (f64::from(coordinate) * WHOLE) as u32)
        };
        let kept = KEPT[set].get_or_init(|| (0..MOST_RAYS).map(point).collect());
        Self { kept, shift: [(); 3].map(|()| random()) }
    }

    /// The point of this number.
    pub(super) fn get(&self, number: usize) -> [f64; 3] {
        let [x, y, z] = self.kept[number];
        let [of_x, of_y, of_z] = self.shift;
        [x ^ of_x, y ^ of_y, z ^ of_z].map(|coordinate| f64::from(coordinate) / WHOLE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each of so many equal parts of an axis has one of as many points, and each of a square's one of the points' first two coordinates.
    #[test]
    fn points_are_even_on_each_axis_and_on_a_square() {
        for seed in 0..40 {
            let numbers = Numbers::new(seed);
            for count in [1, 64, MOST_RAYS as usize] {
                for axis in 0..3 {
                    let mut parts: Vec<usize> = (0..count)
                        .map(|number| (numbers.get(number)[axis] * count as f64) as usize)
                        .collect();
                    parts.sort_unstable();
                    assert!(
                        parts.into_iter().eq(0..count),
                        "{count} points of seed {seed} along axis {axis}"
                    );
                }
                let side = f64::from(count.isqrt() as u32);
                let mut cells: Vec<[usize; 2]> = (0..count)
                    .map(|number| numbers.get(number))
                    .map(|[x, y, _]| [x, y].map(|coordinate| (coordinate * side) as usize))
                    .collect();
                cells.sort_unstable();
                cells.dedup();
                assert_eq!(cells.len(), count, "{count} points of seed {seed}");
            }
        }
    }

    #[test]
    fn seeds_have_points_of_their_own() {
        let mut first: Vec<[u64; 3]> =
            (0..1000).map(|seed| Numbers::new(seed).get(0).map(f64::to_bits)).collect();
        first.sort_unstable();
        first.dedup();
        assert_eq!(first.len(), 1000);
        // Their mean is the middle, within some standard errors.
        for axis in 0..3 {
            let mean = (0..1000).map(|seed| Numbers::new(seed).get(0)[axis]).sum::<f64>() / 1000.0;
            assert!((mean - 0.5).abs() < 0.05, "{mean} on axis {axis}");
        }
    }
}
