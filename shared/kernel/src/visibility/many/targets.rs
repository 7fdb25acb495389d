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
    /// Its weight in the sum over the place times the form factors of that: not positive where the receiver does not see it.
    pub(super) seen: f64,
}

/// The targets of a receiver.
pub(super) struct Targets<'a> {
    receiver: &'a Receiver,
    /// Polygons that are near, by the number of their place; none of those that are seen edge-on.
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
                return Target { at: position + way, seen: cosine * seen.solid_angle() * weight };
            }
        }
        let at = uniform_point(polygon.corners(), x, y);
        Target { at, seen: kernel(normal, polygon.normal(), at - position) * place.shining }
    }
}
