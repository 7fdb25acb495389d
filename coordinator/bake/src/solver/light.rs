use std::fmt::Debug;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Mul, Sub};

use glam::DVec3;

/// Light in three channels, or in one where all light of a scene has one colour and no surface changes it: each step then costs
/// a third.
pub trait Light:
    Copy
    + Send
    + Sync
    + Debug
    + Default
    + PartialEq
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Mul<f64, Output = Self>
    + AddAssign
    + Sum
{
    /// Number of channels.
    const CHANNELS: usize;
    /// Converts from linear RGB; `colour` is the one colour of the scene.
    fn from_rgb(rgb: DVec3, colour: DVec3) -> Self;
    /// Converts to linear RGB.
    fn to_rgb(self, colour: DVec3) -> DVec3;
    /// Reflectance from linear RGB.
    fn reflectance(rgb: DVec3) -> Self;
    /// Part over whole, per channel; 0 where the whole is 0.
    fn ratio(part: Self, whole: Self) -> Self;
    /// rho / (1 - rho) per channel.
    fn interreflected(self) -> Self;
    /// The larger of two, per channel.
    fn larger(self, other: Self) -> Self;
    /// Magnitude, per channel.
    fn magnitude(self) -> Self;
    /// Itself where it is above the least, else 0, per channel.
    fn above(self, least: Self) -> Self;
    /// Sum of the channels.
    fn sum_of_channels(self) -> f64;
    /// Largest channel.
    fn largest_channel(self) -> f64;
}

impl Light for DVec3 {
    const CHANNELS: usize = 3;

    fn from_rgb(rgb: DVec3, _: DVec3) -> Self {
        rgb
    }

    fn to_rgb(self, _: DVec3) -> DVec3 {
        self
    }

    fn reflectance(rgb: DVec3) -> Self {
        rgb
    }

    fn ratio(part: Self, whole: Self) -> Self {
        DVec3::select(whole.cmpgt(DVec3::ZERO), part / whole, DVec3::ZERO)
    }

    fn interreflected(self) -> Self {
        self / (1.0 - self)
    }

    fn larger(self, other: Self) -> Self {
        self.max(other)
    }

    fn magnitude(self) -> Self {
        self.abs()
    }

    fn above(self, least: Self) -> Self {
        DVec3::select(self.cmpgt(least), self, DVec3::ZERO)
    }

    fn sum_of_channels(self) -> f64 {
        self.element_sum()
    }

    fn largest_channel(self) -> f64 {
        self.max_element()
    }
}

impl Light for f64 {
    const CHANNELS: usize = 1;

    fn from_rgb(rgb: DVec3, colour: DVec3) -> Self {
        rgb.element_sum() / colour.element_sum()
    }

    fn to_rgb(self, colour: DVec3) -> DVec3 {
        colour * self
    }

    fn reflectance(rgb: DVec3) -> Self {
        rgb.x
    }

    fn ratio(part: Self, whole: Self) -> Self {
        if whole > 0.0 { part / whole } else { 0.0 }
    }

    fn interreflected(self) -> Self {
        self / (1.0 - self)
    }

    fn larger(self, other: Self) -> Self {
        self.max(other)
    }

    fn magnitude(self) -> Self {
        self.abs()
    }

    fn above(self, least: Self) -> Self {
        if self > least { self } else { 0.0 }
    }

    fn sum_of_channels(self) -> f64 {
        self
    }

    fn largest_channel(self) -> f64 {
        self
    }
}
