//! The visible part of form factors.
//!
//! With few occluders between a point and a polygon, visibility is *computed*: the occluders are cut out of the polygon as the point
//! sees them, and the rest is integrated exactly. With many it is sampled with rays.
//!
//! Three cases are decided for a whole group of receivers: all face away from the polygon, nothing lies between, or one occluder
//! hides it from all.

mod cut;
mod groups;
mod many;
mod partial;
mod ratio;
mod sample;
mod sky;
#[cfg(test)]
mod tests;
mod transparent;

use crate::form_factor::PreparedPolygon;
use crate::geometry::Bounds;
use crate::geometry::lanes::{LANES, Mask, Vectors};
use crate::messages::RowStatistics;
use crate::occluder::{Blocker, CandidateList, Identity, Occluder, Pyramids, Shaft};
use crate::row::Precision;
use crate::simd::widest;

pub use cut::{Cone, Cones, Pieces, cut};
pub use groups::{Node, ReceiverGroups, ReceiverLanes};
pub use many::{FactorsOfMany, MANY_POLYGONS, factors_of_many, least_rays};
use partial::PartialView;
pub use sample::pair_seed;
pub use sky::sky_factor;
pub use transparent::{Transmitted, TransparentOccluders};

/// A group that crosses a polygon's plane by less than this part of its size does so by rounding.
const BACK_FACE: f64 = 1e-9;

/// Level of the groups that share a candidate list: 4,096 receivers.
const COLLECTING: usize = 4;

/// Level of the groups that have the occluders near them found in it: 256 receivers.
const APPROACHING: usize = 2;

/// Computes visible form factors. Keeps its buffers between calls.
pub struct VisibilityKernel<'a> {
    occluder: &'a Occluder,
    precision: &'a Precision,
    /// Occluders between the polygon and some thousand receivers.
    candidates: CandidateList,
    /// Whether any of them is near.
    has_near: bool,
    /// Around the polygon.
    target: Bounds,
    /// Those of them that may matter to a group.
    parts: Vec<u32>,
    /// What some of them leave of the polygon for some receivers.
    partly: Vec<(u32, Mask)>,
    /// How many of them reach into the view of each receiver.
    reaching: [u32; LANES],
    /// What filled the last pyramids: likely to fill the next.
    last_filler: Option<Identity>,
    /// Its part, where it stands before the polygon at hand.
    likely_filler: Option<u32>,
    pyramids: Pyramids,
    partial: PartialView,
    found: Vec<u32>,
    stop: Stop<'a>,
}

/// Whether the work at hand is not wanted any more: it may end then, and what it has is worth nothing.
pub type Stop<'a> = &'a dyn Fn() -> bool;

/// The seed of each receiver's rays, by its index.
pub type Seeds<'a> = &'a dyn Fn(usize) -> u32;

impl<'a> VisibilityKernel<'a> {
    /// A kernel for this scene.
    #[must_use]
    pub fn new(occluder: &'a Occluder, precision: &'a Precision) -> Self {
        Self {
            stop: &|| false,
            occluder,
            precision,
            candidates: CandidateList::default(),
            has_near: false,
            target: Bounds::EMPTY,
            parts: vec![],
            partly: vec![],
            reaching: [0; LANES],
            last_filler: None,
            likely_filler: None,
            pyramids: Pyramids::default(),
            partial: PartialView::default(),
            found: vec![],
        }
    }

    /// The same, asking before each few receivers whether to stop.
    #[must_use]
    pub fn until(self, stop: Stop<'a>) -> Self {
        Self { stop, ..self }
    }

    /// Adds the visible form factors from receivers to a polygon to `factors`. `seeds` gives the seed of each receiver's rays.
    /// The result for a receiver does not depend on the others.
    pub fn add_form_factors(
        &mut self,
        groups: &ReceiverGroups,
        polygon: &PreparedPolygon,
        seeds: Seeds,
        factors: &mut [f64],
        statistics: &mut RowStatistics,
    ) {
        statistics.pairs += groups.receivers().len() as u64;
        self.target = Bounds::around(polygon.corners());
        let mut around = None;
        let mut stack = vec![(groups.top(), 0)];
        while let Some((level, index)) = stack.pop() {
            let Some(node) = groups.node(level, index) else { continue };
            if faces_away(node, polygon) {
                continue;
            }
            if level > 0 && self.is_hidden(node, polygon) {
                // Those that look away are among them: all have one reason, and need no other.
                statistics.factors += u64::from(node.count);
                statistics.occluded_pairs += u64::from(node.count);
                continue;
            }
            if level == groups.top().min(COLLECTING) {
                around = Some(&node.bounds);
            }
            if level == groups.top().min(APPROACHING) {
                // Only where not all of them are hidden.
                if let Some(bounds) = around.take() {
                    self.candidates.collect(self.occluder, bounds, polygon);
                    self.likely_filler = self.last_filler.and_then(|filler| self.candidates.part_of(filler));
                }
                self.has_near = self.candidates.approach(&Shaft::new(&node.bounds, &self.target, 0.0));
            }
            if level > 0 {
                stack.extend(groups.children(level, index).rev().map(|child| (level - 1, child)));
                continue;
            }
            if (self.stop)() {
                return;
            }
            let first = index * LANES;
            let seed = |lane: usize| seeds(first + lane);
            let end = factors.len().min(first + LANES);
            self.add_group(groups.lanes(index), node, polygon, &seed, &mut factors[first..end], statistics);
        }
    }

