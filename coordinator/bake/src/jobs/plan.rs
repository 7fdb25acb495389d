//! What rows are over, and how they are cut into jobs: pure.

use std::ops::Range;

use kernel::replica::Digest;
use kernel::row::{Shape, Shooter};
use kernel::visibility::{MANY_POLYGONS, least_rays};

use super::sizes::RowKind;

/// Cost of a ray of a hemisphere, in pairs.
const PAIRS_PER_RAY: usize = 4;

/// Bounds of the receivers of a part of a row, where there are few rows: multiples of the groups that receivers and factors come in.
const LEAST_RANGE: usize = 1 << 10;
const MOST_RANGE: usize = 1 << 14;

/// Parts that are enough for all threads.
const ENOUGH_PARTS: usize = 1 << 10;

/// Bounds of the size of a part where a shooter has many polygons, or is a sky, in receivers times their cost.
const LEAST_SIZE_OF_MANY: usize = 12 << 10;
const MOST_SIZE_OF_MANY: usize = 48 << 10;

/// Rays, and form factors of polygons, that make a cost of 1.
const RAYS_PER_COST: usize = 4;
const POLYGONS_PER_COST: usize = 64;

/// A message has all polygons of the shooter, and a job prepares them: no more for each receiver.
const POLYGONS_PER_RECEIVER: usize = 4;

/// Bounds of the receivers of such a part.
const LEAST_RANGE_OF_MANY: usize = 1 << 6;
const MOST_RANGE_OF_MANY: usize = 1 << 12;

/// From this number of rows on, all threads have work without any row being cut.
const FEW_ROWS: usize = 64;

/// A published set that rows are over: of receivers, or of polygons that receivers see.
#[derive(Debug, Clone, Copy)]
pub struct ReceiverSet {
    pub(super) digest: Digest,
    /// First receiver of the range.
    pub(super) first: usize,
    pub(super) count: usize,
    /// Cost of a row, in pairs.
    pub(super) pairs: usize,
    /// Of the rows over it.
    pub(super) kind: RowKind,
}

impl ReceiverSet {
    /// Number of receivers.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The set in consecutive parts of this many receivers.
    fn parts(self, receivers: usize) -> impl Iterator<Item = Self> {
        (0..self.count).step_by(receivers).map(move |first| {
            let count = receivers.min(self.count - first);
            Self { first: self.first + first, count, pairs: count, ..self }
        })
    }

    /// The same where rows are over its polygons, with this number of rays.
    #[must_use]
    pub fn seen_by(self, rays: u32) -> Self {
        // A ray through the scene takes about as long as some pairs with little between.
        Self { pairs: PAIRS_PER_RAY * rays as usize, ..self }
    }
}

/// Cost of a receiver where rays go to all of a shooter, its many polygons or a sky.
fn cost_of_many(shooter: &Shooter) -> Option<usize> {
    let joint = |polygons: usize, bodies: usize| {
        polygons / POLYGONS_PER_COST + least_rays(bodies) as usize / RAYS_PER_COST
    };
    match &shooter.shape {
        Shape::Polygons(polygons) if polygons.len() >= MANY_POLYGONS => Some(joint(polygons.len(), 1)),
        // Each may be a lamp by itself.
        Shape::Weighted(polygons, _) => Some(joint(polygons.len(), polygons.len())),
        Shape::Sky(rays) => Some((*rays as usize / RAYS_PER_COST).max(1)),
        _ => None,
    }
}

/// Where the channels of a shape end, of which the last shooter before `end` is one: jobs have rows of all.
pub(super) fn end_of_channels(shooters: &[Shooter], end: usize) -> usize {
    let is_end =
        |at: &usize| !shooters.get(*at).is_some_and(|next| next.is_next_channel_of(&shooters[at - 1]));
    (end..).find(is_end).unwrap_or(end)
}

/// How the rows of some shooters over a set are cut into jobs.
pub(super) struct Plan {
    pub(super) set: ReceiverSet,
    /// One job each, in order; none where jobs are of whole rows. This does not depend on the time that rows take: a checkpoint
    /// knows the pieces of a row by their receivers.
    pub(super) pieces: Option<Vec<Piece>>,
}

/// A row over a part of a set, or those of the channels of one shape.
#[derive(Clone)]
pub(super) struct Piece {
    pub(super) shooters: Range<usize>,
    pub(super) set: ReceiverSet,
    pub(super) is_last: bool,
}

impl Plan {
    /// Cuts rows only where there are few of them.
    pub(super) fn new(shooters: &[Shooter], set: ReceiverSet) -> Self {
        if set.kind == RowKind::Hemispheres {
            return Self { set, pieces: None };
        }
        let pairs = shooters.len() * set.count;
        let few_polygons =
            (pairs / ENOUGH_PARTS).clamp(LEAST_RANGE, MOST_RANGE).next_multiple_of(LEAST_RANGE_OF_MANY);
        // The other channels of a shape cost next to nothing.
        let first_channels = || shooters.iter().filter(|shooter| shooter.shape.channel() == 0);
        let cost_of_all = first_channels().filter_map(cost_of_many).sum::<usize>() * set.count;
        let size_of_many = (cost_of_all / ENOUGH_PARTS).clamp(LEAST_SIZE_OF_MANY, MOST_SIZE_OF_MANY);
        // Most receivers of a piece.
        let range = |shooter: &Shooter| match cost_of_many(shooter) {
            Some(cost) => {
                let least = shooter.shape.polygons() / POLYGONS_PER_RECEIVER;
                let least = least.clamp(LEAST_RANGE_OF_MANY, MOST_RANGE_OF_MANY);
                let range = (size_of_many / cost).clamp(least, MOST_RANGE_OF_MANY);
                range / LEAST_RANGE_OF_MANY * LEAST_RANGE_OF_MANY
            }
            None => few_polygons,
        };
        let has_many = shooters.iter().any(|shooter| cost_of_many(shooter).is_some());
        let set = ReceiverSet { kind: if has_many { RowKind::Many } else { RowKind::Plain }, ..set };
        // Few rows over many receivers would leave most threads without work.
        if first_channels().count() >= FEW_ROWS || shooters.iter().all(|shooter| set.count <= range(shooter))
        {
            return Self { set, pieces: None };
        }
        let mut first = 0;
        let pieces_of = |channels: &[Shooter]| {
            let shooters = first..first + channels.len();
            first = shooters.end;
            let range = range(&channels[0]);
            let last = set.count.div_ceil(range) - 1;
            let piece = move |(at, set)| Piece { shooters: shooters.clone(), set, is_last: at == last };
            set.parts(range).enumerate().map(piece)
        };
        let pieces =
            shooters.chunk_by(|before, next| next.is_next_channel_of(before)).flat_map(pieces_of).collect();
        Self { set, pieces: Some(pieces) }
    }
}
