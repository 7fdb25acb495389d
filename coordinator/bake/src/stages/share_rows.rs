//! Rows of the shares: kept while they fit, and made again where they do not.

use std::collections::HashMap;

use kernel::replica::{Receiver, Receivers};
use kernel::row::{Hemisphere, Row, Shape, Shooter};
use smallvec::SmallVec;

use super::BakeError;
use super::rows::{ReceiverSet, RowOffice, Wish};
use crate::solver::ShareId;
use crate::solver::cache::{RowCache, SetId};

/// Receivers of the shooting mesh.
pub const COARSE: SetId = SetId(0);

/// Rows are asked for in blocks of shares, over all sets at once: so many pairs in a block. Some jobs for each set, and little
/// memory for the rows that wait until all of their block are there.
const PAIRS_PER_BLOCK: usize = 4_000_000;

/// Shares of a block at most.
const LARGEST_BLOCK: usize = 1024;

/// The rows of all shares over all sets of receivers that the solution is wanted at.
pub struct ShareRows {
    shooters: Vec<Shooter>,
    sets: Vec<ReceiverSet>,
    cache: RowCache,
    /// By set and share: the variance of the row, once it was made.
    variances: Vec<Vec<Option<f64>>>,
    /// The shares as polygons, where rows are those of receivers.
    seen: Option<ReceiverSet>,
}

impl ShareRows {
    /// No rows yet. So many bytes may be used to keep them.
    pub fn new(shooters: Vec<Shooter>, bytes: usize) -> Self {
        Self { shooters, sets: vec![], cache: RowCache::new(bytes), variances: vec![], seen: None }
    }

    /// No rows yet of shares that are seen as these polygons, one each: rows are those of receivers, and all are kept.
    pub fn seen_as(polygons: ReceiverSet, shooters: Vec<Shooter>) -> Self {
        Self { seen: Some(polygons), ..Self::new(shooters, usize::MAX) }
    }

    /// One more set of receivers, with its rows at once where they are those of receivers: of so many rays each.
    ///
    /// # Errors
    /// When rows cannot be had.
    pub fn add_receivers(
        &mut self,
        office: &mut RowOffice,
        receivers: &Receivers,
        rays: impl Fn(usize) -> u32,
    ) -> Result<SetId, BakeError> {
        let set = office.publish_receivers(receivers);
        let id = self.add_set(set);
        let Some(polygons) = self.seen else { return Ok(id) };
        for (share, row) in (0..).map(ShareId).zip(rows_of_hemispheres(office, polygons, receivers, rays)?) {
            self.cache.keep(id, share, row);
            self.made(id, share, 0.0);
        }
        Ok(id)
    }

    /// Hands over the row of each share over receivers that nothing is kept of.
    ///
    /// # Errors
    /// When rows cannot be had.
    pub fn each_over(
        &self,
        office: &mut RowOffice,
        set: ReceiverSet,
        receivers: &Receivers,
        mut take: impl FnMut(usize, &Row),
    ) -> Result<(), BakeError> {
        let Some(polygons) = self.seen else {
            return office.each_row(&self.shooters, set, |share, row, _| take(share, row));
        };
        let rays = office.rays_per_hemisphere();
        let rows = rows_of_hemispheres(office, polygons, receivers, |_| rays)?;
        rows.iter().enumerate().for_each(|(share, row)| take(share, row));
        Ok(())
    }

    /// One more set of receivers.
    fn add_set(&mut self, set: ReceiverSet) -> SetId {
        self.sets.push(set);
        self.variances.push(vec![None; self.shooters.len()]);
        self.cache.add_set(self.shooters.len())
    }

    /// A set of receivers.
    pub fn set(&self, id: SetId) -> ReceiverSet {
        self.sets[id.index()]
    }

    /// The shares as shooters.
    pub fn shooters(&self) -> &[Shooter] {
        &self.shooters
    }

    /// What is kept.
    pub fn cache(&mut self) -> &mut RowCache {
        &mut self.cache
    }

