//! Progressive refinement by shooting, driven by rows as they arrive.
//!
//! Shots go in volleys of some shares that do not wait for each other. Volleys are numbered. Volley n is chosen from the state after
//! volley n - W, where W volleys are the window, and applied after volley n - 1, in any order of arrival: the result depends on the
//! window but not on workers, threads or timing, while the rows of a window are under way.
//!
//! A shot changes only the shares that its row reaches. Shares are therefore counted in blocks, each with its sums
//! and its brightest share: a shot visits what its row reaches and every block, not every share.

use std::collections::{HashMap, VecDeque};

use kernel::row::{GROUP, Row};
use rayon::prelude::*;

use super::cache::{RowCache, SetId};
use super::slab::Slab;
use super::{Light, ShareEnergy, ShareId, add_group, interreflection_bound};

/// Shots of a volley, at most: each costs less, and less of what they give each other is shot at once.
const MOST_PER_VOLLEY: usize = 16;

/// Volleys of a window, at least: rows of the next ones are under way while one is waited for.
const VOLLEYS_IN_WINDOW: usize = 16;

/// Uncounted blocks that several threads share.
const MANY_BLOCKS: usize = 1024;

/// Blocks that a thread counts at a time.
const BLOCKS_AT_ONCE: usize = 16;

/// Shares per block. A row reaches a room of some thousand consecutive shares.
const BLOCK: usize = 128;

/// The state of a shooting solution.
pub struct Shooting<L> {
    shares: Vec<ShareEnergy<L>>,
    /// Irradiance of every receiver.
    irradiance: Vec<L>,
    /// Radiosity that each share has shot.
    shot: Vec<L>,
    /// The set of receivers that rows are over.
    set: SetId,
    /// Rows that wait for their shots.
    arrived: HashMap<ShareId, Row>,
    /// Volleys chosen and not yet applied, in order.
    chosen: VecDeque<Vec<ShareId>>,
    is_chosen: Vec<bool>,
    /// Shares that have shot: to sweep over these later costs no more than another shot now.
    has_shot: Vec<bool>,
    blocks: Vec<Block<L>>,
    blocks_at: BlocksAt,
    /// Blocks to be counted again.
    uncounted: Vec<usize>,
    /// Which groups of receivers a volley reaches.
    reached: Vec<bool>,
    /// See [`interreflection_bound`].
    bound: L,
    /// Volleys under way.
    window: usize,
    /// Shots of a volley.
    volley: usize,
    threshold: f64,
    shots: u64,
    /// Shots that may still be chosen.
    left: usize,
}

/// Sums over the shares of a block.
#[derive(Clone, Default)]
struct Block<L> {
    /// False while listed in `uncounted`.
    is_counted: bool,
    /// Flux not yet shot.
    unshot: L,
    /// Part of it in shares that have not shot and are not chosen.
    held: L,
    /// Flux reflected.
    reflected: L,
    /// The unchosen share with the largest unshot flux, and that flux.
    brightest: Option<(usize, f64)>,
}

/// Progress of shooting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShootingProgress {
    /// Shots applied.
    pub shots: u64,
    /// Unshot flux over reflected flux.
    pub unshot: f64,
}

impl<L: Light> Shooting<L> {
    /// Starts from the direct irradiance of every receiver of a set. Shooting ends when the bound of the missing flux is under
    /// `threshold`, relative to the reflected flux.
    #[must_use]
    pub fn new(
        shares: Vec<ShareEnergy<L>>,
        direct: Vec<L>,
        set: SetId,
        window: usize,
        threshold: f64,
    ) -> Self {
        let volley = (window / VOLLEYS_IN_WINDOW).clamp(1, MOST_PER_VOLLEY);
        let mut shooting = Self {
            blocks_at: BlocksAt::new(&shares, direct.len()),
            reached: vec![false; direct.len().div_ceil(GROUP)],
            irradiance: direct,
            shot: vec![L::default(); shares.len()],
            set,
            arrived: HashMap::new(),
            chosen: VecDeque::new(),
            is_chosen: vec![false; shares.len()],
            has_shot: vec![false; shares.len()],
            blocks: vec![Block::default(); shares.len().div_ceil(BLOCK)],
            uncounted: (0..shares.len().div_ceil(BLOCK)).collect(),
            bound: interreflection_bound(&shares),
            left: shares.len(),
            shares,
            window: window / volley,
            volley,
            threshold,
            shots: 0,
        };
        shooting.count();
        shooting
    }

    /// Chooses the first shots. Returns the shares whose rows are wanted.
    pub fn start(&mut self, cache: &RowCache) -> Vec<ShareId> {
        let mut wanted = vec![];
        while self.chosen.len() < self.window && self.choose(cache, &mut wanted) {}
        wanted
    }

