use std::sync::Arc;

use glam::DVec3;

use crate::geometry::ConvexPolygon;
use crate::replica::Receiver;

/// What light leaves from.
#[derive(Debug, Clone, PartialEq)]
pub struct Shooter {
    /// Stable number of the shooter in its scene: part of the seed of its rays.
    pub key: u64,
    /// Where the light leaves.
    pub shape: Shape,
}

/// The shape of a shooter.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// Convex polygons that do not overlap; rows hold visible form factors.
    Polygons(Vec<ConvexPolygon>),
    /// Polygons with weights; rows hold the sum of visible form factors times weights in this channel.
    Weighted(Arc<WeightedPolygons>, Channel),
    /// An isotropic point light; rows hold V cos / r^2.
    Point(DVec3),
    /// A point light weighted by the cosine of a horizontal plane through it; rows hold 2 V |cos(plane)| cos / r^2.
    PlanarPoint(DVec3),
    /// A point light that shines into a cone; rows hold V s cos / r^2, with s of [`Spot::attenuation`].
    Spot(Spot),
    /// Light that travels along this unit vector everywhere, from infinitely far; rows hold V cos.
    Directional(DVec3),
    /// A sky of one radiance all around; rows hold its visible form factor, the part of its light that nothing stops, by this number
    /// of rays, from 1 to [`Hemisphere::MOST_RAYS`].
    Sky(u32),
    /// A receiver that sends rays all over its hemisphere; rows hold its visible form factors to the polygons of the scene, which take
    /// the receivers' place: the request names the scene for both, and asks for all of them.
    Hemisphere(Hemisphere),
}

/// Convex polygons that do not overlap, each with a weight from 0 to 1 in each channel.
pub type WeightedPolygons = Vec<(ConvexPolygon, [f64; CHANNELS])>;

/// Number of channels that a polygon has weights in.
pub const CHANNELS: usize = 3;

/// A channel of weights, below [`CHANNELS`].
pub type Channel = usize;

/// A receiver, and what it looks around with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hemisphere {
    /// The receiver.
    pub receiver: Receiver,
    /// Number of rays, from 1 to [`Self::MOST_RAYS`].
    pub rays: u32,
}

impl Hemisphere {
    /// The sequence of directions ends here.
    pub const MOST_RAYS: u32 = 1 << 16;
}

impl Shape {
    /// How many parts it has, each of which makes a pair with each receiver.
    #[must_use]
    pub fn polygons(&self) -> usize {
        match self {
            Self::Polygons(polygons) => polygons.len(),
            Self::Weighted(polygons, _) => polygons.len(),
            Self::Point(_)
            | Self::PlanarPoint(_)
            | Self::Spot(_)
            | Self::Directional(_)
            | Self::Sky(_)
            | Self::Hemisphere(_) => 1,
        }
    }

    /// The channel of its weights; the first where it has none.
    #[must_use]
    pub fn channel(&self) -> Channel {
        if let Self::Weighted(_, channel) = self { *channel } else { 0 }
    }

    /// Its polygons, each with its weight; none of points, directions and skies.
    pub fn weighted_polygons(&self) -> impl Iterator<Item = (&ConvexPolygon, f64)> {
        let channel = self.channel();
        self.polygons_of_channels().map(move |(polygon, weights)| (polygon, weights[channel]))
    }

    /// Its polygons with their weights in all channels: those that have one weight have it in the first.
    pub fn polygons_of_channels(&self) -> impl Iterator<Item = (&ConvexPolygon, [f64; CHANNELS])> + Clone {
        let (even, weighted): (&[_], &[_]) = match self {
            Self::Polygons(polygons) => (polygons, &[]),
            Self::Weighted(polygons, _) => (&[], polygons),
            _ => (&[], &[]),
        };
        let weighted = weighted.iter().map(|(polygon, weights)| (polygon, *weights));
        even.iter().map(|polygon| (polygon, [1.0, 0.0, 0.0])).chain(weighted)
    }

