//! Shooters of very many polygons: a lamp's fine mesh, a sky that differs by direction.
//!
//! The unoccluded form factors are summed, each times the weight of its polygon, for groups of receivers at once. Visibility is
//! sampled for the shooter as a whole: rays choose among its polygons in proportion to their part of that sum.

use std::slice;

use sobol_burley::sample_4d;

use super::ratio::RayRatio;
use super::{ReceiverGroups, ReceiverLanes, Stop, TransparentOccluders, faces_away};
use crate::form_factor::{PreparedPolygon, ViewLanes, kernel};
use crate::geometry::lanes::LANES;
use crate::geometry::{area_vector, uniform_point};
use crate::messages::RowStatistics;
use crate::occluder::Occluder;
use crate::replica::Receiver;
use crate::row::Precision;
use crate::simd::widest;

/// A shooter of this many polygons or more is treated as a whole.
pub const MANY_POLYGONS: usize = 32;

/// Part of the rays per hemisphere that goes to a shooter that covers all of it. With half as many, the noise of a
/// sky is more than a small error allows.
const PART: f64 = 0.5;

/// Rays of a receiver to such a shooter, at least and at most; powers of two.
const LEAST_RAYS: u32 = 64;
const MOST_RAYS: u32 = 4096;

/// Where no more than the least number of rays goes to a shooter, they end after this part of those of a hemisphere, and no fewer
/// than the other number, if all arrived or none did. Of a lamp a seventeenth of which is hidden 16 rays then tell up to 2 % too much:
/// less than noise where few rays are asked for; where many are, none ends.
const PROBE_PART: u32 = 16;
const LEAST_PROBE: u32 = 16;

/// Relative error that the form factor of one polygon may have: less than what rays leave of the sum.
const TOLERANCE: f64 = 1e-3;

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
    faced: Faced,
}

