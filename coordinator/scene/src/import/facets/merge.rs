//! Removes edges between coplanar polygons as long as the union stays convex: the greedy half of Hertel and Mehlhorn, "Fast
//! triangulation of simple polygons" (1983), on triangles that are given, and with polygons that share several edges.
//!
//! Corners are *straight* or real. Straight ones lie between two real ones, no farther from the line than the
//! rounding of the file explains; convexity is decided between real corners, so that neither rounding nor a finely divided concave arc can
//! deceive it.

use std::cmp::Reverse;

use glam::DVec3;

use super::joint::{NONE, may_join, twins};
use super::outline::{Outline, OutlineCorner};
use crate::import::primitives::VertexAttributes;
use crate::import::triangles::{Triangle, TriangleMesh};

/// Most straight corners in a row. Every merge looks at the whole row again, so without a bound long strips of triangles
/// would take quadratic time.
const LONGEST_RUN: usize = 256;

/// Passes over all edges. A merge may make room for one that failed before; grids need two or three.
const MOST_PASSES: usize = 32;

/// Cosine of the turn below which a corner is not straight, however near to the line it lies: polygons may be smaller than
/// the rounding.
const STRAIGHT_COSINE: f64 = 0.999;

/// Part of the tolerance up to which a bound on the bend decides: far enough below one that rounding does not.
const SURELY_FLAT: f64 = 0.5;

/// A polygon, kept at its root triangle.
#[derive(Clone, Copy)]
struct Polygon {
    area_vector: DVec3,
    /// Sum of its triangles' areas.
    area: f64,
    /// Sum of its triangles' areas times their centres.
    moment: DVec3,
    /// Number of real corners.
    corners: usize,
    /// No corner is farther from the plane through the centre than this.
    bend: f64,
    /// No corner is farther from the centre than this.
    radius: f64,
}

impl Polygon {
    fn centre(&self) -> DVec3 {
        self.moment / self.area
    }

    fn normal(&self) -> DVec3 {
        self.area_vector.normalize()
    }

    /// No corner is farther from this plane, nor from this centre.
    fn bounds(&self, centre: DVec3, normal: DVec3) -> (f64, f64) {
        let moved = self.centre() - centre;
        let bend = self.bend + self.radius * self.normal().distance(normal) + moved.dot(normal).abs();
        (bend, self.radius + moved.length())
    }
}

/// Polygons as loops of half-edges; see [`super::joint`] for their numbers.
pub(super) struct Merger<'a> {
    mesh: &'a TriangleMesh,
    tolerance: f64,
    twin: Vec<u32>,
    next: Vec<u32>,
    previous: Vec<u32>,
    /// Whether the half-edge starts at a straight corner.
    straight: Vec<bool>,
    /// Whether the half-edge is still on a border.
    alive: Vec<bool>,
    /// Union-find over triangles.
    parent: Vec<u32>,
    polygons: Vec<Polygon>,
    /// Number of merges so far, and at each root that number when its polygon became what it is.
    merges: u32,
    merged_at: Vec<u32>,
}

/// The edges that two polygons share: consecutive in both, given as the first polygon sees them.
struct Chain {
    /// Half-edges of the first polygon.
    edges: Vec<u32>,
    /// Half-edge of the first polygon before the chain, and after it.
    before: u32,
    after: u32,
    /// Half-edge of the second polygon that ends where the chain ends, and the one that starts where it starts.
    twin_before: u32,
    twin_after: u32,
}

impl<'a> Merger<'a> {
    /// Every triangle a polygon. Points may be `tolerance` away from the planes and lines that they are meant to lie on.
    pub(super) fn new(mesh: &'a TriangleMesh, tolerance: f64) -> Self {
        let halves = 3 * mesh.triangles.len() as u32;
        let polygon = |triangle: &Triangle| {
            let area = triangle.area_vector.length();
            let centre =
                triangle.points.iter().map(|&point| mesh.points[point as usize]).sum::<DVec3>() / 3.0;
            let radius = triangle
                .points
                .map(|point| mesh.points[point as usize].distance(centre))
                .into_iter()
                .fold(0.0, f64::max);
            Polygon {
                area_vector: triangle.area_vector,
                area,
                moment: area * centre,
                corners: 3,
                bend: 0.0,
                radius,
            }
        };
        Self {
            mesh,
            tolerance,
            twin: twins(mesh, tolerance),
            next: (0..halves).map(|half| half - half % 3 + (half + 1) % 3).collect(),
            previous: (0..halves).map(|half| half - half % 3 + (half + 2) % 3).collect(),
            straight: vec![false; halves as usize],
            alive: vec![true; halves as usize],
            parent: (0..mesh.triangles.len() as u32).collect(),
            polygons: mesh.triangles.iter().map(polygon).collect(),
            merges: 0,
            merged_at: vec![0; mesh.triangles.len()],
        }
    }

