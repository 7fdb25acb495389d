//! Running sums, and which of them a part of the last one falls on.

use std::ops::Range;

/// Running sums, none less than the one before.
#[derive(Default)]
pub(super) struct RunningSums {
    sums: Vec<f64>,
    /// Number of sums that are no more than each of the equal parts of the last one, from none of it to all.
    starts: Vec<u32>,
}

impl RunningSums {
    /// Takes other sums, at least one, that so many parts will be looked for in.
    pub(super) fn set(&mut self, sums: impl Iterator<Item = f64>, looks: u32) {
        self.sums.clear();
        self.sums.extend(sums);
        let mut start = 0;
        // A power of two: these parts are exact, and so is the one that a choice is in.
        let parts = (self.sums.len() as u32).min(looks).next_power_of_two();
        self.starts.clear();
        for part in 0..=parts {
            let end = self.all() * (f64::from(part) / f64::from(parts));
            start += self.sums[start..].iter().take_while(|sum| **sum <= end).count();
            self.starts.push(start as u32);
        }
    }

    /// The last sum.
    pub(super) fn all(&self) -> f64 {
        self.sums[self.sums.len() - 1]
    }

    /// Which of the sums this part of the last one, from 0 up to 1, falls on, and between which sums that is.
    pub(super) fn find(&self, part: f64) -> (usize, Range<f64>) {
        let Self { sums, starts } = self;
        let parts = starts.len() - 1;
        let near = (part * parts as f64) as usize;
        let [first, end] = [near, near + 1].map(|at| starts[at.min(parts)] as usize);
        let wanted = part * self.all();
        let index = first + sums[first..end].partition_point(|sum| *sum <= wanted);
        let index = index.min(sums.len() - 1);
        (index, if index == 0 { 0.0 } else { sums[index - 1] }..sums[index])
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// As a search of all sums does, with parts of no size and of most of it.
        #[test]
        fn finds_what_a_search_of_all_finds(
            sizes in prop::collection::vec(prop_oneof![Just(0.0), 0.0..1.0, 0.0..1e-9, 0.0..1e3], 1..200),
            looks in 1_u32..300,
            part in 0.0..1.0,
        ) {
            let mut sum = 0.0;
            let plain: Vec<f64> = sizes.iter().map(|size| { sum += size; sum }).collect();
            let mut sums = RunningSums::default();
            sums.set([5.0, 7.0].into_iter(), 3);
            sums.set(plain.iter().copied(), looks);
            prop_assert_eq!(sums.all(), sum);
            // On the borders of the parts, too.
            let borders = (0..looks).map(|border| f64::from(border) / f64::from(looks));
            for part in borders.chain([part, 0.0, 1.0]) {
                let expected = plain.partition_point(|sum| *sum <= part * sums.all()).min(plain.len() - 1);
                let before = if expected == 0 { 0.0 } else { plain[expected - 1] };
                prop_assert_eq!(sums.find(part), (expected, before..plain[expected]));
            }
        }
    }
}
