//! Shooters as they travel.

use std::sync::Arc;

use glam::DVec3;

use super::error::RequestError;
use super::shooter::{CHANNELS, Hemisphere, Shape, Shooter, Spot};
use crate::geometry::{ConvexPolygon, PlaneId};
use crate::messages::{self, shooter};
use crate::replica::{Receiver, points};

/// What the square of a direction's length may differ from 1 by.
const UNIT: f64 = 1e-6;

impl Shooter {
    /// The shooter as it travels.
    #[must_use]
    pub fn to_message(&self) -> messages::Shooter {
        let point = |p: &DVec3| messages::Point { coordinates: p.to_array().to_vec() };
        let direction = |d: &DVec3| messages::Direction { coordinates: d.to_array().to_vec() };
        let shape = match &self.shape {
            Shape::Polygons(polygons) => shooter::Shape::Polygons(messages::Polygons {
                polygons: polygons.iter().map(polygon_message).collect(),
            }),
            Shape::Weighted(polygons, channel) => shooter::Shape::Weighted(messages::WeightedPolygons {
                polygons: polygons.iter().map(|(polygon, _)| polygon_message(polygon)).collect(),
                weights: polygons.iter().flat_map(|(_, weights)| *weights).collect(),
                channel: *channel as u32,
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

    /// The shooter as it travels after one with the same polygons.
    pub(super) fn to_message_after(&self, before: Option<&Self>) -> messages::Shooter {
        match self.shape {
            Shape::Weighted(_, channel) if before.is_some_and(|before| self.is_next_channel_of(before)) => {
                let shape = messages::WeightedPolygons { channel: channel as u32, ..Default::default() };
                messages::Shooter { key: self.key, shape: Some(shooter::Shape::Weighted(shape)) }
            }
            _ => self.to_message(),
        }
    }

    pub(super) fn from_message(
        message: &messages::Shooter,
        before: Option<&Self>,
    ) -> Result<Self, RequestError> {
        let shape = match message.shape.as_ref().ok_or(RequestError::Invalid("shooter without a shape"))? {
            shooter::Shape::Polygons(set) => {
                Shape::Polygons(set.polygons.iter().map(polygon_of).collect::<Result<_, _>>()?)
            }
            shooter::Shape::Weighted(set) => weighted_of(set, message.key, before)?,
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

/// Weighted polygons, or those of the shooter before where this is its next channel: others would ask for much work with few bytes.
fn weighted_of(
    set: &messages::WeightedPolygons,
    key: u64,
    before: Option<&Shooter>,
) -> Result<Shape, RequestError> {
    let channel = set.channel as usize;
    if channel >= CHANNELS {
        return Err(RequestError::Invalid("channels of weights are 0, 1 and 2"));
    }
    if set.polygons.is_empty() && set.weights.is_empty() {
        if let Some(before) = before
            && let Shape::Weighted(polygons, _) = &before.shape
        {
            let next = Shooter { key, shape: Shape::Weighted(polygons.clone(), channel) };
            if next.is_next_channel_of(before) {
                return Ok(next.shape);
            }
        }
        return Err(RequestError::Invalid("weighted polygons are missing"));
    }
    let (weights, rest) = set.weights.as_chunks::<CHANNELS>();
    let are_weights = weights.as_flattened().iter().all(|weight| (0.0..=1.0).contains(weight));
    if set.polygons.len() != weights.len() || !rest.is_empty() || !are_weights {
        return Err(RequestError::Invalid("each weighted polygon has three weights from 0 to 1"));
    }
    let polygons = set.polygons.iter().zip(weights);
    let weighted = polygons.map(|(polygon, weights)| polygon_of(polygon).map(|polygon| (polygon, *weights)));
    Ok(Shape::Weighted(Arc::new(weighted.collect::<Result<_, _>>()?), channel))
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
    use crate::row::shooter::tests::SPOT;

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
            assert!(Shooter::from_message(&message, None).is_err(), "{message:?}");
        }
        for rays in [0, Hemisphere::MOST_RAYS + 1] {
            let message = Shooter { key: 0, shape: Shape::Sky(rays) }.to_message();
            assert!(Shooter::from_message(&message, None).is_err(), "{message:?}");
        }
    }

    #[test]
    fn every_shape_comes_back_as_it_went() {
        let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let shapes = [
            Shape::Polygons(vec![ConvexPolygon { plane: PlaneId(7), corners: corners.clone() }]),
            Shape::of_one_colour([(ConvexPolygon { plane: PlaneId(7), corners }, 0.5)]),
            Shape::Point(DVec3::ONE),
            Shape::PlanarPoint(DVec3::NEG_ONE),
            Shape::Spot(SPOT),
            Shape::Directional(DVec3::new(0.6, -0.8, 0.0)),
            Shape::Sky(64),
            Shape::Hemisphere(HEMISPHERE),
        ];
        for shape in shapes {
            let shooter = Shooter { key: 3, shape };
            assert_eq!(Shooter::from_message(&shooter.to_message(), None).unwrap(), shooter);
        }
    }

    #[test]
    fn weighted_polygons_that_make_no_sense_are_refused() {
        let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let polygon = ConvexPolygon { plane: PlaneId(7), corners };
        let shapes = Shape::of_colours(vec![(polygon, [0.5, 1.0, 0.0])]);
        let [red, green, _] = [0, 1, 2].map(|at| Shooter { key: 4 + at as u64, shape: shapes[at].clone() });
        let after = green.to_message_after(Some(&red));
        assert_eq!(Shooter::from_message(&after, Some(&red)).unwrap(), green);
        // Its polygons are those of no other.
        let point = Shooter { key: 3, shape: Shape::Point(DVec3::ONE) };
        assert!(Shooter::from_message(&after, None).is_err());
        assert!(Shooter::from_message(&after, Some(&point)).is_err());
        assert!(Shooter::from_message(&after, Some(&green)).is_err());
        assert_eq!(green.to_message_after(Some(&Shooter { key: 9, ..red })), green.to_message());
        let changed = |change: fn(&mut messages::WeightedPolygons)| {
            let mut message = green.to_message();
            let Some(shooter::Shape::Weighted(set)) = &mut message.shape else {
                unreachable!("it is weighted")
            };
            change(set);
            message
        };
        for message in [
            changed(|set| set.channel = 3),
            changed(|set| set.weights[1] = 1.1),
            changed(|set| set.weights[1] = f64::NAN),
            changed(|set| set.weights.truncate(1)),
            changed(|set| set.weights.push(0.0)),
            changed(|set| set.polygons.clear()),
        ] {
            assert!(Shooter::from_message(&message, None).is_err(), "{message:?}");
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
            assert!(Shooter::from_message(&message, None).is_err(), "{message:?}");
        }
        let two = messages::Direction { coordinates: vec![1.0, 0.0, 0.0, 1.0, 0.0, 0.0] };
        let message = messages::Shooter { key: 0, shape: Some(shooter::Shape::Directional(two)) };
        assert!(Shooter::from_message(&message, None).is_err());
    }
}