    /// Variance of the row of each share over a set, summed over it; 0 of a row not yet made.
    pub fn variances(&self, set: SetId) -> impl Iterator<Item = f64> + '_ {
        self.variances[set.index()].iter().map(|variance| variance.unwrap_or(0.0))
    }

    /// Lets the workers forget all sets.
    pub fn release(self, office: &mut RowOffice) {
        self.sets.into_iter().chain(self.seen).for_each(|set| office.release_receivers(set));
    }

    /// Asks for the rows of some shares over a set.
    pub fn wish(&self, set: SetId, shares: &[ShareId]) -> Wish {
        let of = &self.variances[set.index()];
        Wish {
            shooters: shares.iter().map(|share| self.shooters[share.index()].clone()).collect(),
            set: self.set(set),
            again: shares.iter().map(|share| of[share.index()].is_some()).collect(),
        }
    }

    /// Notes that a row was made.
    pub fn made(&mut self, set: SetId, share: ShareId, variance: f64) {
        self.variances[set.index()][share.index()] = Some(variance);
    }

    /// Goes over all shares in their order, with the rows of each over these sets where it is `wanted`: those that are kept, and
    /// the others made, and kept if they fit.
    pub fn each(
        &mut self,
        office: &mut RowOffice,
        sets: &[SetId],
        wanted: impl Fn(ShareId) -> bool,
        mut take: impl FnMut(ShareId, Option<&[&Row]>),
    ) -> Result<(), BakeError> {
        // Where all rows are kept, no other question would come between two sweeps.
        office.check()?;
        let missing = self.missing(sets, &wanted);
        let mut left: usize = missing.iter().map(|missing| missing.shares.len()).sum();
        office.expect_rows(left as u64);
        let count = self.shooters.len();
        let Self { shooters, sets: receivers, cache, variances, .. } = self;
        let mut made: HashMap<(SetId, ShareId), Row> = HashMap::new();
        let mut next = 0;
        // Of these shares no row is missing any more.
        let mut hand_over = |until: usize, made: &mut HashMap<(SetId, ShareId), Row>| {
            for share in (next..until).map(|index| ShareId(index as u32)) {
                if !wanted(share) {
                    take(share, None);
                    continue;
                }
                {
                    let row = |set: &SetId| cache.row(*set, share).or_else(|| made.get(&(*set, share)));
                    let rows: SmallVec<[&Row; 16]> = sets.iter().filter_map(row).collect();
                    debug_assert_eq!(rows.len(), sets.len(), "each row is kept or was made");
                    take(share, Some(&rows));
                }
                for set in sets {
                    if let Some(row) = made.remove(&(*set, share)) {
                        cache.keep(*set, share, row);
                    }
                }
            }
            next = until;
        };
        let mut missing = missing.into_iter().peekable();
        let wishes = |office: &RowOffice| {
            let next = missing.peek_mut()?;
            let set = receivers[next.set.index()];
            let most = office.shooters_of_next_job(set, left).min(next.shares.len());
            let job = Missing { shares: next.shares.drain(..most).collect(), again: vec![], ..*next };
            let again = next.again.drain(..most).collect();
            if next.shares.is_empty() {
                missing.next();
            }
            left -= most;
            let shooters_of_job = job.shares.iter().map(|share| shooters[share.index()].clone()).collect();
            Some((job, Wish { shooters: shooters_of_job, set, again }))
        };
        office.in_order(wishes, |job, finished| {
            hand_over(job.block, &mut made);
            for ((share, row), statistics) in job.shares.iter().zip(finished.rows).zip(finished.statistics) {
                variances[job.set.index()][share.index()] = Some(statistics.sampling_variance);
                made.insert((job.set, *share), row);
            }
        })?;
        hand_over(count, &mut made);
        Ok(())
    }

    /// Which rows are not kept, block by block.
    fn missing(&self, sets: &[SetId], wanted: &impl Fn(ShareId) -> bool) -> Vec<Missing> {
        let receivers: usize = sets.iter().map(|set| self.set(*set).count()).sum();
        let block = (PAIRS_PER_BLOCK / receivers.max(1)).clamp(1, LARGEST_BLOCK);
        let mut all = vec![];
        for first in (0..self.shooters.len()).step_by(block) {
            let end = (first + block).min(self.shooters.len());
            let shares = (first..end).map(|index| ShareId(index as u32)).filter(|share| wanted(*share));
            let shares: Vec<ShareId> = shares.collect();
            for set in sets {
                let is_missing = |share: &ShareId| self.cache.row(*set, *share).is_none();
                let shares: Vec<ShareId> = shares.iter().copied().filter(is_missing).collect();
                if !shares.is_empty() {
                    let made = &self.variances[set.index()];
                    let again = shares.iter().map(|share| made[share.index()].is_some()).collect();
                    all.push(Missing { block: first, set: *set, shares, again });
                }
            }
        }
        all
    }
}

/// What receivers see of polygons, each with so many rays, as a row for each polygon over all receivers.
///
/// # Errors
/// When rows cannot be had.
pub fn rows_of_hemispheres(
    office: &mut RowOffice,
    polygons: ReceiverSet,
    receivers: &Receivers,
    rays: impl Fn(usize) -> u32,
) -> Result<Vec<Row>, BakeError> {
    let hemisphere = |(index, receiver): (usize, &Receiver)| {
        let rays = rays(index).clamp(1, Hemisphere::MOST_RAYS);
        let shape = Shape::Hemisphere(Hemisphere { receiver: *receiver, rays });
        Shooter { key: receivers.first_key + index as u64, shape }
    };
    let shooters: Vec<Shooter> = receivers.receivers.iter().enumerate().map(hemisphere).collect();
    let mut by_polygon: Vec<Vec<(u32, f32)>> = vec![vec![]; polygons.count()];
    office.each_row(&shooters, polygons, |receiver, row, _| {
        row.for_each(|polygon, factor| by_polygon[polygon].push((receiver as u32, factor)));
    })?;
    let row = |factors: Vec<(u32, f32)>| {
        let factors: Vec<(usize, f32)> =
            factors.into_iter().map(|(receiver, factor)| (receiver as usize, factor)).collect();
        Row::of_some(shooters.len(), &factors)
    };
    Ok(by_polygon.into_iter().map(row).collect())
}

/// Rows that are not kept, over one set.
struct Missing {
    /// First share of their block.
    block: usize,
    set: SetId,
    shares: Vec<ShareId>,
    /// Which of them were made before.
    again: Vec<bool>,
}
