//! The way down the hierarchy: which pairs of elements see each other at all, and how.
//!
//! A pair of clusters is done with where one lies behind the other, or where a single convex polygon hides one from the other.
//! Else the larger of both is divided. The polygons that can stand between go down with it, so that fewer and fewer are left to
//! look at; where none is left, all pairs below see each other unhindered.

use kernel::geometry::Bounds;
use kernel::occluder::Occluder;
use kernel::row::Precision;
use kernel::visibility::VisibilityKernel;

use super::element::Element;
use super::exchange::unoccluded;
use super::sampling::{Sampler, Sampling};
use super::shaft::{Between, Blocker, box_corners};
use super::tree::Tree;

/// The exchange area of two elements that see each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElementPair {
    /// Index of an element.
    pub from: u32,
    /// Index of another, larger.
    pub to: u32,
    /// Exchange area: area of either times its form factor to the other, in squared frame units.
    pub area: f64,
    /// Variance of that.
    pub variance: f64,
}

/// How many pairs of elements were decided in which way.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct PairCounts {
    /// All pairs.
    pub all: u64,
    /// Turned away from each other, or in one plane.
    pub turned_away: u64,
    /// Hidden from each other: proven, except those under `found_hidden`.
    pub hidden: u64,
    /// Hidden according to sample points.
    pub found_hidden: u64,
    /// Nothing stands between: known up to rounding, or 1e-7 of themselves.
    pub exact: u64,
    /// Partly hidden: estimated.
    pub estimated: u64,
}

impl std::ops::AddAssign for PairCounts {
    fn add_assign(&mut self, other: Self) {
        self.all += other.all;
        self.turned_away += other.turned_away;
        self.hidden += other.hidden;
        self.found_hidden += other.found_hidden;
        self.exact += other.exact;
        self.estimated += other.estimated;
    }
}

/// What a part of the way gave.
#[derive(Default)]
pub struct Found {
    /// Pairs that see each other.
    pub pairs: Vec<ElementPair>,
    /// Counts.
    pub counts: PairCounts,
}

/// Two clusters to look at, and what can stand between them.
pub struct Task {
    clusters: [usize; 2],
    candidates: Vec<u32>,
}

/// All that the way needs; the same for all threads.
pub struct Way<'a> {
    /// The elements.
    pub elements: &'a [Element],
    /// The hierarchy over them.
    pub tree: &'a Tree,
    /// What can block.
    pub blockers: &'a [Blocker],
    /// The same, for points and rays.
    pub occluder: &'a Occluder,
    /// How exactly visibility is computed.
    pub precision: &'a Precision,
    /// How partly hidden pairs are estimated.
    pub sampling: Sampling,
}

/// What is known of two clusters.
enum Verdict {
    /// Nothing goes from one to the other.
    Nothing,
    /// They have to be divided.
    Divide,
}

