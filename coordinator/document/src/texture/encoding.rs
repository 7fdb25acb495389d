//! Encoding of stored colours.

use std::sync::LazyLock;

/// How the colours of an image are encoded. Alpha is always linear.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// sRGB, as base colour, emission and specular colour are.
    Srgb,
    /// As they are: metallic and roughness.
    Linear,
}

impl Encoding {
    /// Linear value of a stored one.
    #[must_use]
    pub fn decode(self, stored: u8) -> f64 {
        match self {
            Self::Srgb => SRGB[usize::from(stored)],
            Self::Linear => f64::from(stored) / 255.0,
        }
    }
}

/// Linear value of each stored one.
static SRGB: LazyLock<[f64; 256]> =
    LazyLock::new(|| std::array::from_fn(|stored| srgb_to_linear(stored as f64 / 255.0)));

/// Linear value of an sRGB one in [0, 1], by IEC 61966-2-1. The power is computed in software: the same bits everywhere.
#[must_use]
pub fn srgb_to_linear(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) }
}

/// sRGB value of a linear one in [0, 1]: the inverse of [`srgb_to_linear`].
#[must_use]
pub fn linear_to_srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_and_middle_of_the_curve() {
        assert_eq!((Encoding::Srgb.decode(0), Encoding::Srgb.decode(255)), (0.0, 1.0));
        // Half of the way up encodes about a fifth of the light; 188 is the usual code of a half.
        assert!((srgb_to_linear(0.5) - 0.214_041_14).abs() < 1e-8);
        assert!((Encoding::Srgb.decode(188) - 0.5).abs() < 3e-3);
        assert_eq!(Encoding::Linear.decode(51), 0.2);
    }

    #[test]
    fn both_parts_of_the_curve_meet() {
        let (below, above) = (srgb_to_linear(0.04045), srgb_to_linear(0.040_450_001));
        assert!((above - below).abs() < 1e-7, "{below} {above}");
    }
}
