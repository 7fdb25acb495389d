//! Shooters of very many polygons: a lamp's fine mesh, a sky that differs by direction.
//!
//! The unoccluded form factors are summed, each times the weight of its polygon, for groups of receivers at once. Visibility is
//! sampled for the shooter as a whole: rays choose among its polygons in proportion to their part of that sum. Where polygons lie
//! apart, as those of many lamps do, most may be hidden from a receiver: what arrives is then told for each of these bodies.

use foldhash::{HashMap, HashMapExt};
use sobol_burley::sample_4d;

use super::ratio::RayRatio;
use super::{ReceiverGroups, Stop, TransparentOccluders, faces_away};
use crate::disjoint_sets::DisjointSets;
use crate::form_factor::{PreparedPolygon, kernel};
use crate::geometry::lanes::LANES;
use crate::geometry::{ConvexPolygon, position_bits, uniform_point};
use crate::messages::RowStatistics;
use crate::occluder::Occluder;
use crate::replica::Receiver;
use crate::row::{Precision, Shape};
use crate::simd::widest;

/// A shooter of this many polygons or more is treated as a whole.
pub const MANY_POLYGONS: usize = 32;

/// Part of the rays per hemisphere that goes to a shooter that covers all of it. With half as many, the noise of a
/// sky is more than a small error allows.
const PART: f64 = 0.5;

/// Rays of a receiver to such a shooter, at least and at most; powers of two.
const LEAST_RAYS: u32 = 64;
const MOST_RAYS: u32 = 4096;

/// Most rays that a receiver sends for the number of bodies: one to each, else.
const MOST_FOR_BODIES: u32 = 256;

/// Rays that are enough to tell of a body by itself, in the mean.
const ENOUGH_RAYS: f64 = 2.0;

/// A single body that covers so little that no more rays than this would be its part gets no more if all of these arrive. A lamp a
/// seventeenth of which is hidden may then seem 2 % too bright: less than noise where few rays are asked for. Where none arrives they
/// go on: the little light that comes through a grille may be all that there is.
const PROBE: u32 = 16;

/// Rays of a hemisphere from which on none end early. With fewer, their part of [`LEAST_RAYS`] must arrive.
const NO_PROBE: u32 = 1024;

/// Relative error that the form factor of one polygon may have: less than what rays leave of the sum.
const TOLERANCE: f64 = 1e-3;

/// A polygon of a shooter.
struct Part {
    polygon: PreparedPolygon,
    area: f64,
    weight: f64,
    body: usize,
}

/// The polygons of one shooter.
pub struct ManyPolygons<'a> {
    polygons: Vec<Part>,
    occluder: &'a Occluder,
    transparent: Option<&'a TransparentOccluders>,
    precision: &'a Precision,
    least_rays: u32,
    /// Rays that are enough where all of them arrive; `None` where all are sent.
    probe: Option<u32>,
    faced: Faced,
    bodies: Vec<Body>,
}

/// Polygons that share corners, as the receiver at hand sees them.
#[derive(Clone, Default)]
struct Body {
    /// Sum of weighted form factors.
    all: f64,
    /// What its rays told.
    ratio: RayRatio,
}

