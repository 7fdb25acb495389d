//! What the factors of a group are written relative to.

/// Bits of a width.
pub const WIDTH_BITS: u32 = 5;

/// The least factor is rounded down to a multiple of 2^(width - 3): it then takes fewer bits, and one group in eight a bit more
/// for each factor. With 2 or 4 in this place rows are longer.
const KEPT: u32 = 3;

/// Numbers from `first` on are written as their difference from it, in `width` bits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Bits of a difference.
    pub width: u32,
    /// Of the first number and 2^step.
    pub quotient: u32,
}

impl Scale {
    /// The scale for numbers from the least to the largest.
    pub fn new(least: u32, largest: u32) -> Self {
        let narrow = Self::of_width(u32::BITS - (largest - least).leading_zeros(), least);
        if u64::from(largest - narrow.first()) < 1 << narrow.width {
            return narrow;
        }
        // Rounding took less than a quarter of what a bit more has room for.
        Self::of_width(narrow.width + 1, least)
    }

    fn of_width(width: u32, least: u32) -> Self {
        let scale = Self { width, quotient: 0 };
        Self { quotient: least >> scale.step(), ..scale }
    }

    /// Binary digits that the first number does not have.
    pub fn step(self) -> u32 {
        self.width.saturating_sub(KEPT)
    }

    /// The number that is written as 0.
    pub fn first(self) -> u32 {
        self.quotient << self.step()
    }
}
