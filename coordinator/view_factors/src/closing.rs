//! Closing rows: the smallest change of the estimated pairs with which the rows of closed surfaces sum to 1.
//!
//! Exchange areas G with variances v, and closed rows whose sums miss the area A by r. Wanted are the changes d, the same for
//! both directions of a pair, with the least sum of d^2 / v. With a multiplier m for each closed row, and 0 for all others,
//!
//! ```text
//! d_ij = v_ij (m_i + m_j),    d_ii = v_ii m_i,    sum_j d_ij = r_i
//! ```
//!
//! which is a symmetric, positive semidefinite system for the multipliers. Pairs without a variance do not change.

use super::ExchangePair;

/// Sums that miss the area by no more than this part of it are closed: rounding.
const CLOSED: f64 = 1e-14;

/// Most steps of the conjugate gradients.
const MOST_STEPS: usize = 2000;

/// Most times that pairs which would become negative are held at 0, and the others solved again.
const MOST_ROUNDS: usize = 20;

/// Changes pairs so that the rows of `closed` surfaces sum to their areas, as far as pairs with a variance allow. Pairs stay
/// positive or become 0.
pub fn close(pairs: &mut [ExchangePair], areas: &[f64], closed: &[bool]) {
    let mut free: Vec<f64> = pairs.iter().map(|pair| pair.variance).collect();
    for _ in 0..MOST_ROUNDS {
        let missing = missing(pairs, areas, closed);
        let is_done = missing.iter().zip(areas).all(|(missing, area)| missing.abs() <= CLOSED * area);
        if is_done {
            return;
        }
        let multipliers = multipliers(pairs, &free, &missing, areas, closed);
        let mut held = false;
        for (pair, variance) in pairs.iter_mut().zip(&mut free) {
            pair.area += change(pair, *variance, &multipliers);
            if pair.area < 0.0 {
                pair.area = 0.0;
                *variance = 0.0;
                held = true;
            }
        }
        if !held {
            return;
        }
    }
}

fn change(pair: &ExchangePair, variance: f64, multipliers: &[f64]) -> f64 {
    let [from, to] = [pair.from as usize, pair.to as usize];
    if from == to { variance * multipliers[from] } else { variance * (multipliers[from] + multipliers[to]) }
}

/// What the closed rows' sums lack; 0 for the others.
fn missing(pairs: &[ExchangePair], areas: &[f64], closed: &[bool]) -> Vec<f64> {
    let mut missing = areas.to_vec();
    for pair in pairs {
        missing[pair.from as usize] -= pair.area;
        if pair.from != pair.to {
            missing[pair.to as usize] -= pair.area;
        }
    }
    missing.iter().zip(closed).map(|(missing, closed)| if *closed { *missing } else { 0.0 }).collect()
}

/// Conjugate gradients, preconditioned with the diagonal.
fn multipliers(
    pairs: &[ExchangePair],
    free: &[f64],
    missing: &[f64],
    areas: &[f64],
    closed: &[bool],
) -> Vec<f64> {
    let count = areas.len();
    let apply = |values: &[f64]| {
        let mut sums = vec![0.0; count];
        for (pair, variance) in pairs.iter().zip(free) {
            let change = change(pair, *variance, values);
            sums[pair.from as usize] += change;
            if pair.from != pair.to {
                sums[pair.to as usize] += change;
            }
        }
        for (sum, closed) in sums.iter_mut().zip(closed) {
            *sum *= f64::from(u8::from(*closed));
        }
        sums
    };
    let mut diagonal = vec![0.0; count];
    for (pair, variance) in pairs.iter().zip(free) {
        diagonal[pair.from as usize] += variance;
        if pair.from != pair.to {
            diagonal[pair.to as usize] += variance;
        }
    }
    let precondition = |values: &[f64]| -> Vec<f64> {
        let divide = |(value, diagonal): (&f64, &f64)| if *diagonal > 0.0 { value / diagonal } else { 0.0 };
        values.iter().zip(&diagonal).map(divide).collect()
    };
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut solution = vec![0.0; count];
    // A row without a variance cannot be closed.
    let mut residual: Vec<f64> =
        missing.iter().zip(&diagonal).map(|(missing, d)| if *d > 0.0 { *missing } else { 0.0 }).collect();
    let mut scaled = precondition(&residual);
    let mut direction = scaled.clone();
    let mut product = dot(&residual, &scaled);
    for _ in 0..MOST_STEPS {
        if residual.iter().zip(areas).all(|(residual, area)| residual.abs() <= 0.1 * CLOSED * area) {
            break;
        }
        let image = apply(&direction);
        let curvature = dot(&direction, &image);
        // What is left lies where nothing can change it.
        if curvature <= 0.0 || !curvature.is_finite() {
            break;
        }
        let step = product / curvature;
        for i in 0..count {
            solution[i] += step * direction[i];
            residual[i] -= step * image[i];
        }
        scaled = precondition(&residual);
        let next = dot(&residual, &scaled);
        let turn = next / product;
        product = next;
        for (direction, scaled) in direction.iter_mut().zip(&scaled) {
            *direction = scaled + turn * *direction;
        }
    }
    solution
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(from: u32, to: u32, area: f64, variance: f64) -> ExchangePair {
        ExchangePair { from, to, area, variance }
    }

    fn sums(pairs: &[ExchangePair], count: usize) -> Vec<f64> {
        missing(pairs, &vec![0.0; count], &vec![true; count]).iter().map(|sum| -sum).collect()
    }

    /// Three surfaces: the exact pair stays, and the surer one of the others moves less.
    #[test]
    fn rows_close_and_exact_pairs_stay() {
        let mut pairs =
            [pair(0, 1, 0.5, 0.0), pair(0, 2, 0.49, 1e-4), pair(1, 2, 0.52, 4e-4), pair(2, 2, 1.0, 1e-4)];
        close(&mut pairs, &[1.0, 1.0, 2.0], &[true; 3]);
        assert_eq!(pairs[0].area, 0.5);
        for (sum, area) in sums(&pairs, 3).iter().zip([1.0, 1.0, 2.0]) {
            assert!((sum - area).abs() < 1e-13, "{pairs:?}");
        }
    }

    /// One row that lacks 0.03 over two pairs: the change goes as the variance.
    #[test]
    fn change_is_in_proportion_to_variance() {
        let mut pairs = [pair(0, 1, 0.4, 1e-4), pair(0, 2, 0.57, 2e-4)];
        close(&mut pairs, &[1.0, 9.0, 9.0], &[true, false, false]);
        assert!((pairs[0].area - 0.41).abs() < 1e-13 && (pairs[1].area - 0.59).abs() < 1e-13, "{pairs:?}");
    }

    #[test]
    fn open_rows_and_exact_rows_are_left_alone() {
        let before = [pair(0, 1, 0.4, 1e-4), pair(1, 2, 0.3, 0.0)];
        let mut pairs = before;
        close(&mut pairs, &[1.0; 3], &[false, false, true]);
        assert_eq!(pairs, before);
    }

    #[test]
    fn no_pair_becomes_negative() {
        let mut pairs = [pair(0, 1, 0.01, 1.0), pair(0, 2, 1.2, 1.0), pair(1, 2, 0.3, 1.0)];
        close(&mut pairs, &[1.0, 9.0, 9.0], &[true, false, false]);
        assert_eq!(pairs[0].area, 0.0);
        assert!((pairs[1].area - 1.0).abs() < 1e-13, "{pairs:?}");
    }
}