/// What some receivers see of the polygons before occlusion.
#[derive(Default)]
struct Faced {
    /// The polygons that any of them sees.
    polygons: Vec<usize>,
    /// Sum of weighted form factors up to each, for each receiver.
    ends: Vec<[f64; LANES]>,
    /// Sum of form factors of each receiver.
    covered: [f64; LANES],
    /// Number of polygons that each receiver sees.
    counts: [u32; LANES],
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
        let seen = |part: &Part| part.weight > 0.0;
        let polygons = polygons.into_iter().map(part).filter(seen).collect();
        Self { polygons, occluder, transparent, precision, faced: Faced::default() }
    }

    /// The visible form factors from receivers to all of them, by weight. `seed` gives the seed of each receiver's rays; `stop` is
    /// asked before each few receivers. The result for a receiver does not depend on the others.
    pub fn factors(
        &mut self,
        groups: &ReceiverGroups,
        seed: impl Fn(usize) -> u32,
        stop: Stop,
        statistics: &mut RowStatistics,
    ) -> Vec<f64> {
        let mut factors = vec![0.0; groups.receivers().len()];
        statistics.pairs += (self.polygons.len() * factors.len()) as u64;
        for (group, (factors, receivers)) in
            factors.chunks_mut(LANES).zip(groups.receivers().chunks(LANES)).enumerate()
        {
            if stop() {
                break;
            }
            self.look(groups, group, statistics);
            for (lane, (factor, receiver)) in factors.iter_mut().zip(receivers).enumerate() {
                *factor = self.visible(receiver, lane, seed(group * LANES + lane), statistics);
            }
        }
        factors
    }

    /// Finds what the receivers of a group see of the polygons before occlusion.
    fn look(&mut self, groups: &ReceiverGroups, group: usize, statistics: &mut RowStatistics) {
        let Self { polygons, precision, faced, .. } = self;
        let lanes = groups.lanes(group);
        faced.polygons.clear();
        faced.ends.clear();
        (faced.covered, faced.counts) = ([0.0; LANES], [0; LANES]);
        let tolerance = precision.form_factor_error.max(TOLERANCE);
        let mut all = [0.0; LANES];
        widest(
            #[inline(always)]
            || {
                for (index, part) in polygons.iter().enumerate() {
                    if groups.node(0, group).is_some_and(|node| faces_away(node, &part.polygon)) {
                        continue;
                    }
                    let view = view(&part.polygon, lanes, tolerance);
                    if view.factors == [0.0; LANES] {
                        continue;
                    }
                    for lane in 0..LANES {
                        all[lane] += view.factors[lane] * part.weight;
                        faced.covered[lane] += view.factors[lane];
                        faced.counts[lane] += u32::from(view.factors[lane] > 0.0);
                        statistics.factor_sum += view.factors[lane];
                        statistics.factor_error_sum += view.errors[lane];
                    }
                    faced.polygons.push(index);
                    faced.ends.push(all);
                }
            },
        );
        statistics.factors += faced.counts.iter().map(|count| u64::from(*count)).sum::<u64>();
    }

    /// The visible form factor of a receiver of the group looked at.
    fn visible(
        &self,
        Receiver { position, normal, plane }: &Receiver,
        lane: usize,
        seed: u32,
        statistics: &mut RowStatistics,
    ) -> f64 {
        let Faced { polygons, ends, covered, counts } = &self.faced;
        let all = ends.last().map_or(0.0, |ends| ends[lane]);
        if all == 0.0 || (self.occluder.is_empty() && self.transparent.is_none()) {
            return all;
        }
        let wanted = PART * covered[lane] * f64::from(self.precision.rays_per_hemisphere);
        let rays = (wanted as u32).next_power_of_two().clamp(LEAST_RAYS, MOST_RAYS);
        let probe = self.precision.rays_per_hemisphere / PROBE_PART;
        let probe = probe.clamp(LEAST_PROBE, LEAST_RAYS).next_power_of_two();
        let mut ratio = RayRatio::default();
        let mut cast = 0;
        for ray in 0..rays {
            let [choice, x, y, _] = sample_4d(ray, 0, seed).map(f64::from);
            let place = ends.partition_point(|ends| ends[lane] <= choice * all).min(ends.len() - 1);
            let before = if place == 0 { 0.0 } else { ends[place - 1][lane] };
            let own = ends[place][lane] - before;
            let Part { polygon, area, weight } = &self.polygons[polygons[place]];
            let target = uniform_point(polygon.corners(), x, y);
            // Polygons are chosen by their form factors and weights, points on them by area.
            let weight = kernel(*normal, polygon.normal(), target - *position) * area * weight / own;
            cast += 1;
            if weight > 0.0 && own > 0.0 {
                let planes = [*plane, polygon.plane()];
                let part = if self.occluder.blocks(*position, target, planes) {
                    0.0
                } else {
                    self.transparent.map_or(1.0, |some| some.between(*position, target, planes))
                };
                ratio.add(ray >= rays / 2, weight, part);
            }
            if cast == probe && rays == LEAST_RAYS {
                let (arrived, sent) = ratio.sums();
                if arrived == 0.0 || arrived == sent {
                    break;
                }
            }
        }
        statistics.rays += u64::from(cast);
        statistics.sampled_pairs += u64::from(counts[lane]);
        statistics.occluded_pairs += u64::from(counts[lane]);
        let (arrived, sent) = ratio.sums();
        if let Some((_, difference)) = ratio.estimate() {
            let difference = all * difference;
            statistics.sampling_variance += difference * difference / 4.0;
        }
        if sent > 0.0 { all * arrived / sent } else { all }
    }
}

/// What the receivers of a group see of a polygon.
#[inline(always)]
fn view(polygon: &PreparedPolygon, lanes: &ReceiverLanes, tolerance: f64) -> ViewLanes {
    let mut view = ViewLanes::default();
    polygon.view_row(slice::from_ref(&lanes.seeing), tolerance, slice::from_mut(&mut view));
    for lane in 0..LANES {
        if lanes.planes[lane] == polygon.plane() {
            (view.factors[lane], view.errors[lane]) = (0.0, 0.0);
        } else if view.unanswered >> lane & 1 == 1 {
            let alone = polygon.view(lanes.positions.get(lane), lanes.seeing.normal(lane), tolerance);
            (view.factors[lane], view.errors[lane]) =
                alone.map_or((0.0, 0.0), |view| (view.factor, view.error));
        }
    }
    view
}
