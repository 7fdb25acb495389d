//! Where the rays of a receiver go on the polygon that each has chosen.

use foldhash::{HashMap, HashMapExt};
use glam::DVec3;

use super::tree::Place;
use crate::form_factor::{PreparedPolygon, kernel};
use crate::geometry::{SeenPolygon, uniform_point};
use crate::replica::Receiver;

/// A polygon within this many of its radii is near: points that are even over its area would seldom be where most of its light comes from,
/// and weigh much where they are.
const NEAR: f64 = 3.0;

/// Where a ray goes.
pub(super) struct Target {
    pub(super) at: DVec3,
    /// Pi times what it tells of the place's weighted form factor, before occlusion: not positive where the receiver does not see it.
    pub(super) weight: f64,
}

/// The targets of a receiver.
pub(super) struct Targets<'a> {
    receiver: &'a Receiver,
    /// Polygons that are near, by the number of their place; none of those that are seen edge-on. Never iterated: its order is chance.
    near: HashMap<usize, Option<SeenPolygon>>,
}

impl<'a> Targets<'a> {
    pub(super) fn new(receiver: &'a Receiver) -> Self {
        Self { receiver, near: HashMap::new() }
    }

    /// Draws a target on a polygon of the place of this number: by solid angle on one that is near, else by area. Of a place of several,
    /// all of them far, the polygon was chosen by area and weight.
    pub(super) fn draw(
        &mut self,
        (number, place): (usize, &Place),
        polygon: &PreparedPolygon,
        [x, y]: [f64; 2],
    ) -> Target {
        let Receiver { position, normal, .. } = *self.receiver;
        let is_near =
            || position.distance_squared(polygon.centroid()) < NEAR * NEAR * polygon.squared_reach();
        if place.range.len() == 1 && is_near() {
            let look = || SeenPolygon::new(position, polygon.corners(), polygon.normal());
            let seen = self.near.entry(number).or_insert_with(look);
            if let Some((seen, way)) = seen.as_ref().and_then(|seen| Some((seen, seen.way(x, y)?))) {
                let weight = place.shining / polygon.area();
                let cosine = normal.dot(way) / way.length();
                return Target { at: position + way, weight: cosine * seen.solid_angle() * weight };
            }
        }
        let at = uniform_point(polygon.corners(), x, y);
        Target { at, weight: kernel(normal, polygon.normal(), at - position) * place.shining }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use sobol_burley::sample_4d;

    use super::*;
    use crate::form_factor::point_to_polygon;
    use crate::geometry::{ConvexPolygon, PlaneId};

    /// Near and far, in front and across the horizon, the weights of targets sum to the same form factor.
    #[test]
    fn targets_of_near_and_far_polygons_weigh_alike() {
        const WEIGHT: f64 = 0.7;
        const DRAWS: u32 = 1 << 14;
        let corners =
            [[-1.0, -1.0], [1.0, -1.0], [1.2, 1.0], [-1.0, 0.5]].map(|[x, y]| DVec3::new(x, y, 0.0));
        let polygon = PreparedPolygon::new(&ConvexPolygon { plane: PlaneId(0), corners: corners.to_vec() });
        let place = Place { range: 0..1, body: 0, shining: polygon.area() * WEIGHT };
        for height in [0.1, 1.0, 3.9, 4.1, 9.0] {
            for (across, normal) in
                [(0.3, DVec3::NEG_Z), (0.9, DVec3::new(0.8, 0.0, -0.6)), (2.0, DVec3::NEG_X)]
            {
                let position = DVec3::new(across, 0.2, height);
                let receiver = Receiver { position, normal, plane: PlaneId(1) };
                let mut targets = Targets::new(&receiver);
                let weight = |index: u32| {
                    let [x, y, ..] = sample_4d(index, 0, 5).map(f64::from);
                    targets.draw((0, &place), &polygon, [x, y]).weight.max(0.0)
                };
                let found = (0..DRAWS).map(weight).sum::<f64>() / f64::from(DRAWS) / PI;
                let exact = WEIGHT * point_to_polygon(position, normal, &corners);
                assert!(exact > 0.0 && (found / exact - 1.0).abs() < 5e-3, "{position}: {found} for {exact}");
            }
        }
    }
}
