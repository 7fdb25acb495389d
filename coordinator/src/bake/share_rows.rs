//! Rows of the shares: kept while they fit, and made again where they do not.

use std::collections::HashMap;

use shared::row::{Row, Shooter};
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
}

impl ShareRows {
    /// No rows yet. So many bytes may be used to keep them.
    pub fn new(shooters: Vec<Shooter>, bytes: usize) -> Self {
        Self { shooters, sets: vec![], cache: RowCache::new(bytes), variances: vec![] }
    }

    /// One more set of receivers.
    pub fn add_set(&mut self, set: ReceiverSet) -> SetId {
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
        self.sets.into_iter().for_each(|set| office.release_receivers(set));
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
        let missing = self.missing(sets, &wanted);
        office.expect_rows(missing.iter().map(|job| job.shares.len() as u64).sum());
        let count = self.shooters.len();
        let Self { shooters, sets: receivers, cache, variances } = self;
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
        let wish = |job: Missing| {
            let wish = Wish {
                shooters: job.shares.iter().map(|share| shooters[share.index()].clone()).collect(),
                set: receivers[job.set.index()],
                again: job.again.clone(),
            };
            (job, wish)
        };
        office.in_order(missing.into_iter().map(wish), |job, finished| {
            hand_over(job.block, &mut made);
            for ((share, row), statistics) in job.shares.iter().zip(finished.rows).zip(finished.statistics) {
                variances[job.set.index()][share.index()] = Some(statistics.sampling_variance);
                made.insert((job.set, *share), row);
            }
        })?;
        hand_over(count, &mut made);
        Ok(())
    }

    /// Which rows are not kept, cut into jobs, block by block.
    fn missing(&self, sets: &[SetId], wanted: &impl Fn(ShareId) -> bool) -> Vec<Missing> {
        let receivers: usize = sets.iter().map(|set| self.set(*set).count()).sum();
        let block = (PAIRS_PER_BLOCK / receivers.max(1)).clamp(1, LARGEST_BLOCK);
        let mut jobs = vec![];
        for first in (0..self.shooters.len()).step_by(block) {
            let end = (first + block).min(self.shooters.len());
            let shares = (first..end).map(|index| ShareId(index as u32)).filter(|share| wanted(*share));
            let shares: Vec<ShareId> = shares.collect();
            for set in sets {
                let is_missing = |share: &ShareId| self.cache.row(*set, *share).is_none();
                let missing: Vec<ShareId> = shares.iter().copied().filter(is_missing).collect();
                for some in missing.chunks(self.set(*set).shooters_per_job()) {
                    let made = &self.variances[set.index()];
                    let again = some.iter().map(|share| made[share.index()].is_some()).collect();
                    jobs.push(Missing { block: first, set: *set, shares: some.to_vec(), again });
                }
            }
        }
        jobs
    }
}

/// A job for rows that are not kept.
struct Missing {
    /// First share of its block.
    block: usize,
    set: SetId,
    shares: Vec<ShareId>,
    /// Which of them were made before.
    again: Vec<bool>,
}
