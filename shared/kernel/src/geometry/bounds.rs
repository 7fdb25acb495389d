use std::borrow::Borrow;

use glam::DVec3;

/// An axis-aligned box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Least coordinates.
    pub low: DVec3,
    /// Largest coordinates.
    pub high: DVec3,
}

impl Bounds {
    /// The box around nothing, inside out.
    pub const EMPTY: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    /// The smallest box around some points.
    #[must_use]
    pub fn around(points: impl IntoIterator<Item = impl Borrow<DVec3>>) -> Self {
        let include = |Self { low, high }, point: DVec3| Self { low: low.min(point), high: high.max(point) };
        points.into_iter().fold(Self::EMPTY, |bounds, point| include(bounds, *point.borrow()))
    }

    /// The smallest box around two.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// The box with each side moved outwards.
    #[must_use]
    pub fn padded(self, by: DVec3) -> Self {
        Self { low: self.low - by, high: self.high + by }
    }

    /// The middle.
    #[must_use]
    pub fn centre(&self) -> DVec3 {
        (self.low + self.high) * 0.5
    }

    /// Lengths of the sides.
    #[must_use]
    pub fn extent(&self) -> DVec3 {
        self.high - self.low
    }

    /// Half of the sides' lengths.
    #[must_use]
    pub fn half(&self) -> DVec3 {
        self.extent() * 0.5
    }

    /// Length of the diagonal.
    #[must_use]
    pub fn diagonal(&self) -> f64 {
        self.extent().length()
    }

    /// Largest absolute coordinate.
    #[must_use]
    pub fn largest_coordinate(&self) -> f64 {
        self.low.abs().max(self.high.abs()).max_element()
    }

    /// The eight corners: bit 0 of the index says whether x is the larger one, and so on.
    #[must_use]
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            DVec3::from_array(std::array::from_fn(|axis| {
                if i >> axis & 1 == 1 { self.high[axis] } else { self.low[axis] }
            }))
        })
    }

    /// The largest of n . x over the box.
    #[must_use]
    pub fn farthest_along(&self, n: DVec3) -> f64 {
        n.dot(self.centre()) + n.abs().dot(self.extent()) * 0.5
    }

    /// True where two boxes touch or overlap.
    #[must_use]
    pub fn meets(&self, other: &Self) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }
}