    /// Merges as long as anything can be merged, longest edges first: the diagonals of rectangles go before their sides.
    pub(super) fn run(mut self, attributes: &VertexAttributes) -> Vec<Outline> {
        let joinable = |half: &u32| {
            let twin = self.twin[*half as usize];
            twin != NONE && *half < twin && may_join(self.mesh, attributes, *half, twin)
        };
        let mut edges: Vec<u32> = (0..self.twin.len() as u32).filter(joinable).collect();
        // Edges that may not be joined must not become part of a chain either.
        let mut kept = vec![NONE; self.twin.len()];
        for &half in &edges {
            let twin = self.twin[half as usize];
            (kept[half as usize], kept[twin as usize]) = (twin, half);
        }
        self.twin = kept;
        edges.sort_by_cached_key(|&half| (self.rank(half), half));

        // With the number of merges when each was tried: between polygons that did not change since, it would fail again.
        let mut edges: Vec<(u32, Option<u32>)> = edges.into_iter().map(|half| (half, None)).collect();
        for _ in 0..MOST_PASSES {
            let before = self.merges;
            edges.retain_mut(|(half, tried)| {
                if !self.alive[*half as usize] {
                    return false;
                }
                let roots = [*half, self.twin[*half as usize]].map(|half| self.root(half / 3));
                let changed = |tried: u32| roots.iter().any(|&root| self.merged_at[root as usize] > tried);
                if tried.is_none_or(changed) && self.try_merge(*half, roots) {
                    return false;
                }
                *tried = Some(self.merges);
                self.alive[*half as usize]
            });
            if self.merges == before {
                break;
            }
        }
        self.outlines()
    }

    /// Longest edges first, and parallel ones together, so that a grid becomes strips and the strips one rectangle
    /// however its triangles are numbered. Lengths and directions are rounded, lest the rounding of the file decide.
    fn rank(&self, half: u32) -> (Reverse<u64>, [i64; 3]) {
        let edge = self.start(self.next[half as usize]) - self.start(half);
        // The leading bits of a positive float grow with it: 64 steps per octave, with powers of two inside a step.
        let length = (edge.length_squared().to_bits() + (1 << 45)) >> 46;
        let direction = edge.normalize().to_array().map(|axis| (axis * 16.0).round() as i64);
        (Reverse(length), direction.max(direction.map(|axis| -axis)))
    }

    /// Merges the polygons on both sides of an edge, of which these are the roots, if their union is flat and convex.
    fn try_merge(&mut self, half: u32, [root, twin_root]: [u32; 2]) -> bool {
        let twin = self.twin[half as usize];
        // A chain is tried once, from its first edge as the polygon of the lower root sees it.
        let first = if root < twin_root { half } else { twin };
        let Some(chain) = self.chain_from(first) else { return false };
        let (a, b) = (self.polygons[root as usize], self.polygons[twin_root as usize]);
        let union = Polygon {
            area_vector: a.area_vector + b.area_vector,
            area: a.area + b.area,
            moment: a.moment + b.moment,
            corners: a.corners + b.corners,
            bend: 0.0,
            radius: 0.0,
        };
        let (centre, normal) = (union.centre(), union.normal());
        let [(bend, radius), (twin_bend, twin_radius)] = [a, b].map(|part| part.bounds(centre, normal));
        let is_surely_flat = [bend, twin_bend].iter().all(|bend| *bend <= SURELY_FLAT * self.tolerance);
        let mut bend = bend.max(twin_bend);
        // Mostly the bound will do: walking both borders at every merge would take quadratic time.
        if !is_surely_flat {
            let Some(own) = self.bend(half, centre, normal) else { return false };
            let Some(other) = self.bend(twin, centre, normal) else { return false };
            bend = own.max(other);
        }
        let Some(straight_at_start) = self.corner_between(chain.before, chain.twin_after, normal) else {
            return false;
        };
        let Some(straight_at_end) = self.corner_between(chain.twin_before, chain.after, normal) else {
            return false;
        };
        let corners = union.corners - self.real_corners_on(&chain)
            + usize::from(!straight_at_start)
            + usize::from(!straight_at_end);
        if corners < 3 {
            return false;
        }
        self.splice(&chain, straight_at_start, straight_at_end);
        let (low, high) = (root.min(twin_root), root.max(twin_root));
        self.parent[high as usize] = low;
        self.polygons[low as usize] = Polygon { corners, bend, radius: radius.max(twin_radius), ..union };
        self.merges += 1;
        self.merged_at[low as usize] = self.merges;
        true
    }

    /// The shared edges from `first` on; `None` if they begin earlier.
    fn chain_from(&self, first: u32) -> Option<Chain> {
        let twin_of = |half: u32| self.twin[half as usize];
        let (before, twin_after) = (self.previous[first as usize], self.next[twin_of(first) as usize]);
        if twin_of(before) == twin_after {
            return None;
        }
        let mut edges = vec![first];
        loop {
            let last = edges[edges.len() - 1];
            let (after, twin_before) = (self.next[last as usize], self.previous[twin_of(last) as usize]);
            if twin_of(after) != twin_before || twin_before == NONE {
                return Some(Chain { edges, before, after, twin_before, twin_after });
            }
            edges.push(after);
        }
    }

