//! Gauss-Legendre quadrature on the interval from 0 to 1.

use std::f64::consts::PI;
use std::sync::LazyLock;

use libm::cos;

/// Most nodes that a rule can have.
pub const MAX_NODES: usize = 16;

static RULES: LazyLock<Vec<Vec<Node>>> = LazyLock::new(|| (1..=MAX_NODES).map(compute).collect());

/// A place in the interval, and its weight; the weights of a rule sum to 1.
#[derive(Debug, Clone, Copy)]
pub struct Node {
    /// Between 0 and 1.
    pub place: f64,
    /// Positive.
    pub weight: f64,
}

/// The rule with this many nodes, 1 to [`MAX_NODES`]: exact for polynomials up to the degree 2 nodes - 1.
pub fn rule(nodes: usize) -> &'static [Node] {
    &RULES[nodes - 1]
}

/// The nodes are the zeros of the Legendre polynomial P of this degree, by Newton's method from a first guess that is good to
/// two digits; the weights 2 / ((1 - x^2) P'(x)^2) are those of the interval from -1 to 1.
fn compute(degree: usize) -> Vec<Node> {
    let count = degree as f64;
    let node = |index: usize| {
        let mut x = -cos(PI * (index as f64 + 0.75) / (count + 0.5));
        // Five steps are more than enough: each doubles the digits.
        for _ in 0..5 {
            let (value, slope) = legendre(degree, x);
            x -= value / slope;
        }
        let (_, slope) = legendre(degree, x);
        Node { place: f64::midpoint(1.0, x), weight: 1.0 / ((1.0 - x * x) * slope * slope) }
    };
    (0..degree).map(node).collect()
}

/// Value and slope of the Legendre polynomial of this degree, by Bonnet's recurrence.
fn legendre(degree: usize, x: f64) -> (f64, f64) {
    let (mut before, mut value) = (1.0, x);
    for k in 2..=degree {
        let k = k as f64;
        (before, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * before) / k);
    }
    (value, degree as f64 * (before - x * value) / (1.0 - x * x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rule_is_exact_for_its_polynomials() {
        for nodes in 1..=MAX_NODES {
            for power in 0..2 * nodes as i32 {
                let integral: f64 = rule(nodes).iter().map(|node| node.weight * node.place.powi(power)).sum();
                let error = integral * f64::from(power + 1) - 1.0;
                assert!(error.abs() < 4e-14, "{nodes} nodes, power {power}: off by {error:e}");
            }
        }
    }

    #[test]
    fn no_rule_is_exact_beyond() {
        for nodes in 1..=4 {
            let power = 2 * nodes as i32;
            let integral: f64 = rule(nodes).iter().map(|node| node.weight * node.place.powi(power)).sum();
            assert!((integral * f64::from(power + 1) - 1.0).abs() > 1e-5);
        }
    }
}
