//! Shooters of very many polygons: a lamp's fine mesh, a sky that differs by direction.
//!
//! The unoccluded form factors are summed, each times the weight of its polygon, for groups of receivers at once; polygons that lie
//! and face together count as one from afar. Visibility is sampled for the shooter as a whole: rays choose among its polygons in
//! proportion to their part of that sum, and among the points of a polygon that is near by solid angle. Where polygons lie apart, as
//! those of many lamps do, most may be hidden from a receiver: what arrives is then told for each of these bodies. Polygons of many colours
//! have a weight in each channel: rays choose by the sum of these, and tell of all channels.

mod bodies;
mod numbers;
mod sums;
mod targets;
mod tree;

use super::{ReceiverGroups, Seeds, Stop, TransparentOccluders, faces_away};
use crate::form_factor::{Lanes, ViewLanes};
use crate::geometry::ConvexPolygon;
use crate::geometry::lanes::LANES;
use crate::messages::RowStatistics;
use crate::occluder::{Blocking, Occluder};
use crate::replica::Receiver;
use crate::row::{CHANNELS, Precision, Shape};
use crate::simd::widest;
use bodies::{Body, visible_of};
use numbers::Numbers;
use sums::RunningSums;
use targets::{Target, Targets};
use tree::{Part, Place, PolygonTree, Sight};

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

/// The polygons of one shooter, with weights in `N` channels.
struct ManyPolygons<'a, const N: usize> {
    tree: PolygonTree<N>,
    occluder: &'a Occluder,
    transparent: Option<&'a TransparentOccluders>,
    precision: &'a Precision,
    least_rays: u32,
    /// Rays that are enough where all of them arrive; `None` where all are sent.
    probe: Option<u32>,
    faced: Faced<N>,
    bodies: Vec<Body<N>>,
    /// Sum of weighted form factors up to each place, of all channels, for the receiver at hand.
    sums: RunningSums,
}

/// The view of some receivers before occlusion.
struct Faced<const N: usize> {
    /// The places that any of them sees.
    places: Vec<Place>,
    /// Sum of weighted form factors up to each, by channel and receiver.
    ends: Vec<[[f64; LANES]; N]>,
    /// Sum of form factors of each receiver.
    covered: [f64; LANES],
    /// Number of polygons that each receiver sees.
    counts: [u32; LANES],
}

/// Visible form factors to many polygons, by weight.
pub struct FactorsOfMany {
    /// For each receiver, in each channel; 0 in those that all weights are 0 in.
    pub factors: Vec<[f64; CHANNELS]>,
    /// The variance of each channel, summed over the receivers.
    pub variances: [f64; CHANNELS],
}

/// The visible form factors from receivers to all polygons of a shape among these occluders, in all of its channels at once. `stop` is
/// asked before each receiver, and ends it with less. The result for a receiver does not depend on the others.
pub fn factors_of_many(
    (shape, groups): (&Shape, &ReceiverGroups),
    (occluder, transparent): (&Occluder, Option<&TransparentOccluders>),
    precision: &Precision,
    seeds: Seeds,
    stop: Stop,
    statistics: &mut RowStatistics,
) -> FactorsOfMany {
    let of_channels = shape.polygons_of_channels();
    let is_one = of_channels.clone().all(|(_, [_, others @ ..])| others == [0.0; CHANNELS - 1]);
    let among = (occluder, transparent, precision);
    if is_one {
        let polygons = of_channels.map(|(polygon, [weight, ..])| (polygon, [weight]));
        let (factors, [variance]) =
            ManyPolygons::new(polygons, among).factors(groups, seeds, stop, statistics);
        let factors = factors.into_iter().map(|[factor]| [factor, 0.0, 0.0]).collect();
        return FactorsOfMany { factors, variances: [variance, 0.0, 0.0] };
    }
    let (factors, variances) = ManyPolygons::new(of_channels, among).factors(groups, seeds, stop, statistics);
    FactorsOfMany { factors, variances }
}

