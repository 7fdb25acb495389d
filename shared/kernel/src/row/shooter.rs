use glam::DVec3;

use super::error::RequestError;
use crate::geometry::{ConvexPolygon, PlaneId};
use crate::messages::{self, shooter};
use crate::replica::{Receiver, points};

/// What the square of a direction's length may differ from 1 by.
const UNIT: f64 = 1e-6;

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
    /// Convex polygons that do not overlap, each with a weight from 0 to 1; rows hold the sum of visible form factors times weights.
    Weighted(Vec<(ConvexPolygon, f64)>),
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
            Self::Weighted(polygons) => polygons.len(),
            Self::Point(_)
            | Self::PlanarPoint(_)
            | Self::Spot(_)
            | Self::Directional(_)
            | Self::Sky(_)
            | Self::Hemisphere(_) => 1,
        }
    }

    /// Its polygons, each with its weight; none of points, directions and skies.
    pub fn weighted_polygons(&self) -> impl Iterator<Item = (&ConvexPolygon, f64)> {
        let (even, weighted): (&[_], &[_]) = match self {
            Self::Polygons(polygons) => (polygons, &[]),
            Self::Weighted(polygons) => (&[], polygons),
            _ => (&[], &[]),
        };
        let weighted = weighted.iter().map(|(polygon, weight)| (polygon, *weight));
        even.iter().map(|polygon| (polygon, 1.0)).chain(weighted)
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
    pub(super) fn to_message(&self) -> messages::Shooter {
        let point = |p: &DVec3| messages::Point { coordinates: p.to_array().to_vec() };
        let direction = |d: &DVec3| messages::Direction { coordinates: d.to_array().to_vec() };
        let shape = match &self.shape {
            Shape::Polygons(polygons) => shooter::Shape::Polygons(messages::Polygons {
                polygons: polygons.iter().map(polygon_message).collect(),
            }),
            Shape::Weighted(polygons) => shooter::Shape::Weighted(messages::WeightedPolygons {
                polygons: polygons.iter().map(|(polygon, _)| polygon_message(polygon)).collect(),
                weights: polygons.iter().map(|(_, weight)| *weight).collect(),
            }),
            Shape::Point(position) => shooter::Shape::Point(point(position)),
            Shape::PlanarPoint(position) => shooter::Shape::PlanarPoint(point(position)),
            Shape::Spot(spot) => shooter::Shape::Spot(messages::Spot {
                position: Some(point(&spot.position)),
                direction: Some(direction(&spot.direction)),
                inner_cosine: spot.inner_cosine,
                outer_cosine: spot.outer_cosine,
            }),
            Shape::Directional(along) => shooter::Shape::Directional(direction(along)),
            Shape::Sky(rays) => shooter::Shape::Sky(messages::Sky { rays: *rays }),
            Shape::Hemisphere(Hemisphere { receiver, rays }) => {
                shooter::Shape::Hemisphere(messages::Hemisphere {
                    rays: *rays,
                    position: Some(point(&receiver.position)),
                    normal: Some(direction(&receiver.normal)),
                    plane: receiver.plane.0,
                })
            }
        };
        messages::Shooter { key: self.key, shape: Some(shape) }
    }

    pub(super) fn from_message(message: &messages::Shooter) -> Result<Self, RequestError> {
        let shape = match message.shape.as_ref().ok_or(RequestError::Invalid("shooter without a shape"))? {
            shooter::Shape::Polygons(set) => {
                Shape::Polygons(set.polygons.iter().map(polygon_of).collect::<Result<_, _>>()?)
            }
            shooter::Shape::Weighted(set) => {
                let is_weight = |weight: &f64| (0.0..=1.0).contains(weight);
                if set.polygons.len() != set.weights.len() || !set.weights.iter().all(is_weight) {
                    return Err(RequestError::Invalid("each weighted polygon has a weight from 0 to 1"));
                }
                let polygons = set.polygons.iter().zip(&set.weights);
                let weighted =
                    polygons.map(|(polygon, weight)| polygon_of(polygon).map(|polygon| (polygon, *weight)));
                Shape::Weighted(weighted.collect::<Result<_, _>>()?)
            }
            shooter::Shape::Point(position) => Shape::Point(position_of(position)?),
            shooter::Shape::PlanarPoint(position) => Shape::PlanarPoint(position_of(position)?),
            shooter::Shape::Spot(spot) => Shape::Spot(spot_of(spot)?),
            shooter::Shape::Directional(direction) => Shape::Directional(direction_of(direction)?),
            shooter::Shape::Sky(messages::Sky { rays }) => Shape::Sky(rays_of(*rays)?),
            shooter::Shape::Hemisphere(hemisphere) => Shape::Hemisphere(hemisphere_of(hemisphere)?),
        };
        Ok(Self { key: message.key, shape })
    }
}

fn polygon_message(polygon: &ConvexPolygon) -> messages::ConvexPolygon {
    messages::ConvexPolygon {
        plane: polygon.plane.0,
        coordinates: polygon.corners.iter().flat_map(|p| p.to_array()).collect(),
    }
}

fn polygon_of(polygon: &messages::ConvexPolygon) -> Result<ConvexPolygon, RequestError> {
    let corners = points(&polygon.coordinates)?;
    if corners.len() < 3 {
        return Err(RequestError::Invalid("a polygon needs three corners or more"));
    }
    Ok(ConvexPolygon { plane: PlaneId(polygon.plane), corners })
}

fn position_of(point: &messages::Point) -> Result<DVec3, RequestError> {
    match points(&point.coordinates)?.as_slice() {
        [position] => Ok(*position),
        _ => Err(RequestError::Invalid("a point has three coordinates")),
    }
}

