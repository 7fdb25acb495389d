//! The rows of the shares: kept while they fit, and made again where they do not.

use foldhash::{HashMap, HashMapExt};

use glam::DVec3;
use kernel::replica::Receiver;
use kernel::row::{Row, Shooter};
use smallvec::SmallVec;

use super::local_radiosity::{LocalRadiosity, Radiosity};
use super::near::NearShares;
use super::vertices::VertexSets;
use crate::channels::Gathering;
use crate::context::Context;
use crate::error::Result;
use crate::jobs::{ReceiverSet, RowBatch, RowClient};
use crate::mesh::Mesh;
use crate::solver::ShareId;
use crate::solver::bounds::Bounds;
use crate::solver::cache::{RowCache, SetId};
use crate::solver::slab::Slab;

/// Rows are requested in blocks of shares, over all sets at once, of about this many pairs: some jobs for each set, and little
/// memory for the rows that wait until their block is complete.
const PAIRS_PER_BLOCK: usize = 4_000_000;

/// Most shares of a block.
const LARGEST_BLOCK: usize = 1024;

/// Shares are handed over together until their rows have this many factors: enough for all threads, and few to be held beside what may
/// be kept,
const FACTORS_AT_ONCE: usize = 1 << 24;

/// and no more of them than this.
const SHARES_AT_ONCE: usize = 1 << 16;

/// The rows of all shares over all sets of receivers that need them more than once.
pub struct RowTable {
    shooters: Vec<Shooter>,
    sets: Vec<ReceiverSet>,
    /// By set: the receivers, where the parts of near shares count one by one.
    near: Vec<Option<NearSet>>,
    cache: RowCache,
    /// By set and share: the variance of the row, once it was made.
    variances: Vec<Vec<Option<f64>>>,
    /// The vertices as receivers.
    pub vertices: VertexSets,
    /// Scales vertices that see more than a hemisphere.
    pub bounds: Bounds,
    /// The refinement samples, if there are any.
    pub samples: Option<SetId>,
    /// The middles of large leaves, if there are any.
    pub middles: Option<SetId>,
    /// Bytes of the rows over the shooting mesh.
    pub coarse_bytes: usize,
    /// Most bytes of rows that were ever kept.
    pub most_bytes: usize,
}

impl RowTable {
    /// An empty table that may keep this number of bytes of rows.
    pub fn new(shooters: Vec<Shooter>, bytes: usize) -> Self {
        Self {
            shooters,
            sets: vec![],
            near: vec![],
            cache: RowCache::new(bytes),
            variances: vec![],
            vertices: VertexSets::default(),
            bounds: Bounds::default(),
            samples: None,
            middles: None,
            coarse_bytes: 0,
            most_bytes: 0,
        }
    }

    /// Adds a set of receivers. Where these are given, too, near shares light them part by part.
    pub fn add_set(&mut self, set: ReceiverSet, near: Option<&[Receiver]>) -> SetId {
        self.sets.push(set);
        self.near.push(near.map(|receivers| NearSet { receivers: receivers.to_vec(), shares: None }));
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

    /// The rows that are kept.
    pub fn cache(&mut self) -> &mut RowCache {
        &mut self.cache
    }

    /// Variance of the row of each share over a set, summed over it; 0 of a row not yet made.
    pub fn variances(&self, set: SetId) -> impl Iterator<Item = f64> + '_ {
        self.variances[set.index()].iter().map(|variance| variance.unwrap_or(0.0))
    }

    /// Releases all sets and drops all rows.
    pub fn end(&mut self, client: &mut RowClient) {
        self.sets.drain(..).for_each(|set| client.release(set));
        (self.shooters, self.variances, self.near) = (vec![], vec![], vec![]);
        self.cache = RowCache::new(0);
    }

