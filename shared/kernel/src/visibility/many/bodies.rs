//! Bodies: the polygons of a shooter that share corners, and what rays tell of each.

use foldhash::{HashMap, HashMapExt};

use super::super::ratio::RayRatio;
use crate::disjoint_sets::DisjointSets;
use crate::geometry::{ConvexPolygon, position_bits};

/// Rays that are enough to tell of a body by itself, in the mean.
const ENOUGH_RAYS: f64 = 2.0;

/// A body, as the receiver at hand sees it, in `N` channels.
#[derive(Clone)]
pub(super) struct Body<const N: usize> {
    /// Sum of weighted form factors.
    pub(super) all: [f64; N],
    /// What its rays told.
    pub(super) ratios: [RayRatio; N],
}

/// The part of all bodies that arrives in each channel: rays tell of those that get enough of them one by one, and of all others
/// together. And the difference of what the one half of the rays tells and the other. Where no ray goes to anything that shines in a
/// channel, those of all channels tell.
pub(super) fn visible_of<const N: usize>(bodies: &[Body<N>], rays: u32) -> [(f64, f64); N] {
    let all: f64 = bodies.iter().map(Body::sum).sum();
    let enough = all * ENOUGH_RAYS / f64::from(rays);
    let mut others = Body::new();
    bodies.iter().filter(|body| body.sum() < enough).for_each(|body| others.add(body));
    std::array::from_fn(|channel| {
        let all: f64 = bodies.iter().map(|body| body.all[channel]).sum();
        let (mut visible, mut told, mut difference) = (0.0, 0.0, 0.0);
        let mut halved = (0.0, RayRatio::default());
        for body in bodies.iter().filter(|body| body.sum() >= enough).chain([&others]) {
            let (own, mut ratio) = (body.all[channel], body.ratios[channel]);
            if ratio.sums().1 == 0.0 {
                ratio = body.ratio();
            }
            let (arrived, cast) = ratio.sums();
            // Rays to bodies that are barely over the horizon may all end under it.
            if cast > 0.0 {
                visible += own * (arrived / cast);
                told += own;
            }
            match ratio.estimate().or_else(|| body.ratio().estimate()) {
                Some((_, differs)) => difference += own * differs,
                // With rays in one half only: their difference is that of all such.
                None => {
                    halved.0 += own;
                    halved.1 += ratio;
                }
            }
        }
        difference += halved.1.estimate().map_or(0.0, |(_, differs)| halved.0 * differs);
        (if told > 0.0 { visible * (all / told) } else { all }, difference)
    })
}

impl<const N: usize> Body<N> {
    /// A body of which nothing is known yet.
    pub(super) fn new() -> Self {
        Self { all: [0.0; N], ratios: [RayRatio::default(); N] }
    }

    /// Takes another body together with this one.
    fn add(&mut self, other: &Self) {
        for channel in 0..N {
            self.all[channel] += other.all[channel];
            self.ratios[channel] += other.ratios[channel];
        }
    }

    /// What the rays told of all channels together.
    pub(super) fn ratio(&self) -> RayRatio {
        let mut all = RayRatio::default();
        self.ratios.iter().for_each(|ratio| all += *ratio);
        all
    }

    /// Sum of weighted form factors in all channels.
    fn sum(&self) -> f64 {
        self.all.iter().sum()
    }
}

/// The number of the body that each of these polygons belongs to, from 0 on.
pub(super) fn bodies_of(polygons: &[&ConvexPolygon]) -> Vec<usize> {
    let mut sets = DisjointSets::new(polygons.len());
    let mut owners: HashMap<[u64; 3], usize> = HashMap::new();
    for (index, polygon) in polygons.iter().enumerate() {
        for corner in &polygon.corners {
            let owner = *owners.entry(position_bits(*corner)).or_insert(index);
            sets.join(owner, index);
        }
    }
    let mut numbers: HashMap<usize, usize> = HashMap::new();
    (0..polygons.len())
        .map(|index| {
            let next = numbers.len();
            *numbers.entry(sets.representative(index)).or_insert(next)
        })
        .collect()
}
