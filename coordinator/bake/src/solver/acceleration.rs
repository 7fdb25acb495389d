//! Anderson acceleration: a fixed point of light in fewer passes.
//!
//! Passing light on, x' = T x + e, shrinks what is missing by the reflectance at each pass. The differences of earlier passes
//! tell how T acts along them, and the residual along these is removed at once: D. G. Anderson, "Iterative procedures for
//! nonlinear integral equations", Journal of the ACM 12 (1965); for linear equations equivalent to GMRES (H. F. Walker and P. Ni,
//! "Anderson acceleration for fixed-point iterations", SIAM Journal on Numerical Analysis 49, 2011).

use glam::DVec3;

/// Remembered differences.
const MEMORY: usize = 6;

/// An accelerated fixed-point iteration, independent for each of the three channels.
pub struct Acceleration {
    /// Weight of each value in norms.
    weights: Vec<f64>,
    /// The last value and its residual.
    last: Option<(Vec<DVec3>, Vec<DVec3>)>,
    /// Oldest first.
    directions: Vec<Direction>,
}

/// A change of the values, and the change of the residual that it causes; the latter are orthonormal.
struct Direction {
    value: Vec<DVec3>,
    residual: Vec<DVec3>,
}

impl Acceleration {
    /// Starts with the area of each value, its weight in norms.
    #[must_use]
    pub fn new(areas: Vec<f64>) -> Self {
        Self { weights: areas, last: None, directions: vec![] }
    }

    /// Returns the next values after `values`, of which a pass made `passed`.
    #[must_use]
    pub fn next(&mut self, values: Vec<DVec3>, passed: &[DVec3]) -> Vec<DVec3> {
        let residual: Vec<DVec3> = passed.iter().zip(&values).map(|(new, old)| *new - *old).collect();
        if let Some((last_values, last_residual)) = &self.last {
            let value = values.iter().zip(last_values).map(|(new, old)| *new - *old).collect();
            let change = residual.iter().zip(last_residual).map(|(new, old)| *new - *old).collect();
            self.remember(Direction { value, residual: change });
        }
        let mut next = passed.to_vec();
        for direction in &self.directions {
            let along = self.product(&residual, &direction.residual);
            for ((next, value), residual) in next.iter_mut().zip(&direction.value).zip(&direction.residual) {
                *next -= along * (*value + *residual);
            }
        }
        self.last = Some((values, residual));
        next
    }

    fn remember(&mut self, mut new: Direction) {
        if self.directions.len() == MEMORY {
            self.directions.remove(0);
        }
        for old in &self.directions {
            let along = self.product(&new.residual, &old.residual);
            subtract(&mut new.residual, along, &old.residual);
            subtract(&mut new.value, along, &old.value);
        }
        let length = self.product(&new.residual, &new.residual);
        // A channel without light has no direction.
        let inverse = DVec3::select(length.cmpgt(DVec3::ZERO), length.map(f64::sqrt).recip(), DVec3::ZERO);
        new.residual.iter_mut().chain(&mut new.value).for_each(|value| *value *= inverse);
        self.directions.push(new);
    }

    /// Inner product per channel, weighted by area.
    fn product(&self, one: &[DVec3], other: &[DVec3]) -> DVec3 {
        one.iter().zip(other).zip(&self.weights).map(|((a, b), weight)| *a * *b * *weight).sum()
    }
}

fn subtract(from: &mut [DVec3], factor: DVec3, what: &[DVec3]) {
    from.iter_mut().zip(what).for_each(|(from, what)| *from -= factor * *what);
}

#[cfg(test)]
mod tests {
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
        let mut acceleration = Acceleration::new(vec![1.0; 40]);
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
