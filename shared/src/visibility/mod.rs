//! How much of a form factor the occluders leave.
//!
//! Where few occluders stand between a point and a polygon, the visible part of the polygon is *computed*: the occluders are
//! cut out of it as the point sees them, and the rest is summed up exactly. Where there are many, rays sample it.

mod cut;
mod sample;
#[cfg(test)]
mod tests;

use glam::DVec3;

use crate::form_factor::{PreparedPolygon, View, contour};
use crate::geometry::Corners;
use crate::occluder::{Blockage, Bounds, Bundle, Occluder, Shaft};
use crate::protocol::RowStatistics;
use crate::replica::Receiver;
use crate::row::Precision;

pub use cut::cut;
pub use sample::pair_seed;

/// With more pieces than this, rays are cheaper than cutting on.
const MAX_PIECES: usize = 64;

/// When cutting leaves less than this part of a form factor, what is left are slivers of rounding error between the cuts: the
/// polygon is hidden. Without this, closed rooms would hang together by factors of 1e-23.
const ROUNDING: f64 = 1e-12;

/// With more candidates than this for a whole group, each of its shafts asks the BVH itself.
const MAX_CANDIDATES: usize = 96;

/// Computes visible form factors from groups of receivers to one polygon; keeps its buffers from pair to pair.
pub struct VisibilityKernel<'a> {
    occluder: &'a Occluder,
    precision: &'a Precision,
    candidates: Vec<u32>,
    blockers: Vec<Corners>,
    pieces: Vec<Corners>,
    scratch: Vec<Corners>,
}

impl<'a> VisibilityKernel<'a> {
    /// A kernel for these occluders.
    #[must_use]
    pub fn new(occluder: &'a Occluder, precision: &'a Precision) -> Self {
        Self { occluder, precision, candidates: vec![], blockers: vec![], pieces: vec![], scratch: vec![] }
    }

    /// Adds the visible form factor of each receiver's point to a polygon to `factors`. `seeds` are the pairs' own (see
    /// [`pair_seed`]): who computes a pair makes no difference. Groups pay when receivers lie close together.
    pub fn add_form_factors(
        &mut self,
        receivers: &[Receiver],
        polygon: &PreparedPolygon,
        seeds: impl Fn(usize) -> u32,
        factors: &mut [f64],
        statistics: &mut RowStatistics,
    ) {
        let mut is_prepared = false;
        for (index, (receiver, factor)) in receivers.iter().zip(factors).enumerate() {
            statistics.pairs += 1;
            if receiver.plane == polygon.plane() {
                continue;
            }
            let tolerance = self.precision.form_factor_error;
            let Some(view) = polygon.view(receiver.position, receiver.normal, tolerance) else { continue };
            statistics.factors += 1;
            statistics.factor_sum += view.factor;
            statistics.factor_error_sum += view.error;
            if !is_prepared {
                self.prepare(receivers, polygon);
                is_prepared = true;
            }
            *factor += self.visible(receiver, polygon, &view, seeds(index), statistics);
        }
    }

    fn prepare(&mut self, receivers: &[Receiver], polygon: &PreparedPolygon) {
        let group = Bounds::around(receivers.iter().map(|receiver| receiver.position));
        let target = Bounds::around(polygon.corners().iter().copied());
        self.occluder.candidates(&Bundle::new(&group, &target), &mut self.candidates);
    }

    fn visible(
        &mut self,
        receiver: &Receiver,
        polygon: &PreparedPolygon,
        view: &View,
        seed: u32,
        statistics: &mut RowStatistics,
    ) -> f64 {
        if self.candidates.is_empty() {
            return view.factor;
        }
        let planes = [receiver.plane, polygon.plane()];
        let shaft = Shaft::new(receiver.position, &view.corners, polygon.normal(), planes);
        let candidates = (self.candidates.len() <= MAX_CANDIDATES).then_some(self.candidates.as_slice());
        match self.occluder.collect_blockers(&shaft, candidates, &mut self.blockers) {
            Blockage::Free => return view.factor,
            Blockage::Full => {
                statistics.occluded_pairs += 1;
                return 0.0;
            }
            Blockage::Partial => {}
        }
        statistics.occluded_pairs += 1;
        if let Some(visible) = self.cut_factor(receiver.normal, view) {
            return visible;
        }
        statistics.sampled_pairs += 1;
        let blocked =
            |target: DVec3| self.occluder.blocks(receiver.position, receiver.position + target, planes);
        let rays = sample::ray_count(view.factor, self.precision);
        let sample =
            sample::sample_visibility(&view.corners, receiver.normal, polygon.normal(), rays, seed, blocked);
        statistics.rays += u64::from(sample.rays);
        statistics.sampling_variance += view.factor * view.factor * sample.variance;
        view.factor * sample.fraction
    }

    /// The form factor of what the blockers leave; `None` when they are too many, or it falls into too many pieces.
    fn cut_factor(&mut self, normal: DVec3, view: &View) -> Option<f64> {
        if self.blockers.len() > self.precision.exact_occluders as usize {
            return None;
        }
        self.pieces.clear();
        self.pieces.push(view.corners.clone());
        let mut touched = false;
        for blocker in &self.blockers {
            touched |= cut::cut(&mut self.pieces, blocker, &mut self.scratch);
            if self.pieces.is_empty() {
                return Some(0.0);
            }
            if self.pieces.len() > MAX_PIECES {
                return None;
            }
        }
        if !touched {
            return Some(view.factor);
        }
        let visible: f64 = self.pieces.iter().map(|piece| contour(normal, piece)).sum();
        Some(if visible <= ROUNDING * view.factor { 0.0 } else { visible.min(view.factor) })
    }
}