    /// The rows of some shares over a set as a job.
    pub fn batch(&self, set: SetId, shares: &[ShareId]) -> RowBatch {
        let of = &self.variances[set.index()];
        RowBatch {
            shooters: shares.iter().map(|share| self.shooters[share.index()].clone()).collect(),
            set: self.set(set),
            again: shares.iter().map(|share| of[share.index()].is_some()).collect(),
        }
    }

    /// Gathers the irradiance that shares of each of these radiosities give the receivers of some sets, set by set, in one pass over
    /// the rows. `look` sees the rows of some shares over a set, with its place among the sets.
    pub fn gather_each(
        &mut self,
        cx: &mut Context,
        mesh: &Mesh,
        sets: &[SetId],
        radiosities: &[Radiosity],
        mut look: impl FnMut(usize, &[ShareId], &Slab),
    ) -> Result<Vec<Vec<Vec<DVec3>>>> {
        let nothing = |set: &SetId| cx.channels.gathering(self.set(*set).count());
        let mut gathered: Vec<Vec<Gathering>> =
            radiosities.iter().map(|_| sets.iter().map(nothing).collect()).collect();
        let is_new = |set: &SetId| self.near[set.index()].as_ref().is_some_and(|near| near.shares.is_none());
        let mut new: Vec<Option<NearShares>> =
            sets.iter().map(|set| is_new(set).then(NearShares::default)).collect();
        self.each(
            cx.client,
            sets,
            |_| true,
            |handed| {
                let shares: Vec<ShareId> = handed.iter().map(|handed| handed.share).collect();
                for set in 0..sets.len() {
                    let rows: Vec<&Row> =
                        handed.iter().flat_map(|handed| handed.rows.get(set).copied()).collect();
                    let slab = Slab::new(&rows);
                    look(set, &shares, &slab);
                    if let Some(near) = &mut new[set] {
                        near.add_all(&shares, &rows);
                    }
                    for (gathered, radiosity) in gathered.iter_mut().zip(radiosities) {
                        let wholes = radiosity.wholes();
                        gathered[set].add_slab(&slab, |row| wholes[shares[row].index()]);
                    }
                }
            },
        )?;
        self.most_bytes = self.most_bytes.max(self.cache.most_bytes());
        for (set, mut shares) in sets.iter().zip(new).filter_map(|(set, new)| Some((set, new?))) {
            shares.sort();
            if let Some(near) = &mut self.near[set.index()] {
                near.shares = Some(shares);
            }
        }
        let mut light = vec![];
        for (gathered, radiosity) in gathered.into_iter().zip(radiosities) {
            let mut by_set: Vec<_> = gathered.into_iter().map(Gathering::into_irradiance).collect();
            if let Some(local) = radiosity.local {
                self.add_near(cx, mesh, sets, local, &mut by_set)?;
            }
            light.push(by_set);
        }
        Ok(light)
    }

    /// Adds to the light of some sets what the parts of near shares give beside what these do as wholes.
    pub fn add_near(
        &self,
        cx: &mut Context,
        mesh: &Mesh,
        sets: &[SetId],
        local: &LocalRadiosity,
        by_set: &mut [Vec<DVec3>],
    ) -> Result<()> {
        for (set, light) in sets.iter().zip(by_set) {
            if let Some((receivers, near)) = self.near(*set) {
                near.add_light(&mut cx.client.monitor, mesh, receivers, local, light)?;
            }
        }
        Ok(())
    }

    /// The receivers of a set, with the shares that are near to them, where these count part by part.
    pub fn near(&self, set: SetId) -> Option<(&[Receiver], &NearShares)> {
        let NearSet { receivers, shares } = self.near[set.index()].as_ref()?;
        Some((receivers, shares.as_ref()?))
    }

    /// What all vertices get, from what the receivers of their sets do.
    pub fn at_vertices(&self, by_set: Vec<Vec<DVec3>>) -> Vec<DVec3> {
        let mut reflected = self.vertices.join(by_set);
        self.bounds.apply(0, &mut reflected);
        reflected
    }

