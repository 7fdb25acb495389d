//! Anderson acceleration: a fixed point of light in fewer passes.
//!
//! Passing light on, x' = T x + e, shrinks what is missing by the reflectance at each pass. The differences of earlier passes
//! tell how T acts along them, and the residual along these is removed at once: D. G. Anderson, "Iterative procedures for
//! nonlinear integral equations", Journal of the ACM 12 (1965); for linear equations equivalent to GMRES (H. F. Walker and P. Ni,
//! "Anderson acceleration for fixed-point iterations", SIAM Journal on Numerical Analysis 49, 2011).

use rayon::prelude::*;

use super::Light;
use super::rooms::Rooms;

/// Remembered differences.
const MEMORY: usize = 6;

/// Values that a thread takes at a time.
const VALUES_AT_ONCE: usize = 4096;

/// Of a direction less than this, of the square of its length, is rounding.
const ROUNDING: f64 = 1e-20;

/// An accelerated fixed-point iteration, independent for each channel and each room.
pub struct Acceleration<L> {
    /// Area of each value, its weight in norms.
    areas: Vec<f64>,
    rooms: Rooms,
    /// The last value and its residual.
    last: Option<(Vec<L>, Vec<L>)>,
    /// First those that are kept, then the others, oldest first.
    directions: Vec<Direction<L>>,
    /// How many are kept whatever follows.
    kept: usize,
}

/// A change of the values, and the change of the residual that it causes; the latter are orthogonal to each other.
struct Direction<L> {
    value: Vec<L>,
    residual: Vec<L>,
    /// Square of the residual's length, by room.
    square: Vec<L>,
}

impl<L: Light> Acceleration<L> {
    /// Starts with the area of each value, its weight in norms, and the room of each: between these no light passes.
    #[must_use]
    pub fn new(areas: Vec<f64>, rooms: Rooms) -> Self {
        Self { areas, rooms, last: None, directions: vec![], kept: 0 }
    }

    /// Keeps a change of the values for good, given what a pass makes of it where nothing shines. To be called before any values come.
    pub fn keep_direction(&mut self, value: Vec<L>, passed: &[L]) {
        let residual = difference(passed, &value);
        self.remember(value, residual);
        self.kept = self.directions.len();
    }

    /// Returns the next values after `values`, of which a pass made `passed`.
    #[must_use]
    pub fn next(&mut self, values: Vec<L>, passed: &[L]) -> Vec<L> {
        let residual = difference(passed, &values);
        if let Some((last_values, last_residual)) = &self.last {
            let value = difference(&values, last_values);
            let change = difference(&residual, last_residual);
            self.remember(value, change);
        }
        let mut next = passed.to_vec();
        let mut rest = residual.clone();
        for direction in &self.directions {
            let steps = self.along(&rest, direction);
            self.add(&mut next, &steps, |i| direction.value[i] + direction.residual[i]);
            self.add(&mut rest, &steps, |i| direction.residual[i]);
        }
        self.last = Some((values, residual));
        next
    }

    fn remember(&mut self, mut value: Vec<L>, mut residual: Vec<L>) {
        if self.directions.len() == self.kept + MEMORY {
            self.directions.remove(self.kept);
        }
        let whole = self.product(&residual, &residual);
        for old in &self.directions {
            let steps = self.along(&residual, old);
            self.add(&mut residual, &steps, |i| old.residual[i]);
            self.add(&mut value, &steps, |i| old.value[i]);
        }
        let left = self.product(&residual, &residual);
        // A change that the older ones tell of already leaves rounding, which is no direction.
        let square = left.iter().zip(&whole).map(|(left, whole)| left.above(*whole * ROUNDING)).collect();
        self.directions.push(Direction { value, residual, square });
    }

    /// The multiple of a direction, by room, that added to a residual leaves least of it.
    fn along(&self, residual: &[L], direction: &Direction<L>) -> Vec<L> {
        // A channel or room without light has no direction.
        let product = self.product(residual, &direction.residual);
        product.iter().zip(&direction.square).map(|(part, whole)| L::ratio(*part, *whole) * -1.0).collect()
    }

    /// Adds a multiple of other values, by room.
    fn add(&self, to: &mut [L], steps: &[L], value: impl Fn(usize) -> L + Sync) {
        let all = to.par_iter_mut().zip(self.rooms.of()).enumerate().with_min_len(VALUES_AT_ONCE);
        all.for_each(|(i, (to, room))| *to += steps[*room as usize] * value(i));
    }

    /// Inner product, by room, weighted by area.
    fn product(&self, one: &[L], other: &[L]) -> Vec<L> {
        self.rooms.sums(|i| one[i] * other[i] * self.areas[i])
    }
}

fn difference<L: Light>(one: &[L], other: &[L]) -> Vec<L> {
    let all = one.par_iter().zip(other).with_min_len(VALUES_AT_ONCE);
    all.map(|(one, other)| *one - *other).collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// A ring of walls that give light to each other, the less the farther apart, and reflect this much of it.
    fn pass(values: &[DVec3], reflectance: DVec3) -> Vec<DVec3> {
        let count = values.len();
        let weight = |i: usize, j: usize| 0.5_f64.powi(i.abs_diff(j).min(count - i.abs_diff(j)) as i32);
        let all: f64 = (1..count).map(|j| weight(0, j)).sum();
        (0..count)
            .map(|i| {
                let others = (0..count).filter(|j| *j != i);
                let met: DVec3 = others.map(|j| values[j] * weight(i, j) / all).sum();
                reflectance * (met + if i == 0 { DVec3::new(1.0, 2.0, 0.0) } else { DVec3::ZERO })
            })
            .collect()
    }

    fn passes(accelerated: bool, reflectance: DVec3) -> (usize, Vec<DVec3>) {
        let mut acceleration = Acceleration::new(vec![1.0; 40], Rooms::one(40));
        let mut values = vec![DVec3::ZERO; 40];
        for count in 1..10_000 {
            let passed = pass(&values, reflectance);
            let changed: f64 = passed.iter().zip(&values).map(|(a, b)| (*a - *b).abs().element_sum()).sum();
            if changed < 1e-9 {
                return (count, passed);
            }
            values = if accelerated { acceleration.next(values, &passed) } else { passed };
        }
        panic!("no end");
    }

    #[test]
    fn the_same_fixed_point_is_found_in_fewer_passes() {
        let reflectance = DVec3::new(0.9, 0.5, 0.7);
        let ((plain, expected), (fewer, found)) = (passes(false, reflectance), passes(true, reflectance));
        assert!(3 * fewer < plain, "{fewer} passes, {plain} without acceleration");
        for (found, expected) in found.iter().zip(&expected) {
            assert!((*found - *expected).abs().max_element() < 1e-7, "{found} is not {expected}");
            assert_eq!(found.z, 0.0, "no light in this channel");
        }
    }
}