impl<'a, const N: usize> ManyPolygons<'a, N> {
    /// Prepares polygons with their weights among these occluders.
    fn new<'b>(
        polygons: impl Iterator<Item = (&'b ConvexPolygon, [f64; N])>,
        (occluder, transparent, precision): (&'a Occluder, Option<&'a TransparentOccluders>, &'a Precision),
    ) -> Self {
        let shines = |(_, weights): &(_, [f64; N])| weights.iter().any(|weight| *weight > 0.0);
        let tree = PolygonTree::new(polygons.filter(shines).collect());
        let bodies = vec![Body::new(); tree.bodies()];
        let probe = PROBE.max(precision.rays_per_hemisphere / (NO_PROBE / LEAST_RAYS));
        let faced = Faced { places: vec![], ends: vec![], covered: [0.0; LANES], counts: [0; LANES] };
        Self {
            tree,
            occluder,
            transparent,
            precision,
            least_rays: least_rays(bodies.len()),
            probe: (bodies.len() == 1 && probe < LEAST_RAYS).then_some(probe),
            faced,
            bodies,
            sums: RunningSums::default(),
        }
    }

    /// The visible form factors of receivers by channel, and the variance of each channel, summed over them.
    fn factors(
        &mut self,
        groups: &ReceiverGroups,
        seeds: Seeds,
        stop: Stop,
        statistics: &mut RowStatistics,
    ) -> (Vec<[f64; N]>, [f64; N]) {
        let mut factors = vec![[0.0; N]; groups.receivers().len()];
        let mut variances = [0.0; N];
        statistics.pairs += (self.tree.len() * factors.len()) as u64;
        for (group, (factors, receivers)) in
            factors.chunks_mut(LANES).zip(groups.receivers().chunks(LANES)).enumerate()
        {
            self.look(groups, group, statistics);
            for (lane, (factor, receiver)) in factors.iter_mut().zip(receivers).enumerate() {
                if stop() {
                    return (vec![], variances);
                }
                let visible = self.visible(receiver, lane, seeds(group * LANES + lane), statistics);
                *factor = visible.map(|(visible, _)| visible);
                for (variance, (_, difference)) in variances.iter_mut().zip(visible) {
                    *variance += difference * difference / 4.0;
                }
            }
        }
        (factors, variances)
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
        let mut all = [[0.0; LANES]; N];
        let mut add = |place: Place, factors: &Lanes, weighted: &[Lanes; N], errors: &Lanes| {
            for (all, weighted) in all.iter_mut().zip(weighted) {
                all.iter_mut().zip(weighted).for_each(|(all, own)| *all += own);
            }
            for lane in 0..LANES {
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
                        Sight::Alone(Part { polygon, weights }, looking) => {
                            if around.is_some_and(|around| faces_away(around, polygon)) {
                                return;
                            }
                            let ViewLanes { mut factors, mut errors, .. } = lanes.view(polygon, tolerance);
                            for lane in (0..LANES).filter(|lane| looking >> lane & 1 == 0) {
                                (factors[lane], errors[lane]) = (0.0, 0.0);
                            }
                            if factors != [0.0; LANES] {
                                let weighted = weights.map(|weight| factors.map(|factor| factor * weight));
                                add(place, &factors, &weighted, &errors);
                            }
                        }
                    },
                );
            },
        );
        statistics.factors += faced.counts.iter().map(|count| u64::from(*count)).sum::<u64>();
    }

    /// The visible form factors of a receiver of the group looked at, each with the difference of what both halves of its rays tell.
    fn visible(
        &mut self,
        receiver: &Receiver,
        lane: usize,
        seed: u32,
        statistics: &mut RowStatistics,
    ) -> [(f64, f64); N] {
        let Self { tree, occluder, transparent, precision, least_rays, probe, faced, bodies, sums } = self;
        let of_channels = faced.ends.last().map_or([0.0; N], |ends| ends.map(|ends| ends[lane]));
        let all: f64 = of_channels.iter().sum();
        if all == 0.0 || (occluder.is_empty() && transparent.is_none()) {
            return of_channels.map(|all| (all, 0.0));
        }
        let mut targets = Targets::new(receiver);
        bodies.fill(Body::new());
        let mut last = [0.0; N];
        for (ends, place) in faced.ends.iter().zip(&faced.places) {
            for (channel, all) in bodies[place.body].all.iter_mut().enumerate() {
                *all += ends[channel][lane] - last[channel];
                last[channel] = ends[channel][lane];
            }
        }
        let wanted = PART * faced.covered[lane] * f64::from(precision.rays_per_hemisphere);
        let rays = (wanted as u32).next_power_of_two().clamp(*least_rays, MOST_RAYS);
        let probe = probe.filter(|_| wanted <= f64::from(PROBE));
        sums.set(faced.ends.iter().map(|ends| ends.iter().map(|ends| ends[lane]).sum::<f64>()), rays);
        let numbers = Numbers::new(seed);
        let (mut cast, mut blocking) = (0, Blocking::default());
        for ray in 0..rays {
            let [choice, x, y] = numbers.get(ray as usize);
            let (index, sums) = sums.find(choice);
            let own = sums.end - sums.start;
            let place = &faced.places[index];
            let Part { polygon, weights } =
                tree.choose(&place.range, ((choice * all - sums.start) / own).clamp(0.0, 1.0));
            let Target { at, weight } = targets.draw((index, place), polygon, [x, y]);
            let weight = weight / own;
            cast += 1;
            if weight > 0.0 && own > 0.0 {
                let planes = [receiver.plane, polygon.plane()];
                let part = if occluder.blocks_again(receiver.position, at, planes, &mut blocking) {
                    0.0
                } else {
                    transparent.map_or(1.0, |some| some.between(receiver.position, at, planes))
                };
                let of_all: f64 = weights.iter().sum();
                for (ratio, own) in bodies[place.body].ratios.iter_mut().zip(weights) {
                    ratio.add(ray >= rays / 2, weight * (own / of_all), part);
                }
            }
            if Some(cast) == probe {
                let (arrived, sent) = bodies[0].ratio().sums();
                if arrived == sent && sent > 0.0 {
                    break;
                }
            }
        }
        statistics.rays += u64::from(cast);
        statistics.sampled_pairs += u64::from(faced.counts[lane]);
        statistics.occluded_pairs += u64::from(faced.counts[lane]);
        visible_of(bodies, rays)
    }
}

/// Rays that a receiver sends to a shooter of this many bodies, at least.
#[must_use]
pub fn least_rays(bodies: usize) -> u32 {
    (bodies.min(MOST_FOR_BODIES as usize) as u32).next_power_of_two().max(LEAST_RAYS)
}
