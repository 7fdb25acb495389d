//! Bodies: the polygons of a shooter that share corners, and what rays tell of each.

use foldhash::{HashMap, HashMapExt};

use super::super::ratio::RayRatio;
use crate::disjoint_sets::DisjointSets;
use crate::geometry::{ConvexPolygon, position_bits};

/// Rays that are enough to tell of a body by itself, in the mean.
const ENOUGH_RAYS: f64 = 2.0;

/// A body, as the receiver at hand sees it.
#[derive(Clone, Default)]
pub(super) struct Body {
    /// Sum of weighted form factors.
    pub(super) all: f64,
    /// What its rays told.
    pub(super) ratio: RayRatio,
}

/// The part of all bodies that arrives: rays tell of those that get enough of them one by one, and of all others together. And the
/// difference of what the one half of the rays tells and the other.
pub(super) fn visible_of(bodies: &[Body], rays: u32) -> (f64, f64) {
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
