//! Progressive refinement by shooting, driven by rows as they arrive.
//!
//! Shots are numbered. Shot n is chosen from the state after shot n - W, where W is the window, and applied after shot n - 1,
//! in whatever order the rows arrive: the answer depends on W but not on workers or timing, while up to W rows are under way.

use std::collections::VecDeque;

use super::{Light, ShareEnergy, ShareId, add_row, interreflection_bound};

/// The state of a shooting solution.
pub struct Shooting<L> {
    shares: Vec<ShareEnergy<L>>,
    /// Irradiance of every receiver: total energy.
    irradiance: Vec<L>,
    /// Radiosity that each share has shot.
    shot: Vec<L>,
    rows: Vec<Option<Vec<f32>>>,
    /// Shots that are chosen and not yet applied, in their order.
    chosen: VecDeque<ShareId>,
    is_chosen: Vec<bool>,
    /// Shares that have shot: their rows are certain to be there when the next shot is chosen, whatever has arrived early.
    has_shot: Vec<bool>,
    /// See [`interreflection_bound`].
    bound: L,
    window: usize,
    threshold: f64,
    shots: u64,
}

/// How far the solution has come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShootingProgress {
    /// Shots applied.
    pub shots: u64,
    /// Flux not yet shot, as a part of the flux first reflected plus that shot since.
    pub unshot: f64,
}

impl<L: Light> Shooting<L> {
    /// Starts from the irradiance that the light sources give every receiver. Shooting ends when the bound of what is missing
    /// is under `threshold`, relative to the reflected flux.
    #[must_use]
    pub fn new(shares: Vec<ShareEnergy<L>>, direct: Vec<L>, window: usize, threshold: f64) -> Self {
        Self {
            irradiance: direct,
            shot: vec![L::default(); shares.len()],
            rows: vec![None; shares.len()],
            chosen: VecDeque::new(),
            is_chosen: vec![false; shares.len()],
            has_shot: vec![false; shares.len()],
            bound: interreflection_bound(&shares),
            shares,
            window,
            threshold,
            shots: 0,
        }
    }

    /// Chooses the first shots. Returns the shares whose rows are wanted.
    pub fn start(&mut self) -> Vec<ShareId> {
        let mut wanted = vec![];
        while self.chosen.len() < self.window && self.choose(&mut wanted) {}
        wanted
    }

    /// Takes the row of a share, applies every shot that can now be applied, and chooses one more for each. Returns the
    /// shares whose rows are wanted next. A row that came before is ignored.
    pub fn row_arrived(&mut self, share: ShareId, row: Vec<f32>) -> Vec<ShareId> {
        let mut wanted = vec![];
        let place = &mut self.rows[share.index()];
        if place.is_none() {
            *place = Some(row);
        }
        while let Some(next) = self.chosen.front().copied()
            && self.rows[next.index()].is_some()
        {
            self.chosen.pop_front();
            self.is_chosen[next.index()] = false;
            self.apply(next);
            self.choose(&mut wanted);
        }
        wanted
    }

    /// True when no shot is chosen and none is worth choosing.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.chosen.is_empty()
    }

    /// How far the solution has come.
    #[must_use]
    pub fn progress(&self) -> ShootingProgress {
        let (unshot, reflected) = self.fluxes();
        ShootingProgress { shots: self.shots, unshot: L::ratio(unshot, reflected).largest_channel() }
    }

    /// Radiosity shot by each share, and the rows; a share that never shot has none.
    #[must_use]
    pub fn into_parts(self) -> (Vec<L>, Vec<Option<Vec<f32>>>) {
        (self.shot, self.rows)
    }

    fn unshot(&self, share: usize) -> L {
        let ShareEnergy { receiver, reflectance, .. } = self.shares[share];
        reflectance * self.irradiance[receiver] - self.shot[share]
    }

    /// Unshot flux, and reflected flux in all.
    fn fluxes(&self) -> (L, L) {
        let mut sums = (L::default(), L::default());
        for (index, share) in self.shares.iter().enumerate() {
            sums.0 += self.unshot(index) * share.area;
            sums.1 += share.reflectance * self.irradiance[share.receiver] * share.area;
        }
        sums
    }

    /// Chooses the share with the largest unshot flux, unless too little is left, or only shares that have shot have much left:
    /// with their rows at hand the sweeps finish faster than more shots would.
    fn choose(&mut self, wanted: &mut Vec<ShareId>) -> bool {
        let (unshot, reflected) = self.fluxes();
        let missing = L::ratio(unshot, reflected) * self.bound;
        if missing.largest_channel() <= self.threshold {
            return false;
        }
        let flux = |index: usize| self.unshot(index) * self.shares[index].area;
        let without_row =
            (0..self.shares.len()).filter(|index| !self.is_chosen[*index] && !self.has_shot[*index]);
        let held: L = without_row.map(flux).sum();
        if L::ratio(held, reflected).largest_channel() <= self.threshold {
            return false;
        }
        let candidates = (0..self.shares.len()).filter(|index| !self.is_chosen[*index]);
        let sum = |index: usize| flux(index).sum_of_channels();
        let best = candidates.map(|index| (index, sum(index))).reduce(|a, b| if b.1 > a.1 { b } else { a });
        let Some((index, _)) = best.filter(|(_, flux)| *flux > 0.0) else { return false };
        let share = ShareId(index as u32);
        self.chosen.push_back(share);
        self.is_chosen[index] = true;
        if self.rows[index].is_none() {
            wanted.push(share);
        }
        true
    }

    fn apply(&mut self, share: ShareId) {
        let current = self.unshot(share.index());
        self.shot[share.index()] += current;
        if let Some(row) = &self.rows[share.index()] {
            add_row(&mut self.irradiance, row, current);
        }
        self.has_shot[share.index()] = true;
        self.shots += 1;
    }
}