/// The view of some receivers before occlusion.
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
    /// Prepares a shooter, a shape of polygons, among these occluders.
    #[must_use]
    pub fn new(
        shape: &Shape,
        occluder: &'a Occluder,
        transparent: Option<&'a TransparentOccluders>,
        precision: &'a Precision,
    ) -> Self {
        let part = |(polygon, weight): (&ConvexPolygon, f64)| Part {
            polygon: PreparedPolygon::new(polygon),
            area: polygon.area(),
            weight,
            body: 0,
        };
        let seen = shape.weighted_polygons().filter(|(_, weight)| *weight > 0.0);
        let mut polygons: Vec<Part> = seen.map(part).collect();
        let bodies = vec![Body::default(); find_bodies(&mut polygons)];
        let probe = PROBE.max(precision.rays_per_hemisphere / (NO_PROBE / LEAST_RAYS));
        Self {
            polygons,
            occluder,
            transparent,
            precision,
            least_rays: least_rays(bodies.len()),
            probe: (bodies.len() == 1 && probe < LEAST_RAYS).then_some(probe),
            faced: Faced::default(),
            bodies,
        }
    }

    /// The visible form factors from receivers to all of them, by weight. `seed` gives the seed of each receiver's rays; `stop` is
    /// asked before each of them. The result for a receiver does not depend on the others.
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
            self.look(groups, group, statistics);
            for (lane, (factor, receiver)) in factors.iter_mut().zip(receivers).enumerate() {
                if stop() {
                    return vec![];
                }
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
                    let view = lanes.view(&part.polygon, tolerance);
                    if view.factors == [0.0; LANES] {
                        continue;
                    }
                    for (lane, all) in all.iter_mut().enumerate() {
                        *all += view.factors[lane] * part.weight;
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
        &mut self,
        Receiver { position, normal, plane }: &Receiver,
        lane: usize,
        seed: u32,
        statistics: &mut RowStatistics,
    ) -> f64 {
        let Self { polygons, occluder, transparent, precision, least_rays, probe, faced, bodies } = self;
        let ends = &faced.ends;
        let all = ends.last().map_or(0.0, |ends| ends[lane]);
        if all == 0.0 || (occluder.is_empty() && transparent.is_none()) {
            return all;
        }
        let before = |place: usize| if place == 0 { 0.0 } else { ends[place - 1][lane] };
        bodies.fill(Body::default());
        for (place, polygon) in faced.polygons.iter().enumerate() {
            bodies[polygons[*polygon].body].all += ends[place][lane] - before(place);
        }
        let wanted = PART * faced.covered[lane] * f64::from(precision.rays_per_hemisphere);
        let rays = (wanted as u32).next_power_of_two().clamp(*least_rays, MOST_RAYS);
        let probe = probe.filter(|_| wanted <= f64::from(PROBE));
        let mut cast = 0;
        for ray in 0..rays {
            let [choice, x, y, _] = sample_4d(ray, 0, seed).map(f64::from);
            let place = ends.partition_point(|ends| ends[lane] <= choice * all).min(ends.len() - 1);
            let own = ends[place][lane] - before(place);
            let Part { polygon, area, weight, body } = &polygons[faced.polygons[place]];
            let target = uniform_point(polygon.corners(), x, y);
            // Polygons are chosen by their form factors and weights, points on them by area.
            let weight = kernel(*normal, polygon.normal(), target - *position) * area * weight / own;
            cast += 1;
            if weight > 0.0 && own > 0.0 {
                let planes = [*plane, polygon.plane()];
                let part = if occluder.blocks(*position, target, planes) {
                    0.0
                } else {
                    transparent.map_or(1.0, |some| some.between(*position, target, planes))
                };
                bodies[*body].ratio.add(ray >= rays / 2, weight, part);
            }
            if Some(cast) == probe {
                let (arrived, sent) = bodies[0].ratio.sums();
                if arrived == sent && sent > 0.0 {
                    break;
                }
            }
        }
        statistics.rays += u64::from(cast);
        statistics.sampled_pairs += u64::from(faced.counts[lane]);
        statistics.occluded_pairs += u64::from(faced.counts[lane]);
        let (visible, difference) = visible_of(bodies, rays);
        statistics.sampling_variance += difference * difference / 4.0;
        visible
    }
}

/// Rays that a receiver sends to a shooter of this many bodies, at least.
#[must_use]
pub fn least_rays(bodies: usize) -> u32 {
    (bodies.min(MOST_FOR_BODIES as usize) as u32).next_power_of_two().max(LEAST_RAYS)
}

/// The part of all bodies that arrives: rays tell of those that get enough of them one by one, and of all others together. And the difference
/// of what the one half of the rays tells and the other.
fn visible_of(bodies: &[Body], rays: u32) -> (f64, f64) {
    let all: f64 = bodies.iter().map(|body| body.all).sum();
    let enough = all * ENOUGH_RAYS / f64::from(rays);
    let (mut others, mut halved) = (Body::default(), Body::default());
    let (mut visible, mut told, mut difference) = (0.0, 0.0, 0.0);
    let mut tell = |Body { all, ratio }: &Body| {
        let (arrived, cast) = ratio.sums();
        // Rays to bodies that are barely over the horizon may all end under it.
        if cast > 0.0 {
            visible += all * (arrived / cast);
            told += all;
        }
        match ratio.estimate() {
            Some((_, own)) => difference += all * own,
            // With rays in one half only: their difference is that of all such.
            None => halved.add(*all, *ratio),
        }
    };
    for body in bodies {
        if body.all >= enough {
            tell(body);
        } else {
            others.add(body.all, body.ratio);
        }
    }
    tell(&others);
    difference += halved.ratio.estimate().map_or(0.0, |(_, own)| halved.all * own);
    (if told > 0.0 { visible * (all / told) } else { all }, difference)
}

impl Body {
    fn add(&mut self, all: f64, ratio: RayRatio) {
        self.all += all;
        self.ratio += ratio;
    }
}

/// Numbers the bodies of polygons, which share corners, and counts them.
fn find_bodies(polygons: &mut [Part]) -> usize {
    let mut sets = DisjointSets::new(polygons.len());
    let mut owners: HashMap<[u64; 3], usize> = HashMap::new();
    for (index, part) in polygons.iter().enumerate() {
        for corner in part.polygon.corners() {
            let owner = *owners.entry(position_bits(*corner)).or_insert(index);
            sets.join(owner, index);
        }
    }
    let mut numbers: HashMap<usize, usize> = HashMap::new();
    for (index, part) in polygons.iter_mut().enumerate() {
        let next = numbers.len();
        part.body = *numbers.entry(sets.representative(index)).or_insert(next);
    }
    numbers.len()
}