impl Way<'_> {
    /// About this many tasks or more, which together are the whole way. Always the same ones.
    pub fn tasks(&self, count: usize, found: &mut Found) -> Vec<Task> {
        let Some(root) = self.tree.root() else { return vec![] };
        let all = (0..self.blockers.len() as u32).collect();
        let mut tasks = vec![Task { clusters: [root, root], candidates: all }];
        loop {
            let before = tasks.len();
            if before >= count {
                return tasks;
            }
            tasks = tasks.into_iter().flat_map(|task| self.divided(task, found)).collect();
            if tasks.len() <= before {
                return tasks;
            }
        }
    }

    /// A task's parts; itself where it has none.
    fn divided(&self, task: Task, found: &mut Found) -> Vec<Task> {
        let [a, b] = task.clusters;
        if self.tree.clusters[a].count() * self.tree.clusters[b].count() == 1 {
            return vec![task];
        }
        let mut candidates = vec![];
        if a != b {
            if let Verdict::Nothing = self.judge(a, b, &task.candidates, &mut candidates, &mut found.counts) {
                return vec![];
            }
        } else {
            candidates = task.candidates;
        }
        let part = |clusters| Task { clusters, candidates: candidates.clone() };
        self.parts(a, b).into_iter().map(part).collect()
    }

    fn parts(&self, a: usize, b: usize) -> smallvec::SmallVec<[[usize; 2]; 3]> {
        let halves = |index: usize| self.tree.clusters[index].halves;
        let mut parts = smallvec::SmallVec::new();
        if a == b {
            if let Some([first, second]) = halves(a) {
                parts.extend([[first, first], [first, second], [second, second]]);
            }
            return parts;
        }
        let size = |index: usize| self.tree.clusters[index].size();
        match (halves(a), halves(b)) {
            (Some([first, second]), None) => parts.extend([[first, b], [second, b]]),
            (None, Some([first, second])) => parts.extend([[a, first], [a, second]]),
            (Some([first, second]), Some(_)) if size(a) >= size(b) => parts.extend([[first, b], [second, b]]),
            (Some(_), Some([first, second])) => parts.extend([[a, first], [a, second]]),
            (None, None) => {}
        }
        parts
    }

    /// Goes all the way down.
    pub fn run(&self, task: &Task) -> Found {
        let mut found = Found::default();
        let mut sampler = Sampler::new(VisibilityKernel::new(self.occluder, self.precision), self.sampling);
        let mut lists = vec![task.candidates.clone()];
        self.descend(task.clusters, 0, &mut lists, &mut sampler, &mut found);
        found
    }

    /// `lists[depth]`: what can stand between the two.
    fn descend(
        &self,
        [a, b]: [usize; 2],
        depth: usize,
        lists: &mut Vec<Vec<u32>>,
        sampler: &mut Sampler<'_>,
        found: &mut Found,
    ) {
        let clusters = &self.tree.clusters;
        if a == b && clusters[a].plane.is_some() {
            let count = clusters[a].count() as u64;
            found.counts.all += count * (count - 1) / 2;
            found.counts.turned_away += count * (count - 1) / 2;
            return;
        }
        if lists.len() < depth + 2 {
            lists.push(vec![]);
        }
        let (above, below) = lists.split_at_mut(depth + 1);
        let (candidates, own) = (&above[depth], &mut below[0]);
        if a == b {
            own.clone_from(candidates);
        } else if clusters[a].count() == 1 && clusters[b].count() == 1 {
            let [a, b] = [a, b].map(|index| self.tree.order[clusters[index].elements.start]);
            self.meet(a.min(b), a.max(b), candidates, sampler, found);
            return;
        } else if let Verdict::Nothing = self.judge(a, b, candidates, own, &mut found.counts) {
            return;
        }
        for part in self.parts(a, b) {
            self.descend(part, depth + 1, lists, sampler, found);
        }
    }

    fn judge(
        &self,
        a: usize,
        b: usize,
        candidates: &[u32],
        own: &mut Vec<u32>,
        counts: &mut PairCounts,
    ) -> Verdict {
        let [first, second] = [a, b].map(|index| &self.tree.clusters[index]);
        let pairs = (first.count() * second.count()) as u64;
        if first.is_behind(second) || second.is_behind(first) {
            counts.all += pairs;
            counts.turned_away += pairs;
            return Verdict::Nothing;
        }
        own.clear();
        if candidates.is_empty() {
            return Verdict::Divide;
        }
        let shaft = Between::new([first.bounds, second.bounds], [first.plane, second.plane]);
        own.extend(candidates.iter().filter(|index| shaft.may_hold(&self.blockers[**index as usize])));
        let corners = [first, second].map(|cluster| box_corners(cluster.bounds));
        let hides = |index: &u32| {
            let blocker = &self.blockers[*index as usize];
            let touch = [first, second].map(|cluster| cluster.is_across(blocker.normal()));
            blocker.hides(&corners[0], &corners[1], touch)
        };
        if own.iter().any(hides) {
            counts.all += pairs;
            counts.hidden += pairs;
            return Verdict::Nothing;
        }
        Verdict::Divide
    }

    /// Two elements.
    fn meet(&self, a: u32, b: u32, candidates: &[u32], sampler: &mut Sampler<'_>, found: &mut Found) {
        let [first, second] = [a, b].map(|index| &self.elements[index as usize]);
        let counts = &mut found.counts;
        counts.all += 1;
        if first.is_behind(second) || second.is_behind(first) {
            counts.turned_away += 1;
            return;
        }
        let own = self.between(first, second, candidates);
        let hides = |blocker: &&Blocker| blocker.hides(first.corners(), second.corners(), [true; 2]);
        if own.iter().any(hides) {
            counts.hidden += 1;
            return;
        }
        let whole = unoccluded(first, second);
        if whole.area <= NOTHING * first.area.min(second.area) {
            counts.turned_away += 1;
            return;
        }
        let (area, variance) = if own.is_empty() {
            counts.exact += 1;
            (whole.area, whole.error * whole.error)
        } else {
            let (area, variance) = sampler.estimate((a, first), (b, second), whole);
            if area <= NOTHING * first.area.min(second.area) {
                counts.found_hidden += 1;
                counts.hidden += 1;
                return;
            }
            counts.estimated += 1;
            (area, variance)
        };
        found.pairs.push(ElementPair { from: a, to: b, area, variance });
    }

    fn between(&self, a: &Element, b: &Element, candidates: &[u32]) -> smallvec::SmallVec<[&Blocker; 16]> {
        if candidates.is_empty() {
            return smallvec::SmallVec::new();
        }
        let bounds = [a, b].map(|element| Bounds::around(element.corners()));
        let mut shaft = Between::new(bounds, [Some(a.plane()), Some(b.plane())]);
        if !(a.fills_box && b.fills_box) {
            shaft.tighten(a.corners(), b.corners());
        }
        let blockers = candidates.iter().map(|index| &self.blockers[*index as usize]);
        blockers.filter(|blocker| shaft.may_hold(blocker)).collect()
    }
}

/// Form factors below this are rounding.
const NOTHING: f64 = 1e-14;