    /// True where one occluder stands between a whole group and the polygon.
    fn is_hidden(&mut self, node: &Node, polygon: &PreparedPolygon) -> bool {
        // The back-face check: what crosses the plane by rounding does not matter.
        let nearest = -node.bounds.farthest_along(-polygon.normal());
        let over_plane = nearest - polygon.normal().dot(polygon.centre());
        if self.occluder.is_empty() || over_plane < -BACK_FACE * node.bounds.diagonal() {
            return false;
        }
        self.occluder.near_segment(node.bounds.centre(), polygon.centre(), &mut self.found);
        if self.found.is_empty() {
            return false;
        }
        let apexes = node.bounds.corners();
        self.pyramids.aim(&Vectors::repeated(&apexes), polygon.corners());
        self.occluder.cuts_off(&self.found, &self.pyramids, &node.planes, &apexes, polygon)
    }

    /// Adds the factors of one group of receivers.
    fn add_group(
        &mut self,
        lanes: &ReceiverLanes,
        node: &Node,
        polygon: &PreparedPolygon,
        seeds: Seeds,
        factors: &mut [f64],
        statistics: &mut RowStatistics,
    ) {
        let tolerance = self.precision.form_factor_error;
        let view = widest(
            #[inline(always)]
            || lanes.view(polygon, tolerance),
        );
        let mut open: Mask = 0;
        for lane in 0..factors.len() {
            if view.factors[lane] > 0.0 {
                open |= 1 << lane;
                statistics.factors += 1;
                statistics.factor_sum += view.factors[lane];
                statistics.factor_error_sum += view.errors[lane];
            }
        }
        if open == 0 {
            return;
        }
        let hidden = self.block(lanes, node, polygon, open, statistics);
        for (lane, factor) in
            factors.iter_mut().enumerate().filter(|(lane, _)| (open & !hidden) >> lane & 1 == 1)
        {
            let (position, plane) = (lanes.positions.get(lane), lanes.planes[lane]);
            let receiver = (position, lanes.seeing.normal(lane), plane);
            if self.reaching[lane] > self.precision.exact_occluders {
                statistics.occluded_pairs += 1;
                let (unoccluded, seed) = (view.factors[lane], seeds(lane));
                *factor += sample::sampled_factor(
                    self.occluder,
                    self.precision,
                    receiver,
                    polygon,
                    unoccluded,
                    seed,
                    statistics,
                );
                continue;
            }
            self.partial.clear();
            for (part, _) in self.partly.iter().filter(|(_, mask)| mask >> lane & 1 == 1) {
                let add = |blocker: Blocker<'_>| self.partial.add(blocker, position);
                self.candidates.for_each_blocker(self.occluder, *part, (position, plane), add);
            }
            if self.partial.is_free() {
                *factor += view.factors[lane];
                continue;
            }
            statistics.occluded_pairs += 1;
            *factor += self.partial.factor(
                self.occluder,
                self.precision,
                receiver,
                polygon,
                view.factors[lane],
                seeds(lane),
                statistics,
            );
        }
    }

    /// Finds what blocks the pyramids of these receivers: those whose pyramid is filled, and the parts that reach into others, up to
    /// one more than visibility is computed with.
    fn block(
        &mut self,
        lanes: &ReceiverLanes,
        node: &Node,
        polygon: &PreparedPolygon,
        wanted: Mask,
        statistics: &mut RowStatistics,
    ) -> Mask {
        self.partly.clear();
        self.reaching = [0; LANES];
        if !self.has_near {
            return 0;
        }
        self.pyramids.aim(&lanes.positions, polygon.corners());
        let (mut open, mut hidden) = (wanted, 0);
        if let Some(likely) = self.likely_filler {
            hidden =
                open & self.candidates.reach(self.occluder, likely, &self.pyramids, &lanes.planes).wholly;
            open &= !hidden;
        }
        if open != 0 {
            let horizon = node.normal.map(|normal| (normal, -node.bounds.farthest_along(-normal)));
            self.candidates.narrow(
                self.occluder,
                &Shaft::new(&node.bounds, &self.target, 0.0),
                horizon,
                &mut self.parts,
            );
        }
        for at in 0..self.parts.len() {
            if open == 0 {
                break;
            }
            let part = self.parts[at];
            let reach = self.candidates.reach(self.occluder, part, &self.pyramids, &lanes.planes);
            if reach.wholly & open != 0 {
                self.likely_filler = Some(part);
                self.last_filler = Some(self.candidates.identity(part));
                hidden |= reach.wholly & open;
                open &= !reach.wholly;
            }
            let partly = reach.partly & open;
            if partly != 0 {
                self.partly.push((part, partly));
                for lane in (0..LANES).filter(|lane| partly >> lane & 1 == 1) {
                    self.reaching[lane] += 1;
                    if self.reaching[lane] > self.precision.exact_occluders {
                        open &= !(1 << lane);
                    }
                }
            }
        }
        statistics.occluded_pairs += u64::from(hidden.count_ones());
        hidden
    }
}

/// True where no receiver of a group sees the polygon's front above its horizon.
fn faces_away(node: &Node, polygon: &PreparedPolygon) -> bool {
    let farthest = node.bounds.farthest_along(polygon.normal());
    if node.planes == [polygon.plane()] || farthest <= polygon.normal().dot(polygon.centre()) {
        return true;
    }
    node.normal.is_some_and(|normal| {
        let lowest = -node.bounds.farthest_along(-normal);
        polygon.corners().iter().all(|corner| normal.dot(*corner) <= lowest)
    })
}
