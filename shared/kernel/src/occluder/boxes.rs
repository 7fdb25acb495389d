//! Boxes side by side: many are tested against a shaft at once.

use glam::DVec3;

use crate::geometry::Bounds;
use crate::geometry::lanes::{LANES, Mask, Vectors};
use crate::simd::widest;

/// A box that misses a half space by less than this, relative to the coordinates, is inside: rounding.
const ROUNDING: f64 = 1e-12;

/// Half spaces that are tested before it is checked whether any box is left.
const AT_ONCE: usize = 6;

/// A half space: inside where normal . x >= offset.
pub type HalfSpace = (DVec3, f64);

/// Axis-aligned boxes.
#[derive(Debug, Default)]
pub struct Boxes {
    /// Middles, [`LANES`] by [`LANES`].
    centres: Vec<Vectors>,
    /// Half of the sides' lengths.
    halves: Vec<Vectors>,
    count: usize,
    /// Largest absolute coordinate.
    largest: f64,
}

/// A half space as boxes are tested against it.
struct Test {
    normal: [f64; 3],
    size: [f64; 3],
    limit: f64,
}

impl Boxes {
    /// Removes all.
    pub fn clear(&mut self) {
        self.centres.clear();
        self.halves.clear();
        self.count = 0;
        self.largest = 0.0;
    }

    /// Adds one.
    pub fn push(&mut self, bounds: &Bounds) {
        self.add(bounds.centre(), bounds.half());
        self.largest = self.largest.max(bounds.largest_coordinate());
    }

    fn add(&mut self, centre: DVec3, half: DVec3) {
        let lane = self.count % LANES;
        if lane == 0 {
            self.centres.push(Vectors::ZERO);
            self.halves.push(Vectors::ZERO);
        }
        if let (Some(centres), Some(halves)) = (self.centres.last_mut(), self.halves.last_mut()) {
            centres.set(lane, centre);
            halves.set(lane, half);
        }
        self.count += 1;
    }

    /// Makes these the boxes of another set with these numbers.
    pub fn take(&mut self, others: &Self, numbers: &[u32]) {
        self.clear();
        for number in numbers {
            let (block, lane) = (*number as usize / LANES, *number as usize % LANES);
            let (centre, half) = (others.centres[block].get(lane), others.halves[block].get(lane));
            self.add(centre, half);
        }
        self.largest = others.largest;
    }

    /// The numbers of the boxes that none of these half spaces leaves out as a whole, in ascending order.
    pub fn inside(&self, spaces: &[HalfSpace], numbers: &mut Vec<u32>) {
        let test = |(normal, offset): &HalfSpace| {
            let size = normal.abs();
            let slack = ROUNDING * (size.element_sum() * self.largest + offset.abs());
            Test { normal: normal.to_array(), size: size.to_array(), limit: offset - slack }
        };
        let tests: Vec<Test> = spaces.iter().map(test).collect();
        numbers.clear();
        widest(
            #[inline(always)]
            || {
                for (block, (centres, halves)) in self.centres.iter().zip(&self.halves).enumerate() {
                    let mut inside = inside_of(centres, halves, &tests);
                    while inside != 0 {
                        numbers.push((block * LANES) as u32 + inside.trailing_zeros());
                        inside &= inside - 1;
                    }
                }
            },
        );
        // The last lanes may be empty.
        while numbers.last().is_some_and(|number| *number as usize >= self.count) {
            numbers.pop();
        }
    }
}

/// The boxes that no test leaves out.
#[inline(always)]
fn inside_of(centres: &Vectors, halves: &Vectors, tests: &[Test]) -> Mask {
    let mut least = [f64::INFINITY; LANES];
    for some in tests.chunks(AT_ONCE) {
        for Test { normal: [x, y, z], size: [a, b, c], limit } in some {
            for (lane, least) in least.iter_mut().enumerate() {
                let centre = x * centres.x[lane] + y * centres.y[lane] + z * centres.z[lane];
                let reach = a * halves.x[lane] + b * halves.y[lane] + c * halves.z[lane];
                let over = centre + reach - limit;
                *least = if over < *least { over } else { *least };
            }
        }
        if least.iter().fold(f64::NEG_INFINITY, |most, one| if *one > most { *one } else { most }) < 0.0 {
            return 0;
        }
    }
    let mut inside = 0;
    for (lane, least) in least.iter().enumerate() {
        inside |= Mask::from(*least >= 0.0) << lane;
    }
    inside
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn vector(range: std::ops::Range<f64>) -> impl Strategy<Value = DVec3> {
        [range.clone(), range.clone(), range].prop_map(DVec3::from_array)
    }

    proptest! {
        /// No box is left out of which a corner is inside; and one is where all corners are well outside of one half space.
        #[test]
        fn boxes_are_left_out_as_a_whole(
            boxes in prop::collection::vec((vector(-9.0..9.0), vector(0.0..2.0)), 0..50),
            spaces in prop::collection::vec((vector(-1.0..1.0), -5.0..5.0), 0..7),
        ) {
            let boxes: Vec<Bounds> =
                boxes.into_iter().map(|(low, size)| Bounds { low, high: low + size }).collect();
            let mut all = Boxes::default();
            boxes.iter().for_each(|bounds| all.push(bounds));
            let mut found = vec![7];
            all.inside(&spaces, &mut found);
            for (number, bounds) in (0..).zip(&boxes) {
                let over = |(normal, offset): &HalfSpace| {
                    bounds.corners().iter().map(|corner| normal.dot(*corner) - offset).fold(f64::MIN, f64::max)
                };
                let least = spaces.iter().map(over).fold(f64::INFINITY, f64::min);
                if least >= 0.0 {
                    prop_assert!(found.contains(&number));
                } else if least < -1e-9 {
                    prop_assert!(!found.contains(&number));
                }
            }
            prop_assert!(found.is_sorted() && found.last().is_none_or(|last| (*last as usize) < boxes.len()));
        }
    }
}
