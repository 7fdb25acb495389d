//! The light that errors are relative to: without the brightest places, as what a lamp's housing reflects would hide all errors in the
//! room around it.

use rayon::prelude::*;

/// Part of the area that may be brighter than what counts.
const BRIGHTEST: f64 = 0.002;

/// A radiosity above which places count no brighter: their errors count as a part of it.
#[derive(Debug, Clone, Copy)]
pub struct Ceiling {
    square: f64,
}

impl Ceiling {
    /// All count as bright as they are.
    pub const NONE: Self = Self { square: f64::INFINITY };

    /// What little of the area exceeds, of places with this square of the radiosity and this area.
    pub fn over(places: &[(f64, f64)]) -> Self {
        let mut places = places.to_vec();
        let rest: f64 = places.iter().map(|(_, area)| BRIGHTEST * area).sum();
        places.par_sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        let mut brighter = 0.0;
        let first = places.into_iter().find(|(_, area)| {
            brighter += area;
            brighter > rest
        });
        first.map_or(Self::NONE, |(square, _)| Self { square })
    }

    /// Part that counts of a square error where the square of the radiosity is this.
    pub fn part(self, square: f64) -> f64 {
        if square > self.square { self.square / square } else { 1.0 }
    }
}

/// How bright the surfaces are.
#[derive(Debug, Clone, Copy)]
pub struct Level {
    /// The radiosity above which places count no brighter,
    pub ceiling: Ceiling,
    /// and the mean square over the area of what counts.
    mean_square: f64,
}

impl Level {
    /// Of places with this square of the radiosity and this area.
    pub fn over(places: &[(f64, f64)]) -> Self {
        let ceiling = Ceiling::over(places);
        let counts = |(square, area): &(f64, f64)| area * square * ceiling.part(*square);
        let (sum, area) =
            places.iter().fold((0.0, 0.0), |sum, place| (sum.0 + counts(place), sum.1 + place.1));
        Self { ceiling, mean_square: if area > 0.0 { (sum / area).max(0.0) } else { 0.0 } }
    }

    /// Root mean square of the radiosity.
    pub fn radiosity(&self) -> f64 {
        self.mean_square.sqrt()
    }

    /// Root of a mean square error of the radiosity over that of the radiosity, 0 in the dark.
    pub fn relative(&self, mean_square_error: f64) -> f64 {
        if self.mean_square > 0.0 { (mean_square_error / self.mean_square).sqrt() } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_brightest_places_count_as_much_as_those_that_are_left() {
        let places = [(4.0, 0.999), (100.0, 0.001)];
        let ceiling = Ceiling::over(&places);
        assert_eq!([1.0, 4.0, 100.0].map(|square| ceiling.part(square)), [1.0, 1.0, 0.04]);
        // Larger ones are light that a room has.
        let places = [(4.0, 0.99), (100.0, 0.01)];
        assert_eq!(Ceiling::over(&places).part(100.0), 1.0);
        assert_eq!(Ceiling::over(&[]).part(100.0), 1.0);
    }
}
