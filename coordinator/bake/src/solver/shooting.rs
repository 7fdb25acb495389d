//! Progressive refinement by shooting, driven by rows as they arrive.
//!
//! Shots are numbered. Shot n is chosen from the state after shot n - W, where W is the window, and applied after shot n - 1,
//! in any order of arrival: the result depends on W but not on workers or timing, while up to W rows are under way.
//!
//! A shot changes only the shares that its row reaches. Shares are therefore counted in blocks, each with its sums
//! and its brightest share: a shot visits what its row reaches and every block, not every share.

use std::collections::{HashMap, VecDeque};

use kernel::row::{GROUP, Row};

use super::cache::{RowCache, SetId};
use super::{Light, ShareEnergy, ShareId, add_row, interreflection_bound};

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
    /// Shots chosen and not yet applied, in order.
    chosen: VecDeque<ShareId>,
    is_chosen: Vec<bool>,
    /// Shares that have shot: to sweep over these later costs no more than another shot now.
    has_shot: Vec<bool>,
    blocks: Vec<Block<L>>,
    blocks_at: BlocksAt,
    /// Blocks to be counted again.
    uncounted: Vec<usize>,
    /// See [`interreflection_bound`].
    bound: L,
    window: usize,
    threshold: f64,
    shots: u64,
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
        let mut shooting = Self {
            blocks_at: BlocksAt::new(&shares, direct.len()),
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
            shares,
            window,
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

    /// Takes the row of a share, applies every shot that can now be applied, and chooses one more for each. Returns the
    /// shares whose rows are wanted next. A second copy of a row is ignored. Rows of applied shots go to the cache, in order.
    pub fn row_arrived(&mut self, share: ShareId, row: Row, cache: &mut RowCache) -> Vec<ShareId> {
        let mut wanted = vec![];
        if self.is_chosen[share.index()] {
            self.arrived.entry(share).or_insert(row);
        }
        while let Some(next) = self.chosen.front().copied() {
            if let Some(row) = self.arrived.remove(&next) {
                self.apply(next, &row);
                cache.keep(self.set, next, row);
            } else if let Some(row) = cache.row(self.set, next) {
                self.apply(next, row);
            } else {
                break;
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
        while let Some(block) = self.uncounted.pop() {
            self.blocks[block] = self.counted(block);
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

    /// Chooses the share with the largest unshot flux, unless too little is left, or only shares that have shot have much left:
    /// sweeps finish those faster than more shots would.
    fn choose(&mut self, cache: &RowCache, wanted: &mut Vec<ShareId>) -> bool {
        self.count();
        let [unshot, held, reflected] = self.fluxes();
        let missing = L::ratio(unshot, reflected) * self.bound;
        if missing.largest_channel() <= self.threshold
            || L::ratio(held, reflected).largest_channel() <= self.threshold
        {
            return false;
        }
        let brightest = self.blocks.iter().filter_map(|block| block.brightest);
        let best = brightest.reduce(|a, b| if b.1 > a.1 { b } else { a });
        let Some((index, _)) = best.filter(|(_, flux)| *flux > 0.0) else { return false };
        let share = ShareId(index as u32);
        self.chosen.push_back(share);
        self.is_chosen[index] = true;
        has_changed(&mut self.blocks, &mut self.uncounted, share);
        if cache.row(self.set, share).is_none() {
            wanted.push(share);
        }
        true
    }

    fn apply(&mut self, share: ShareId, row: &Row) {
        self.chosen.pop_front();
        let index = share.index();
        self.is_chosen[index] = false;
        self.has_shot[index] = true;
        has_changed(&mut self.blocks, &mut self.uncounted, share);
        let current = self.unshot(index);
        self.shot[index] += current;
        add_row(&mut self.irradiance, row, current);
        for (first, _, _) in row.groups() {
            for block in self.blocks_at.group(first / GROUP) {
                mark(&mut self.blocks, &mut self.uncounted, *block as usize);
            }
        }
        self.shots += 1;
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