fn direction_of(direction: &messages::Direction) -> Result<DVec3, RequestError> {
    match points(&direction.coordinates)?.as_slice() {
        [direction] if (direction.length_squared() - 1.0).abs() <= UNIT => Ok(*direction),
        _ => Err(RequestError::Invalid("a direction is one vector of length 1")),
    }
}

fn spot_of(message: &messages::Spot) -> Result<Spot, RequestError> {
    let (Some(position), Some(direction)) = (&message.position, &message.direction) else {
        return Err(RequestError::Invalid("a spot light has a position and a direction"));
    };
    let messages::Spot { inner_cosine, outer_cosine, .. } = *message;
    // No number is in a range with an end that is none.
    if !(0.0..=inner_cosine).contains(&outer_cosine) || !(outer_cosine..=1.0).contains(&inner_cosine) {
        return Err(RequestError::Invalid(
            "cosines of a spot light lie between 0 and 1, the outer before the inner",
        ));
    }
    let (position, direction) = (position_of(position)?, direction_of(direction)?);
    Ok(Spot { position, direction, inner_cosine, outer_cosine })
}

fn hemisphere_of(message: &messages::Hemisphere) -> Result<Hemisphere, RequestError> {
    let (Some(position), Some(normal)) = (&message.position, &message.normal) else {
        return Err(RequestError::Invalid("a hemisphere has a position and a normal"));
    };
    let (position, normal) = (position_of(position)?, direction_of(normal)?);
    let receiver = Receiver { position, normal, plane: PlaneId(message.plane) };
    Ok(Hemisphere { receiver, rays: rays_of(message.rays)? })
}

fn rays_of(rays: u32) -> Result<u32, RequestError> {
    if !(1..=Hemisphere::MOST_RAYS).contains(&rays) {
        return Err(RequestError::Invalid("a hemisphere or a sky has 1 to 65536 rays"));
    }
    Ok(rays)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPOT: Spot = Spot {
        position: DVec3::new(1.0, 2e9, -3.0),
        direction: DVec3::NEG_Z,
        inner_cosine: 0.9,
        outer_cosine: 0.5,
    };

    const HEMISPHERE: Hemisphere = Hemisphere {
        receiver: Receiver { position: DVec3::ONE, normal: DVec3::Y, plane: PlaneId(9) },
        rays: 1024,
    };

    #[test]
    fn hemispheres_that_make_no_sense_are_refused() {
        let tilted = Receiver { normal: DVec3::Y * 2.0, ..HEMISPHERE.receiver };
        for hemisphere in [
            Hemisphere { rays: 0, ..HEMISPHERE },
            Hemisphere { rays: Hemisphere::MOST_RAYS + 1, ..HEMISPHERE },
            Hemisphere { receiver: tilted, ..HEMISPHERE },
        ] {
            let message = Shooter { key: 0, shape: Shape::Hemisphere(hemisphere) }.to_message();
            assert!(Shooter::from_message(&message).is_err(), "{message:?}");
        }
        for rays in [0, Hemisphere::MOST_RAYS + 1] {
            let message = Shooter { key: 0, shape: Shape::Sky(rays) }.to_message();
            assert!(Shooter::from_message(&message).is_err(), "{message:?}");
        }
    }

    #[test]
    fn every_shape_comes_back_as_it_went() {
        let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let shapes = [
            Shape::Polygons(vec![ConvexPolygon { plane: PlaneId(7), corners: corners.clone() }]),
            Shape::Weighted(vec![(ConvexPolygon { plane: PlaneId(7), corners }, 0.5)]),
            Shape::Point(DVec3::ONE),
            Shape::PlanarPoint(DVec3::NEG_ONE),
            Shape::Spot(SPOT),
            Shape::Directional(DVec3::new(0.6, -0.8, 0.0)),
            Shape::Sky(64),
            Shape::Hemisphere(HEMISPHERE),
        ];
        for shape in shapes {
            let shooter = Shooter { key: 3, shape };
            assert_eq!(Shooter::from_message(&shooter.to_message()).unwrap(), shooter);
        }
    }

    #[test]
    fn lights_that_make_no_sense_are_refused() {
        let spots = [
            Spot { direction: DVec3::Y * 1.01, ..SPOT },
            Spot { direction: DVec3::ZERO, ..SPOT },
            Spot { direction: DVec3::new(f64::NAN, 1.0, 0.0), ..SPOT },
            Spot { position: DVec3::new(f64::INFINITY, 1.0, 0.0), ..SPOT },
            Spot { inner_cosine: 0.4, ..SPOT },
            Spot { inner_cosine: 1.1, ..SPOT },
            Spot { outer_cosine: -0.1, ..SPOT },
            Spot { inner_cosine: f64::NAN, ..SPOT },
            Spot { outer_cosine: f64::NAN, ..SPOT },
        ];
        let directions =
            [DVec3::ZERO, DVec3::ONE, DVec3::new(0.0, f64::INFINITY, 0.0)].map(Shape::Directional);
        for shape in spots.into_iter().map(Shape::Spot).chain(directions) {
            let message = Shooter { key: 0, shape }.to_message();
            assert!(Shooter::from_message(&message).is_err(), "{message:?}");
        }
        let two = messages::Direction { coordinates: vec![1.0, 0.0, 0.0, 1.0, 0.0, 0.0] };
        let message = messages::Shooter { key: 0, shape: Some(shooter::Shape::Directional(two)) };
        assert!(Shooter::from_message(&message).is_err());
    }

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