    /// Polygons of one colour, at least one, each with its weight from 0 to 1.
    #[must_use]
    pub fn of_one_colour(polygons: impl IntoIterator<Item = (ConvexPolygon, f64)>) -> Self {
        let in_one = |(polygon, weight)| (polygon, [weight, 0.0, 0.0]);
        Self::Weighted(Arc::new(polygons.into_iter().map(in_one).collect()), 0)
    }

    /// Polygons of many colours, at least one, in each channel.
    #[must_use]
    pub fn of_colours(polygons: WeightedPolygons) -> [Self; CHANNELS] {
        let polygons = Arc::new(polygons);
        std::array::from_fn(|channel| Self::Weighted(polygons.clone(), channel))
    }
}

/// A point light that shines into a cone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// Where it stands.
    pub position: DVec3,
    /// Unit vector along the axis of the cone, the way that light goes.
    pub direction: DVec3,
    /// Cosine of the angle to the axis up to which intensity is full; no less than the other.
    pub inner_cosine: f64,
    /// Cosine of the angle to the axis from which it is 0, in [0, 1].
    pub outer_cosine: f64,
}

impl Spot {
    /// Part of the full intensity that leaves in a direction at this cosine to the axis: the square of a ramp over the cosines
    /// between both cones, as KHR_lights_punctual has it. Where the cones are one, it ends in a step.
    #[must_use]
    pub fn attenuation(&self, cosine: f64) -> f64 {
        if cosine >= self.inner_cosine {
            1.0
        } else if cosine <= self.outer_cosine {
            0.0
        } else {
            let ramp = (cosine - self.outer_cosine) / (self.inner_cosine - self.outer_cosine);
            ramp * ramp
        }
    }

    /// Solid angle that would hold all of its light at full intensity, in steradians: the integral of the attenuation.
    #[must_use]
    pub fn solid_angle(&self) -> f64 {
        std::f64::consts::TAU * ((1.0 - self.inner_cosine) + (self.inner_cosine - self.outer_cosine) / 3.0)
    }
}

impl Shooter {
    /// Key of the rays: those of the channels of one shape are the same.
    #[must_use]
    pub fn key_of_rays(&self) -> u64 {
        self.key.wrapping_sub(self.shape.channel() as u64)
    }

    /// Whether this is the next channel of the shape of the shooter before it: rows of both take no longer than one of them.
    #[must_use]
    pub fn is_next_channel_of(&self, before: &Self) -> bool {
        match (&before.shape, &self.shape) {
            (Shape::Weighted(a, before_channel), Shape::Weighted(b, channel)) => {
                Arc::ptr_eq(a, b)
                    && before_channel + 1 == *channel
                    && before.key.checked_add(1) == Some(self.key)
            }
            _ => false,
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A spot light with a ramp between its cones.
    pub const SPOT: Spot = Spot {
        position: DVec3::new(1.0, 2e9, -3.0),
        direction: DVec3::NEG_Z,
        inner_cosine: 0.9,
        outer_cosine: 0.5,
    };

    /// Full inside, none outside, a quarter where the ramp over the cosines is half way.
    #[test]
    fn attenuation_is_the_square_of_a_ramp_over_the_cosines() {
        for (cosine, expected) in
            [(1.0, 1.0), (0.9, 1.0), (0.7, 0.25), (0.6, 0.0625), (0.5, 0.0), (-1.0, 0.0)]
        {
            assert!((SPOT.attenuation(cosine) - expected).abs() <= 1e-15, "{cosine}");
        }
        let step = Spot { inner_cosine: 0.5, ..SPOT };
        assert_eq!((step.attenuation(0.5), step.attenuation(0.499)), (1.0, 0.0));
        let steps = 100_000;
        let cosine = |step: u32| -1.0 + 2.0 * (f64::from(step) + 0.5) / f64::from(steps);
        let sum: f64 = (0..steps).map(|step| SPOT.attenuation(cosine(step))).sum();
        let integral = sum * 2.0 / f64::from(steps) * std::f64::consts::TAU;
        assert!((SPOT.solid_angle() / integral - 1.0).abs() <= 1e-8, "{integral}");
    }
}