    /// Notes that a row was made.
    pub fn made(&mut self, set: SetId, share: ShareId, variance: f64) {
        self.variances[set.index()][share.index()] = Some(variance);
    }

    /// Goes over all shares in order, some at a time, with the rows of each over these sets where it is `wanted`: rows that are not
    /// kept are made, and kept if they fit.
    pub fn each(
        &mut self,
        client: &mut RowClient,
        sets: &[SetId],
        wanted: impl Fn(ShareId) -> bool,
        mut take: impl FnMut(&[Handed]),
    ) -> Result<()> {
        let missing = self.missing(sets, &wanted);
        let mut left: usize = missing.iter().map(|missing| missing.shares.len()).sum();
        client.monitor.expect_rows(left as u64);
        let count = self.shooters.len();
        let Self { shooters, sets: receivers, cache, variances, .. } = self;
        let mut made: HashMap<(SetId, ShareId), Row> = HashMap::new();
        let mut next = 0;
        // Of these shares no row is missing any more. False once all were handed over.
        let mut hand_over = |until: usize, made: &mut HashMap<(SetId, ShareId), Row>| {
            if next >= until {
                return false;
            }
            let with_rows = |share: ShareId| {
                let row = |set: &SetId| cache.row(*set, share).or_else(|| made.get(&(*set, share)));
                let rows: SmallVec<[&Row; 8]> =
                    if wanted(share) { sets.iter().filter_map(row).collect() } else { SmallVec::new() };
                debug_assert!(!wanted(share) || rows.len() == sets.len(), "each row is kept or was made");
                Handed { share, rows }
            };
            let mut factors = 0;
            let fits = |handed: &Handed| {
                let before = factors;
                factors += handed.factors();
                before < FACTORS_AT_ONCE
            };
            let shares = (next..until.min(next + SHARES_AT_ONCE)).map(|index| ShareId(index as u32));
            let count = {
                let handed: Vec<Handed> = shares.map(with_rows).take_while(fits).collect();
                take(&handed);
                handed.len()
            };
            let first = next;
            next += count;
            let shares = (first..next).map(|index| ShareId(index as u32));
            for (share, set) in shares.flat_map(|share| sets.iter().map(move |set| (share, *set))) {
                if let Some(row) = made.remove(&(set, share)) {
                    cache.keep(set, share, row);
                }
            }
            true
        };
        let mut missing = missing.into_iter().peekable();
        let batches = |client: &RowClient| {
            let next = missing.peek_mut()?;
            let set = receivers[next.set.index()];
            let most = client.rows_of_next_job(set, left).min(next.shares.len());
            let job = Missing { shares: next.shares.drain(..most).collect(), again: vec![], ..*next };
            let again = next.again.drain(..most).collect();
            if next.shares.is_empty() {
                missing.next();
            }
            left -= most;
            let shooters_of_job = job.shares.iter().map(|share| shooters[share.index()].clone()).collect();
            Some((job, RowBatch { shooters: shooters_of_job, set, again }))
        };
        client.in_order(batches, |job, finished| {
            while hand_over(job.block, &mut made) {}
            for ((share, row), statistics) in job.shares.iter().zip(finished.rows).zip(finished.statistics) {
                variances[job.set.index()][share.index()] = Some(statistics.sampling_variance);
                made.insert((job.set, *share), row);
            }
        })?;
        // Where all rows are kept, nothing else asks.
        while hand_over(count, &mut made) {
            client.monitor.check()?;
        }
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

/// Receivers of a set with the shares that are near to them, once rows were seen.
struct NearSet {
    receivers: Vec<Receiver>,
    shares: Option<NearShares>,
}

/// A share with its rows.
pub struct Handed<'a> {
    /// The share.
    pub share: ShareId,
    /// By set; none where it is not wanted.
    pub rows: SmallVec<[&'a Row; 8]>,
}

impl Handed<'_> {
    /// Number of factors.
    fn factors(&self) -> usize {
        self.rows.iter().map(|row| row.count()).sum()
    }
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
