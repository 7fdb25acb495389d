/// Binary digits of an f32 after its first.
const ALL_DIGITS: u32 = f32::MANTISSA_DIGITS - 1;

/// Binary digits of an f64 after its first.
const F64_DIGITS: u32 = f64::MANTISSA_DIGITS - 1;

/// Rounds factors to so few binary digits as a relative error allows: those of a row then take fewer bytes on their way.
///
/// Relative to each factor and not to the row, so that receivers far from the light are rounded as little as those beside it: the
/// sum of all errors of a row is under this part of the row's sum, and so is that of any part of it.
///
/// Up or down at random, with chances that make the mean right. Rounding to the nearest would do half the error to a factor, but the
/// same one to all that are alike, and rooms are full of those: the sum of what a point sees is then off by as much, and n
/// interreflections make n times of it. Between white walls (reflectance .999, a box of 1 to .01) irradiance was off by 1.5 %.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rounding {
    /// Binary digits that are kept after the first.
    digits: u32,
}

impl Rounding {
    /// With so large a relative error at most; to the nearest f32 where it is under what f32 can keep.
    #[must_use]
    pub fn new(error: f64) -> Self {
        let step = |digits: u32| 0.5_f64.powi(digits as i32);
        Self { digits: (0..ALL_DIGITS).find(|digits| step(*digits) <= error).unwrap_or(ALL_DIGITS) }
    }

    /// One of the two numbers beside a factor that have these digits. `draw` decides which: of all draws a part goes up that is as
    /// large as the rest cut off. What is too large for f32 becomes its largest number.
    #[must_use]
    pub fn apply(self, factor: f64, draw: u32) -> f32 {
        let most = f64::from(f32::MAX);
        if self.digits == ALL_DIGITS {
            return factor.min(most) as f32;
        }
        let dropped = F64_DIGITS - self.digits;
        // Digits that carry over into the exponent give the next power of two, which is right.
        let part = u64::from(draw) << (F64_DIGITS - u32::BITS) >> self.digits;
        let rounded = (factor.to_bits() + part) >> dropped << dropped;
        f64::from_bits(rounded).min(most) as f32
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_error_is_what_is_allowed(
            exponent in -126.0..127.9, error in prop_oneof![Just(-13.3), -24.0..-0.5].prop_map(f64::exp2), draw: u32) {
            let factor = f64::exp2(exponent);
            let rounded = f64::from(Rounding::new(error).apply(factor, draw));
            prop_assert!((rounded - factor).abs() <= error * factor, "{factor} becomes {rounded}");
        }

        /// Factors of f32 that are denormal have fewer digits to begin with.
        #[test]
        fn tiny_factors_lose_no_more(bits in 1_u32..1 << 23, draw: u32) {
            let factor = f32::from_bits(bits);
            let rounded = Rounding::new(1e-4).apply(f64::from(factor), draw);
            prop_assert!((f64::from(rounded) - f64::from(factor)).abs() <= 1e-4 * f64::from(factor));
        }

        #[test]
        fn the_mean_is_right(part in 0.0..1.0, digits in 0..ALL_DIGITS) {
            let step = 0.5_f64.powi(digits as i32);
            let rounding = Rounding::new(step);
            // Every draw once, but for its lower half.
            let draws = (0..1 << 16).map(|draw| rounding.apply(1.0 + part * step, draw << 16 | 0x8000));
            let mean = draws.map(|rounded| (f64::from(rounded) - 1.0) / step).sum::<f64>() / f64::from(1 << 16);
            prop_assert!(f64::abs(mean - part) <= 1e-4, "{mean} for {part}");
        }
    }

    #[test]
    fn ten_thousandths_leave_fourteen_digits() {
        let rounding = Rounding::new(1e-4);
        assert_eq!(rounding, Rounding { digits: 14 });
        let step = 0.5_f64.powi(14);
        for draw in [0, 1, u32::MAX] {
            // What has no more digits stays as it is.
            assert_eq!(rounding.apply(1.0 + step, draw), (1.0 + step) as f32);
            assert_eq!(rounding.apply(0.0, draw), 0.0);
        }
        assert_eq!(rounding.apply(1.0 + 0.7 * step, u32::MAX / 2), (1.0 + step) as f32);
        assert_eq!(rounding.apply(1.0 + 0.3 * step, u32::MAX / 2), 1.0);
        assert_eq!(rounding.apply(2.0 - 0.3 * step, u32::MAX / 2), 2.0);
        // Rounded up this is 2^128, which f32 does not have.
        assert_eq!(rounding.apply(f64::from(f32::MAX), u32::MAX), f32::MAX);
        assert_eq!(rounding.apply(1e300, 0), f32::MAX);
    }

    #[test]
    fn without_an_error_all_digits_are_kept() {
        for factor in [0.1, 1.0 / 3.0, 1e-40, 3e38] {
            assert_eq!(Rounding::new(0.0).apply(factor, u32::MAX), factor as f32);
            assert_eq!(Rounding::new(1e-8).apply(factor, u32::MAX), factor as f32);
        }
    }
}