    /// Real corners of both polygons on the chain, its ends included.
    fn real_corners_on(&self, chain: &Chain) -> usize {
        let starts = chain.edges.iter().chain([&chain.after, &chain.twin_after]);
        let twin_starts = chain.edges.iter().map(|&edge| &self.twin[edge as usize]);
        starts.chain(twin_starts).filter(|&&half| !self.straight[half as usize]).count()
    }

    /// The corner that forms where the half-edge `outgoing` comes to follow `incoming`: straight or not, `None` if the union
    /// would be concave there.
    fn corner_between(&self, incoming: u32, outgoing: u32, normal: DVec3) -> Option<bool> {
        // Next to a straight corner of one polygon the other one's angle can only be concave.
        if self.straight[outgoing as usize] || self.straight[self.next[incoming as usize] as usize] {
            return None;
        }
        let here = self.start(outgoing);
        let (mut back, mut ahead, mut between) = (incoming, self.next[outgoing as usize], 0);
        while self.straight[back as usize] {
            back = self.previous[back as usize];
            between += 1;
        }
        while self.straight[ahead as usize] {
            ahead = self.next[ahead as usize];
            between += 1;
        }
        let (from, to) = (self.start(back), self.start(ahead));
        let chord = to - from;
        let is_on_chord =
            |point: DVec3| (point - from).cross(chord).length() <= self.tolerance * chord.length();
        let (arriving, leaving) = (here - from, to - here);
        let runs_on = arriving.dot(leaving) > STRAIGHT_COSINE * arriving.length() * leaving.length();
        let stay_straight = || {
            let before =
                self.walk(self.next[back as usize]).take_while(|&half| half != self.next[incoming as usize]);
            let after = self.walk(self.next[outgoing as usize]).take_while(|&half| half != ahead);
            before.chain(after).all(|half| is_on_chord(self.start(half)))
        };
        if runs_on && between < LONGEST_RUN && is_on_chord(here) && stay_straight() {
            return Some(true);
        }
        let is_convex = arriving.cross(leaving).dot(normal) > 0.0;
        is_convex.then_some(false)
    }

    /// How far the border that `half` is part of bends from a plane; `None` where that is too far.
    fn bend(&self, half: u32, centre: DVec3, normal: DVec3) -> Option<f64> {
        self.border(half).try_fold(0.0, |most: f64, half| {
            let bend = (self.start(half) - centre).dot(normal).abs();
            (bend <= self.tolerance).then_some(most.max(bend))
        })
    }

    /// Makes one loop of two.
    fn splice(&mut self, chain: &Chain, straight_at_start: bool, straight_at_end: bool) {
        for &edge in &chain.edges {
            self.alive[edge as usize] = false;
            self.alive[self.twin[edge as usize] as usize] = false;
        }
        for (incoming, outgoing, straight) in [
            (chain.before, chain.twin_after, straight_at_start),
            (chain.twin_before, chain.after, straight_at_end),
        ] {
            self.next[incoming as usize] = outgoing;
            self.previous[outgoing as usize] = incoming;
            self.straight[outgoing as usize] = straight;
        }
    }

    fn outlines(mut self) -> Vec<Outline> {
        let mut outline_of_root = vec![NONE; self.parent.len()];
        let mut outlines: Vec<Outline> = Vec::new();
        for triangle in 0..self.parent.len() as u32 {
            let root = self.root(triangle) as usize;
            if outline_of_root[root] == NONE {
                outline_of_root[root] = outlines.len() as u32;
                let area_vector = self.polygons[root].area_vector;
                outlines.push(Outline { corners: Vec::new(), triangles: Vec::new(), area_vector });
            }
            let outline = &mut outlines[outline_of_root[root] as usize];
            outline.triangles.push(triangle);
            let on_border = (3 * triangle..3 * triangle + 3).find(|&half| self.alive[half as usize]);
            if let (true, Some(half)) = (outline.corners.is_empty(), on_border) {
                let corner = |half: u32| OutlineCorner {
                    triangle: half / 3,
                    corner: half as usize % 3,
                    straight: self.straight[half as usize],
                };
                outline.corners = self.border(half).map(corner).collect();
            }
        }
        outlines
    }

    /// The half-edges of a border, once round.
    fn border(&self, first: u32) -> impl Iterator<Item = u32> {
        std::iter::successors(Some(first), move |&half| {
            let next = self.next[half as usize];
            (next != first).then_some(next)
        })
    }

    /// The half-edges of a border from one on, round and round.
    fn walk(&self, first: u32) -> impl Iterator<Item = u32> {
        std::iter::successors(Some(first), move |&half| Some(self.next[half as usize]))
    }

    /// Where a half-edge starts.
    fn start(&self, half: u32) -> DVec3 {
        let triangle = &self.mesh.triangles[half as usize / 3];
        self.mesh.points[triangle.points[half as usize % 3] as usize]
    }

    /// Root triangle of a triangle's polygon.
    fn root(&mut self, mut triangle: u32) -> u32 {
        while self.parent[triangle as usize] != triangle {
            let grandparent = self.parent[self.parent[triangle as usize] as usize];
            self.parent[triangle as usize] = grandparent;
            triangle = grandparent;
        }
        triangle
    }
}
