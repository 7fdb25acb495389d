//! Shooters of very many polygons: a lamp's fine mesh, a sky that differs by direction.
//!
//! The unoccluded form factor is summed exactly, each polygon's times its weight. Visibility is sampled for the shooter as a whole: rays
//! choose among its polygons in proportion to their part of that sum.

use sobol_burley::sample_4d;

use super::TransparentOccluders;
use super::ratio::RayRatio;
use crate::form_factor::{PreparedPolygon, kernel};
use crate::geometry::{area_vector, uniform_point};
use crate::messages::RowStatistics;
use crate::occluder::Occluder;
use crate::replica::Receiver;
use crate::row::Precision;

/// A shooter of this many polygons or more is treated as a whole.
pub const MANY_POLYGONS: usize = 32;

/// Part of the rays per hemisphere that goes to a shooter that covers all of it. With half as many, the noise of a
/// sky is more than a small error allows.
const PART: f64 = 0.5;

/// Rays of a receiver to such a shooter, at least and at most; powers of two.
const LEAST_RAYS: u32 = 64;
const MOST_RAYS: u32 = 4096;

/// A polygon of a shooter.
struct Part {
    polygon: PreparedPolygon,
    area: f64,
    weight: f64,
}

/// The polygons of one shooter.
pub struct ManyPolygons<'a> {
    polygons: Vec<Part>,
    occluder: &'a Occluder,
    transparent: Option<&'a TransparentOccluders>,
    precision: &'a Precision,
    /// Of the receiver at hand: polygons that it sees before occlusion, and the sum of weighted form factors up to each.
    faced: Vec<(usize, f64)>,
}

impl<'a> ManyPolygons<'a> {
    /// Prepares a shooter, polygons with weights, among these occluders.
    #[must_use]
    pub fn new(
        polygons: impl IntoIterator<Item = (PreparedPolygon, f64)>,
        occluder: &'a Occluder,
        transparent: Option<&'a TransparentOccluders>,
        precision: &'a Precision,
    ) -> Self {
        let part = |(polygon, weight): (PreparedPolygon, f64)| {
            let area = area_vector(polygon.corners()).length();
            Part { polygon, area, weight }
        };
        let polygons = polygons.into_iter().map(part).collect();
        Self { polygons, occluder, transparent, precision, faced: vec![] }
    }

    /// The visible form factor from a receiver to all of them, by weight.
    pub fn factor(&mut self, receiver: &Receiver, seed: u32, statistics: &mut RowStatistics) -> f64 {
        let Receiver { position, normal, plane } = *receiver;
        statistics.pairs += self.polygons.len() as u64;
        self.faced.clear();
        let (mut all, mut covered) = (0.0, 0.0);
        for (index, part) in
            self.polygons.iter().enumerate().filter(|(_, part)| part.polygon.plane() != plane)
        {
            if let Some(view) = part.polygon.view(position, normal, self.precision.form_factor_error)
                && view.factor > 0.0
                && part.weight > 0.0
            {
                all += view.factor * part.weight;
                covered += view.factor;
                statistics.factors += 1;
                statistics.factor_sum += view.factor;
                statistics.factor_error_sum += view.error;
                self.faced.push((index, all));
            }
        }
        if all == 0.0 || (self.occluder.is_empty() && self.transparent.is_none()) {
            return all;
        }
        let wanted = PART * covered * f64::from(self.precision.rays_per_hemisphere);
        let rays = (wanted as u32).next_power_of_two().clamp(LEAST_RAYS, MOST_RAYS);
        let mut ratio = RayRatio::default();
        for ray in 0..rays {
            let [choice, x, y, _] = sample_4d(ray, 0, seed).map(f64::from);
            let place = self.faced.partition_point(|(_, end)| *end <= choice * all).min(self.faced.len() - 1);
            let before = if place == 0 { 0.0 } else { self.faced[place - 1].1 };
            let (index, end) = self.faced[place];
            let Part { polygon, area, weight } = &self.polygons[index];
            let target = uniform_point(polygon.corners(), x, y);
            // Polygons are chosen by their form factors and weights, points on them by area.
            let weight = kernel(normal, polygon.normal(), target - position) * area * weight / (end - before);
            if weight > 0.0 {
                let planes = [plane, polygon.plane()];
                let part = if self.occluder.blocks(position, target, planes) {
                    0.0
                } else {
                    self.transparent.map_or(1.0, |some| some.between(position, target, planes))
                };
                ratio.add(ray >= rays / 2, weight, part);
            }
        }
        statistics.rays += u64::from(rays);
        statistics.sampled_pairs += self.faced.len() as u64;
        statistics.occluded_pairs += self.faced.len() as u64;
        let Some((_, difference)) = ratio.estimate() else { return all };
        let difference = all * difference;
        statistics.sampling_variance += difference * difference / 4.0;
        let (arrived, cast) = ratio.sums();
        all * arrived / cast
    }
}