    /// Takes the row of a share, applies every volley that can now be applied, and chooses one more for each. Returns the
    /// shares whose rows are wanted next. A second copy of a row is ignored. Rows of applied shots go to the cache, in order.
    pub fn row_arrived(&mut self, share: ShareId, row: Row, cache: &mut RowCache) -> Vec<ShareId> {
        let mut wanted = vec![];
        if self.is_chosen[share.index()] {
            self.arrived.entry(share).or_insert(row);
        }
        while let Some(next) = self.chosen.front() {
            let is_there =
                |share: &ShareId| self.arrived.contains_key(share) || cache.row(self.set, *share).is_some();
            if !next.iter().all(is_there) {
                break;
            }
            let volley = self.chosen.pop_front().unwrap_or_default();
            let mut arrived: Vec<Option<Row>> =
                volley.iter().map(|share| self.arrived.remove(share)).collect();
            let rows = volley.iter().zip(&arrived);
            let rows: Vec<&Row> = rows
                .filter_map(|(share, arrived)| arrived.as_ref().or_else(|| cache.row(self.set, *share)))
                .collect();
            self.apply(&volley, &rows);
            for (share, row) in volley.into_iter().zip(&mut arrived) {
                if let Some(row) = row.take() {
                    cache.keep(self.set, share, row);
                }
            }
            self.choose(cache, &mut wanted);
        }
        wanted
    }

    /// Whether a shot of this share is chosen and not yet applied.
    #[must_use]
    pub fn wants(&self, share: ShareId) -> bool {
        self.is_chosen[share.index()]
    }

    /// All shares by falling unshot flux: about the order in which they will shoot.
    #[must_use]
    pub fn by_unshot(&self) -> VecDeque<ShareId> {
        let flux = |share: usize| (self.unshot(share) * self.shares[share].area).sum_of_channels();
        let mut shares: Vec<(f64, ShareId)> =
            (0..self.shares.len()).map(|share| (flux(share), ShareId(share as u32))).collect();
        shares.sort_by(|a, b| b.0.total_cmp(&a.0));
        shares.into_iter().map(|(_, share)| share).collect()
    }

