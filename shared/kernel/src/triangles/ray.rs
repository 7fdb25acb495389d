//! Triangles along a ray, nearest first.

use glam::DVec3;
use pulp::{Simd, WithSimd};

use super::lanes::{LANES, Lanes};
use super::node::{Node, Slab};
use super::packet::Packet;
use super::sight::{Rounded, Sight};
use super::tree::Tree;
use crate::geometry::PlaneId;

/// How far a ray goes, in largest coordinates: what it meets is at most two away along each axis, which is 2 sqrt(3).
const BEHIND_ALL: f32 = 4.0;

/// Part by which numbers are moved before they are rounded to f32, to be on the safe side.
const MARGIN: f64 = 1e-6;

/// A ray, and what becomes of triangles that it may meet: as work for [`super::with_lanes`] it goes through them, roughly the
/// nearest first.
pub struct Ray<'a, F> {
    /// The triangles.
    pub tree: &'a Tree,
    /// Where it starts.
    pub origin: &'a DVec3,
    /// A unit vector.
    pub direction: &'a DVec3,
    /// Nothing is looked for before this distance.
    pub from: f64,
    /// Triangles in this plane do not count.
    pub own: PlaneId,
    /// Takes the number of a triangle that the ray may meet; the distance beyond which nothing is looked for any more.
    pub meet: F,
}

impl<F: FnMut(u32) -> f64> WithSimd for Ray<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let tree = self.tree;
        if tree.nodes.is_empty() {
            return;
        }
        let rounded = Rounded::new(*self.origin, *self.direction, tree.largest, 0.0);
        if !rounded.is_finite() {
            return;
        }
        let slab = Slab::new(&rounded);
        let mut course = Course::new(&rounded);
        // The least number above zero: the bits of positive numbers are in their order.
        let start = f32::max((self.from * (1.0 - MARGIN)) as f32, f32::MIN_POSITIVE);
        let mut waiting = Waiting::new();
        let mut nears = Lanes([0.0; LANES]);
        let mut node = &tree.nodes[0];
        loop {
            let met = slab.meets(simd, node, [start, course.end], &mut nears);
            let mut next = waiting.nearest_of(node, met, &nears);
            node = loop {
                let Some(Child(child)) = next else { return };
                if f32::from_bits((child >> 32) as u32) <= course.end {
                    let number = (child as u32 >> 1) as usize;
                    if child & 1 == 0 {
                        break &tree.nodes[number];
                    }
                    for packet in &tree.packets[number..] {
                        self.meet_packet(simd, packet, &mut course);
                        if !packet.goes_on {
                            break;
                        }
                    }
                }
                next = waiting.pop();
            };
        }
    }
}

impl<F: FnMut(u32) -> f64> Ray<'_, F> {
    #[inline(always)]
    fn meet_packet<S: Simd>(&mut self, simd: S, packet: &Packet, course: &mut Course) {
        for part in 0..LANES / S::F32_LANES {
            let (mut left, _) = packet.crossed(simd, part, &course.sight);
            while left != 0 {
                let lane = part * S::F32_LANES + left.trailing_zeros() as usize;
                left &= left - 1;
                if packet.planes[lane] != self.own {
                    course.end_at((self.meet)(packet.first + lane as u32));
                }
            }
        }
    }
}

/// A ray up to where it ends so far.
struct Course {
    /// Up to there.
    sight: Sight,
    /// Part of the direction along the axis along which it is longest.
    along: f32,
    /// Distance.
    end: f32,
}

impl Course {
    #[inline(always)]
    fn new(rounded: &Rounded) -> Self {
        let mut sight = Sight::new(rounded);
        let along = sight.depth;
        let end = BEHIND_ALL * rounded.reach;
        sight.depth = end * along;
        Self { sight, along, end }
    }

    /// Makes it shorter.
    #[inline(always)]
    fn end_at(&mut self, distance: f64) {
        let end = (distance * (1.0 + MARGIN)) as f32;
        if end < self.end {
            self.end = end;
            self.sight.depth = end * self.along;
        }
    }
}

/// A child that is met: the bits of the distance at which the ray enters it, its number, and whether it is a packet.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Child(u64);

/// Children that are still to be looked at. Those of a node are in order, the nearest last.
struct Waiting {
    first: [Child; FIRST],
    /// Those beyond.
    others: Vec<Child>,
    count: usize,
}

/// Number of waiting children that are kept at hand: trees seldom ask for more.
const FIRST: usize = 64;

impl Waiting {
    #[inline(always)]
    fn new() -> Self {
        Self { first: [Child(0); FIRST], others: vec![], count: 0 }
    }

    /// The nearest of a node's children that are met, or else the last one that waits; the others wait.
    #[inline(always)]
    fn nearest_of(&mut self, node: &Node, mut met: u8, nears: &Lanes) -> Option<Child> {
        if met == 0 {
            return self.pop();
        }
        let mut nearest = node.child(met.trailing_zeros() as usize, nears);
        met &= met - 1;
        let bottom = self.count;
        while met != 0 {
            let mut child = node.child(met.trailing_zeros() as usize, nears);
            met &= met - 1;
            if child < nearest {
                (child, nearest) = (nearest, child);
            }
            self.insert(child, bottom);
        }
        Some(nearest)
    }

    #[inline(always)]
    fn insert(&mut self, child: Child, bottom: usize) {
        let mut place = self.count;
        if place >= FIRST {
            self.others.push(child);
            return;
        }
        while place > bottom && self.first[place - 1] < child {
            self.first[place] = self.first[place - 1];
            place -= 1;
        }
        self.first[place] = child;
        self.count += 1;
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<Child> {
        let Some(last) = self.count.checked_sub(1) else { return self.others.pop() };
        self.count = last;
        self.first.get(last).copied()
    }
}

impl Node {
    #[inline(always)]
    fn child(&self, lane: usize, nears: &Lanes) -> Child {
        let number = self.children[lane] << 1 | u32::from(self.packets >> lane & 1);
        Child(u64::from(nears.0[lane].to_bits()) << 32 | u64::from(number))
    }
}
