//! How bright a place may be before its brightness counts no more: what a lamp's housing reflects would hide all errors in the room
//! around it.

use rayon::prelude::*;

/// Part of the area that may be brighter.
const BRIGHTEST: f64 = 0.002;

/// A radiosity that little of the area exceeds. What is brighter counts as if it were as bright as this, its errors in proportion.
#[derive(Debug, Clone, Copy)]
pub struct Cap {
    square: f64,
}

impl Cap {
    /// All count as bright as they are.
    pub const NONE: Self = Self { square: f64::INFINITY };

    /// The cap of places with this square of the radiosity and this area; none where so little of the area is lit.
    pub fn over(mut places: Vec<(f64, f64)>) -> Self {
        let rest: f64 = places.iter().map(|(_, area)| BRIGHTEST * area).sum();
        places.par_sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        let mut brighter = 0.0;
        let first = places.into_iter().find(|(_, area)| {
            brighter += area;
            brighter > rest
        });
        first.filter(|(square, _)| *square > 0.0).map_or(Self::NONE, |(square, _)| Self { square })
    }

    /// Square of the radiosity under the cap, integrated over places with this square of it and this area.
    pub fn norm(self, places: &[(f64, f64)]) -> f64 {
        places.iter().map(|(square, area)| area * square * self.part(*square)).sum()
    }

    /// Part that counts of a square error where the square of the radiosity is this.
    pub fn part(self, square: f64) -> f64 {
        if square > self.square { self.square / square } else { 1.0 }
    }
}

/// The part of the first values that each holds, plus that of the second: what both tell of places.
pub fn parts_of_both(all: &[f64], capped: &[f64]) -> Vec<f64> {
    let [of_all, of_capped] = [all, capped].map(|values| {
        let sum: f64 = values.iter().sum();
        if sum > 0.0 { sum.recip() } else { 0.0 }
    });
    all.iter().zip(capped).map(|(all, capped)| all * of_all + capped * of_capped).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_brightest_places_count_as_much_as_those_that_are_left() {
        let cap = Cap::over(vec![(4.0, 0.999), (100.0, 0.001)]);
        assert_eq!([1.0, 4.0, 100.0].map(|square| cap.part(square)), [1.0, 1.0, 0.04]);
        assert_eq!(cap.norm(&[(1.0, 3.0), (100.0, 0.5)]), 5.0);
    }

    #[test]
    fn light_of_more_places_is_not_capped_nor_the_only_light() {
        for places in [vec![(4.0, 0.99), (100.0, 0.01)], vec![(0.0, 0.999), (100.0, 0.001)], vec![]] {
            assert_eq!(Cap::over(places).part(100.0), 1.0);
        }
    }
}