    /// True when no shot is chosen and none is worth choosing.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.chosen.is_empty()
    }

    /// Returns the progress.
    #[must_use]
    pub fn progress(&self) -> ShootingProgress {
        let [unshot, _, reflected] = self.fluxes();
        ShootingProgress { shots: self.shots, unshot: L::ratio(unshot, reflected).largest_channel() }
    }

    /// Irradiance of every receiver, by the shots applied so far.
    #[must_use]
    pub fn irradiance(&self) -> &[L] {
        &self.irradiance
    }

    /// Radiosity that each share has still to shoot.
    #[must_use]
    pub fn unshot_of_shares(&self) -> Vec<L> {
        (0..self.shares.len()).map(|share| self.unshot(share)).collect()
    }

    /// Radiosity shot by each share.
    #[must_use]
    pub fn into_shot(self) -> Vec<L> {
        self.shot
    }

    fn unshot(&self, share: usize) -> L {
        let ShareEnergy { receiver, reflectance, .. } = self.shares[share];
        reflectance * self.irradiance[receiver] - self.shot[share]
    }

    /// Total unshot, held and reflected flux. Needs counted blocks.
    fn fluxes(&self) -> [L; 3] {
        self.blocks.iter().fold([L::default(); 3], |[unshot, held, reflected], block| {
            [unshot + block.unshot, held + block.held, reflected + block.reflected]
        })
    }

    /// Counts the uncounted blocks.
    fn count(&mut self) {
        let uncounted = std::mem::take(&mut self.uncounted);
        if uncounted.len() < MANY_BLOCKS {
            uncounted.iter().for_each(|block| self.blocks[*block] = self.counted(*block));
        } else {
            let blocks = uncounted.par_iter().with_min_len(BLOCKS_AT_ONCE);
            let counted: Vec<Block<L>> = blocks.map(|block| self.counted(*block)).collect();
            uncounted.iter().zip(counted).for_each(|(block, counted)| self.blocks[*block] = counted);
        }
    }

    fn counted(&self, block: usize) -> Block<L> {
        let mut counted = Block { is_counted: true, ..Block::default() };
        let range = block * BLOCK..((block + 1) * BLOCK).min(self.shares.len());
        let states = self.is_chosen[range.clone()].iter().zip(&self.has_shot[range.clone()]);
        let energies = self.shares[range.clone()].iter().zip(&self.shot[range.clone()]);
        for ((index, (share, shot)), (is_chosen, has_shot)) in range.zip(energies).zip(states) {
            let target = share.reflectance * self.irradiance[share.receiver];
            let flux = (target - *shot) * share.area;
            counted.unshot += flux;
            counted.reflected += target * share.area;
            if !is_chosen {
                if !has_shot {
                    counted.held += flux;
                }
                let flux = flux.sum_of_channels();
                if counted.brightest.is_none_or(|(_, most)| flux > most) {
                    counted.brightest = Some((index, flux));
                }
            }
        }
        counted
    }

    /// Chooses a volley. False where nothing is worth a shot.
    fn choose(&mut self, cache: &RowCache, wanted: &mut Vec<ShareId>) -> bool {
        let most = self.volley;
        let chosen: Vec<ShareId> = std::iter::from_fn(|| self.choose_one()).take(most).collect();
        wanted.extend(chosen.iter().filter(|share| cache.row(self.set, **share).is_none()));
        let is_any = !chosen.is_empty();
        if is_any {
            self.chosen.push_back(chosen);
        }
        is_any
    }

    /// Chooses the share with the largest unshot flux, unless too little is left, or only shares that have shot have much left, or
    /// there were as many shots as a sweep has rows: sweeps finish the rest faster than more shots would.
    fn choose_one(&mut self) -> Option<ShareId> {
        self.count();
        let [unshot, held, reflected] = self.fluxes();
        let missing = L::ratio(unshot, reflected) * self.bound;
        if self.left == 0
            || missing.largest_channel() <= self.threshold
            || L::ratio(held, reflected).largest_channel() <= self.threshold
        {
            return None;
        }
        let brightest = self.blocks.iter().filter_map(|block| block.brightest);
        let best = brightest.reduce(|a, b| if b.1 > a.1 { b } else { a });
        let (index, _) = best.filter(|(_, flux)| *flux > 0.0)?;
        let share = ShareId(index as u32);
        self.is_chosen[index] = true;
        self.left -= 1;
        has_changed(&mut self.blocks, &mut self.uncounted, share);
        Some(share)
    }

    /// Each share shoots what it had before the volley.
    fn apply(&mut self, volley: &[ShareId], rows: &[&Row]) {
        let currents: Vec<L> = volley.iter().map(|share| self.unshot(share.index())).collect();
        for (share, current) in volley.iter().zip(&currents) {
            let index = share.index();
            self.is_chosen[index] = false;
            self.has_shot[index] = true;
            has_changed(&mut self.blocks, &mut self.uncounted, *share);
            self.shot[index] += *current;
        }
        Slab::new(rows).add(&mut self.irradiance, |row, part, mask, factors| {
            add_group(part, mask, factors, currents[row]);
        });
        self.reached.fill(false);
        for row in rows {
            row.groups().for_each(|(first, ..)| self.reached[first / GROUP] = true);
        }
        for group in (0..self.reached.len()).filter(|group| self.reached[*group]) {
            for block in self.blocks_at.group(group) {
                mark(&mut self.blocks, &mut self.uncounted, *block as usize);
            }
        }
        self.shots += volley.len() as u64;
        self.count();
    }
}

/// Which blocks have shares at the receivers of each group of a row.
struct BlocksAt {
    /// Where the blocks of each group begin, and where the last ones end.
    starts: Vec<u32>,
    /// By group.
    blocks: Vec<u32>,
}

impl BlocksAt {
    fn new<L>(shares: &[ShareEnergy<L>], receivers: usize) -> Self {
        let place =
            |(index, share): (usize, &ShareEnergy<L>)| (share.receiver / GROUP, (index / BLOCK) as u32);
        let mut places: Vec<(usize, u32)> = shares.iter().enumerate().map(place).collect();
        places.sort_unstable();
        places.dedup();
        let groups = 0..=receivers.div_ceil(GROUP);
        let starts = groups.map(|group| places.partition_point(|place| place.0 < group) as u32).collect();
        Self { starts, blocks: places.into_iter().map(|(_, block)| block).collect() }
    }

    fn group(&self, group: usize) -> &[u32] {
        &self.blocks[self.starts[group] as usize..self.starts[group + 1] as usize]
    }
}

/// Marks the block of a share to be counted again.
fn has_changed<L>(blocks: &mut [Block<L>], uncounted: &mut Vec<usize>, share: ShareId) {
    mark(blocks, uncounted, share.index() / BLOCK);
}

fn mark<L>(blocks: &mut [Block<L>], uncounted: &mut Vec<usize>, block: usize) {
    if std::mem::replace(&mut blocks[block].is_counted, false) {
        uncounted.push(block);
    }
}
