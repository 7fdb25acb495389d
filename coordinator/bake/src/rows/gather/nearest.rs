//! The gather points that are nearest to a receiver, in place and in the direction that they face.

use std::num::NonZero;

use kernel::replica::Receiver;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

/// Receivers that one thread takes at a time.
pub const AT_ONCE: usize = 256;

const ONE: NonZero<usize> = NonZero::new(1).unwrap();

/// More than distances may be wrong by rounding.
const ROUNDING: f64 = 1.0 + 1e-9;

/// A turn of the normal by one radian counts as this distance, relative to the scene's extent.
const TURN: f64 = 0.05;

/// Points, sorted.
pub struct SortedPoints {
    /// None of no points: it cannot be built.
    tree: Option<ImmutableKdTree<f64, 6>>,
    /// Of the scene.
    extent: f64,
}

/// A receiver whose nearest points are known.
pub struct Last {
    place: [f64; 6],
    /// Distance of the farthest of them.
    reach: f64,
}

impl Default for Last {
    fn default() -> Self {
        Self { place: [0.0; 6], reach: f64::INFINITY }
    }
}

impl Last {
    /// Square of a distance that as many points are no farther from another place than.
    fn bound(&self, place: &[f64; 6]) -> f64 {
        let between: f64 = self.place.iter().zip(place).map(|(a, b)| (a - b) * (a - b)).sum();
        (self.reach + between.sqrt()).powi(2) * ROUNDING
    }
}

impl SortedPoints {
    /// Sorts points.
    pub fn new(points: &[Receiver], extent: f64) -> Self {
        let places: Vec<[f64; 6]> = points.iter().map(|point| place(point, extent)).collect();
        let tree = ImmutableKdTree::new_from_slice(&places).ok().filter(|_| !points.is_empty());
        Self { tree, extent }
    }

    /// The nearest points to a receiver, the nearest first, with squares of their distances, none of more than `most`. They are found
    /// sooner where `last`, for which as many were asked, lies nearby.
    pub fn nearest(
        &self,
        receiver: &Receiver,
        count: NonZero<usize>,
        most: f64,
        last: &mut Last,
    ) -> impl Iterator<Item = (u32, f64)> + use<> {
        let place = place(receiver, self.extent);
        let query = |tree: &ImmutableKdTree<f64, 6>| {
            tree.query(&place)
                .nearest_n::<SquaredEuclidean<f64>>(count)
                .within::<SquaredEuclidean<f64>>(last.bound(&place).min(most))
                .execute()
        };
        let found = self.tree.as_ref().map(query).unwrap_or_default();
        last.place = place;
        let is_all = found.len() == count.get();
        last.reach = found.last().filter(|_| is_all).map_or(f64::INFINITY, |found| found.distance.sqrt());
        found.into_iter().map(|found| (found.item, found.distance))
    }
}

/// The point that is nearest to a receiver.
#[derive(Clone, Copy)]
pub struct Nearest {
    pub point: u32,
    /// Square of the distance between their places.
    square: f64,
}

impl Default for Nearest {
    fn default() -> Self {
        Self { point: 0, square: f64::INFINITY }
    }
}

/// Takes points from `first` on for those that are nearest to some receivers, where they are nearer than the known ones. They are found
/// sooner where each receiver lies by the one before.
pub fn take_nearer(
    nearest: &mut [Nearest],
    receivers: &[Receiver],
    points: &[Receiver],
    first: u32,
    extent: f64,
) {
    let tree = SortedPoints::new(&points[first as usize..], extent);
    let take = |(nearest, receivers): (&mut [Nearest], &[Receiver])| {
        let mut last = Last::default();
        for (nearest, receiver) in nearest.iter_mut().zip(receivers) {
            let found = tree.nearest(receiver, ONE, nearest.square, &mut last).next();
            if let Some((point, square)) = found.filter(|(_, square)| *square < nearest.square) {
                *nearest = Nearest { point: first + point, square };
            }
        }
    };
    nearest.par_chunks_mut(AT_ONCE).zip(receivers.par_chunks(AT_ONCE)).for_each(take);
}

/// Place of a receiver among the points: its position, and its normal as far as it counts.
fn place(receiver: &Receiver, extent: f64) -> [f64; 6] {
    let [x, y, z] = receiver.position.to_array();
    let [a, b, c] = (receiver.normal * (TURN * extent)).to_array();
    [x, y, z, a, b, c]
}
