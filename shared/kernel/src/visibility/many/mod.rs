//! Shooters of very many polygons: a lamp's fine mesh, a sky that differs by direction.
//!
//! The unoccluded form factors are summed, each times the weight of its polygon, for groups of receivers at once; polygons that lie
//! and face together count as one from afar. Visibility is sampled for the shooter as a whole: rays choose among its polygons in
//! proportion to their part of that sum, and among the points of a polygon that is near by solid angle. Where polygons lie apart, as
//! those of many lamps do, most may be hidden from a receiver: what arrives is then told for each of these bodies.

mod bodies;
mod targets;
mod tree;

use sobol_burley::sample_4d;

use super::{ReceiverGroups, Stop, TransparentOccluders, faces_away};
use crate::form_factor::{Lanes, ViewLanes};
use crate::geometry::lanes::LANES;
use crate::messages::RowStatistics;
use crate::occluder::Occluder;
use crate::replica::Receiver;
use crate::row::{Precision, Shape};
use crate::simd::widest;
use bodies::{Body, visible_of};
use targets::{Target, Targets};
use tree::{Place, PolygonTree, Sight};

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

/// A single body that covers so little that no more rays than this would be its part gets no more if all of these arrive. A lamp a
/// seventeenth of which is hidden may then seem 2 % too bright: less than noise where few rays are asked for. Where none arrives they
/// go on: the little light that comes through a grille may be all that there is.
const PROBE: u32 = 16;

/// Rays of a hemisphere from which on none end early. With fewer, their part of [`LEAST_RAYS`] must arrive.
const NO_PROBE: u32 = 1024;

/// Relative error that the form factor of one polygon may have: less than what rays leave of the sum.
const TOLERANCE: f64 = 1e-3;

/// The same of polygons that count as one. The bound is for the worst of directions: some times what is found in the mean.
const TOLERANCE_AS_ONE: f64 = 3e-3;

/// The polygons of one shooter.
pub struct ManyPolygons<'a> {
    tree: PolygonTree,
    occluder: &'a Occluder,
    transparent: Option<&'a TransparentOccluders>,
    precision: &'a Precision,
    least_rays: u32,
    /// Rays that are enough where all of them arrive; `None` where all are sent.
    probe: Option<u32>,
    faced: Faced,
    bodies: Vec<Body>,
}

/// The view of some receivers before occlusion.
#[derive(Default)]
struct Faced {
    /// The places that any of them sees.
    places: Vec<Place>,
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
        let tree = PolygonTree::new(shape.weighted_polygons().filter(|(_, weight)| *weight > 0.0));
        let bodies = vec![Body::default(); tree.bodies()];
        let probe = PROBE.max(precision.rays_per_hemisphere / (NO_PROBE / LEAST_RAYS));
        Self {
            tree,
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
        statistics.pairs += (self.tree.len() * factors.len()) as u64;
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
        let Self { tree, precision, faced, .. } = self;
        let lanes = groups.lanes(group);
        let around = groups.node(0, group);
        let receivers = LANES.min(groups.receivers().len() - group * LANES);
        faced.places.clear();
        faced.ends.clear();
        (faced.covered, faced.counts) = ([0.0; LANES], [0; LANES]);
        let tolerance = precision.form_factor_error.max(TOLERANCE);
        let mut all = [0.0; LANES];
        let mut add = |place: Place, factors: &Lanes, weighted: &Lanes, errors: &Lanes| {
            for (lane, all) in all.iter_mut().enumerate() {
                *all += weighted[lane];
                faced.covered[lane] += factors[lane];
                faced.counts[lane] += u32::from(factors[lane] > 0.0) * place.range.len() as u32;
                statistics.factor_sum += factors[lane];
                statistics.factor_error_sum += errors[lane];
            }
            faced.places.push(place);
            faced.ends.push(all);
        };
        widest(
            #[inline(always)]
            || {
                tree.look(
                    (&lanes.seeing, receivers),
                    precision.form_factor_error.max(TOLERANCE_AS_ONE),
                    #[inline(always)]
                    |place, sight| match sight {
                        Sight::AsOne(view) => add(place, &view.factors, &view.weighted, &view.errors),
                        Sight::Alone(polygon, weight, looking) => {
                            if around.is_some_and(|around| faces_away(around, polygon)) {
                                return;
                            }
                            let ViewLanes { mut factors, mut errors, .. } = lanes.view(polygon, tolerance);
                            for lane in (0..LANES).filter(|lane| looking >> lane & 1 == 0) {
                                (factors[lane], errors[lane]) = (0.0, 0.0);
                            }
                            if factors != [0.0; LANES] {
                                add(place, &factors, &factors.map(|factor| factor * weight), &errors);
                            }
                        }
                    },
                );
            },
        );
        statistics.factors += faced.counts.iter().map(|count| u64::from(*count)).sum::<u64>();
    }

    /// The visible form factor of a receiver of the group looked at.
    fn visible(
        &mut self,
        receiver: &Receiver,
        lane: usize,
        seed: u32,
        statistics: &mut RowStatistics,
    ) -> f64 {
        let Self { tree, occluder, transparent, precision, least_rays, probe, faced, bodies } = self;
        let ends = &faced.ends;
        let all = ends.last().map_or(0.0, |ends| ends[lane]);
        if all == 0.0 || (occluder.is_empty() && transparent.is_none()) {
            return all;
        }
        let before = |index: usize| if index == 0 { 0.0 } else { ends[index - 1][lane] };
        let mut targets = Targets::new(receiver);
        bodies.fill(Body::default());
        for (index, place) in faced.places.iter().enumerate() {
            bodies[place.body].all += ends[index][lane] - before(index);
        }
        let wanted = PART * faced.covered[lane] * f64::from(precision.rays_per_hemisphere);
        let rays = (wanted as u32).next_power_of_two().clamp(*least_rays, MOST_RAYS);
        let probe = probe.filter(|_| wanted <= f64::from(PROBE));
        let mut cast = 0;
        for ray in 0..rays {
            let [choice, x, y, _] = sample_4d(ray, 0, seed).map(f64::from);
            let index = ends.partition_point(|ends| ends[lane] <= choice * all).min(ends.len() - 1);
            let own = ends[index][lane] - before(index);
            let place = &faced.places[index];
            let polygon = tree.choose(&place.range, ((choice * all - before(index)) / own).clamp(0.0, 1.0));
            let Target { at, weight } = targets.draw((index, place), polygon, [x, y]);
            let weight = weight / own;
            cast += 1;
            if weight > 0.0 && own > 0.0 {
                let planes = [receiver.plane, polygon.plane()];
                let part = if occluder.blocks(receiver.position, at, planes) {
                    0.0
                } else {
                    transparent.map_or(1.0, |some| some.between(receiver.position, at, planes))
                };
                bodies[place.body].ratio.add(ray >= rays / 2, weight, part);
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
