//! The occluders' triangles behind a tree whose nodes have eight children.
//!
//! The binary tree that the builder makes, with its nodes taken together: a segment is tested against eight boxes in the
//! time of one.

use glam::DVec3;
use obvhs::bvh2::Bvh2;
use pulp::Simd;
use smallvec::SmallVec;

use super::OccluderPolygon;
use super::lanes::{LANES, Lanes, bits};
use super::packet::{Packet, Rounded, Sight};
use crate::geometry::PlaneId;

/// A part of the tree with at most this many triangles becomes one packet.
const LEAF: usize = LANES;

/// Part of the largest coordinate by which boxes are widened while a segment meets them: the segment's origin and the products
/// with the inverse of its direction are rounded to f32, which together moves a crossing by up to 12 x 2^-24 of that coordinate.
const SLACK: f32 = 16.0 / 16_777_216.0;

/// Triangles and the tree over them.
pub struct Tree {
    /// The first one is the root.
    nodes: Vec<Node>,
    packets: Vec<Packet>,
    /// Largest coordinate.
    largest: f32,
}

struct Node {
    /// Low and high coordinate of each child's box, for x, y and z; boxes of unused lanes are inside out.
    bounds: [[Lanes; 3]; 2],
    /// Numbers of nodes or packets.
    children: [u32; LANES],
    /// Which children are packets: the first child is the lowest bit.
    packets: u8,
}

impl Node {
    const EMPTY: Self = Self {
        bounds: [[Lanes([f32::INFINITY; LANES]); 3], [Lanes([f32::NEG_INFINITY; LANES]); 3]],
        children: [0; LANES],
        packets: 0,
    };
}

impl Tree {
    /// Takes over a binary tree whose leaves name polygons by their place.
    pub fn new(bvh: &Bvh2, largest: f32, polygons: &[OccluderPolygon]) -> Self {
        let mut tree = Self { nodes: vec![], packets: vec![], largest };
        if bvh.nodes.is_empty() {
            return tree;
        }
        let counts = triangle_counts(bvh, polygons);
        // Nodes of the binary tree whose wide node is still to be filled, with its place.
        let mut waiting = vec![(0_u32, 0_usize)];
        tree.nodes.push(Node::EMPTY);
        while let Some((root, place)) = waiting.pop() {
            let children = opened(bvh, root, &counts);
            for (lane, child) in children.into_iter().enumerate() {
                let node = &bvh.nodes[child as usize];
                let is_packet = counts[child as usize] as usize <= LEAF || node.is_leaf();
                let number = if is_packet {
                    tree.push_packets(bvh, child, polygons)
                } else {
                    tree.nodes.push(Node::EMPTY);
                    waiting.push((child, tree.nodes.len() - 1));
                    tree.nodes.len() as u32 - 1
                };
                let wide = &mut tree.nodes[place];
                wide.children[lane] = number;
                wide.packets |= u8::from(is_packet) << lane;
                let bounds = node.aabb();
                for axis in 0..3 {
                    wide.bounds[0][axis].0[lane] = bounds.min[axis];
                    wide.bounds[1][axis].0[lane] = bounds.max[axis];
                }
            }
        }
        tree
    }
}

impl Tree {
    /// Writes the triangles of a part of the binary tree; the number of the first packet.
    fn push_packets(&mut self, bvh: &Bvh2, root: u32, polygons: &[OccluderPolygon]) -> u32 {
        let first = self.packets.len() as u32;
        let mut all = SmallVec::<[_; LEAF]>::new();
        for node in below(bvh, root).into_iter().map(|index| &bvh.nodes[index as usize]) {
            if node.is_leaf() {
                let of_polygon = |polygon: u32| {
                    (0..polygons[polygon as usize].triangle_count()).map(move |place| (polygon, place))
                };
                all.extend((node.first_index..node.first_index + node.prim_count).flat_map(of_polygon));
            }
        }
        let chunks = all.chunks(LANES);
        let last = chunks.len() - 1;
        self.packets
            .extend(chunks.enumerate().map(|(index, chunk)| Packet::new(polygons, chunk, index < last)));
        first
    }

    /// Largest coordinate of the occluders, rounded.
    pub(super) fn largest(&self) -> f32 {
        self.largest
    }

    /// Does a triangle of the polygons, which are those of [`Self::new`], outside of these planes cross the segment, given
    /// by where it starts and its span? `clearance`: length at either end that does not count.
    #[inline(always)]
    pub(super) fn blocks<S: Simd>(
        &self,
        simd: S,
        polygons: &[OccluderPolygon],
        [from, span]: [DVec3; 2],
        clearance: f64,
        planes: [PlaneId; 2],
    ) -> bool {
        let rounded = Rounded::new(from, span, self.largest);
        let slab = Slab::new(&rounded);
        let sight = Sight::new(from, span, &rounded, clearance, planes, polygons);
        // Nodes with the children that are still to be looked at.
        let mut waiting = SmallVec::<[(u32, u8); 32]>::new();
        let mut current = 0_u32;
        loop {
            let node = &self.nodes[current as usize];
            let met = slab.meets(simd, node);
            let mut packets = met & node.packets;
            while packets != 0 {
                if self.is_blocked_by(simd, node.children[packets.trailing_zeros() as usize], &sight) {
                    return true;
                }
                packets &= packets - 1;
            }
            let mut nodes = met & !node.packets;
            if nodes == 0 {
                let Some(next) = waiting.pop() else { return false };
                (current, nodes) = next;
            }
            let next = self.nodes[current as usize].children[nodes.trailing_zeros() as usize];
            let others = nodes & (nodes - 1);
            if others != 0 {
                waiting.push((current, others));
            }
            current = next;
        }
    }

    /// Is the segment blocked by the packets that a child stands for?
    #[inline(always)]
    fn is_blocked_by<S: Simd>(&self, simd: S, child: u32, sight: &Sight<'_>) -> bool {
        for packet in &self.packets[child as usize..] {
            if packet.blocks(simd, sight) {
                return true;
            }
            if !packet.goes_on {
                break;
            }
        }
        false
    }
}

/// A segment, ready to meet boxes: each is the part of space between three pairs of planes.
struct Slab {
    /// For each axis which of a box's sides is met first.
    first: [usize; 3],
    inverse: [f32; 3],
    /// The origin, moved so that boxes come nearer and end farther than they do.
    origins: [[f32; 3]; 2],
}

impl Slab {
    #[inline(always)]
    fn new(segment: &Rounded) -> Self {
        let slack = SLACK * segment.reach;
        let Rounded { origin, inverse, .. } = *segment;
        let (mut first, mut origins) = ([0; 3], [origin; 2]);
        for axis in 0..3 {
            first[axis] = usize::from(inverse[axis].is_sign_negative());
            let slack = slack.copysign(inverse[axis]);
            origins[0][axis] = origin[axis] + slack;
            origins[1][axis] = origin[axis] - slack;
        }
        Self { first, inverse, origins }
    }

    /// Which of a node's boxes the segment may touch: the first child is the lowest bit.
    #[inline(always)]
    fn meets<S: Simd>(&self, simd: S, node: &Node) -> u8 {
        let mut met = 0;
        for part in 0..LANES / S::F32_LANES {
            let (mut near, mut far) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0));
            for axis in 0..3 {
                let inverse = simd.splat_f32s(self.inverse[axis]);
                let side = self.first[axis];
                let (first, last) = (&node.bounds[side][axis], &node.bounds[1 - side][axis]);
                let first = simd.sub_f32s(first.load::<S>(part), simd.splat_f32s(self.origins[0][axis]));
                let last = simd.sub_f32s(last.load::<S>(part), simd.splat_f32s(self.origins[1][axis]));
                near = simd.max_f32s(near, simd.mul_f32s(first, inverse));
                far = simd.min_f32s(far, simd.mul_f32s(last, inverse));
            }
            met |= bits(simd, simd.less_than_or_equal_f32s(near, far)) << (part * S::F32_LANES);
        }
        met
    }
}

/// All nodes of a part of a binary tree, parents first, in the order of the leaves.
fn below(bvh: &Bvh2, root: u32) -> Vec<u32> {
    let (mut found, mut waiting) = (vec![], vec![root]);
    while let Some(index) = waiting.pop() {
        found.push(index);
        let node = &bvh.nodes[index as usize];
        if !node.is_leaf() {
            waiting.extend([node.first_index + 1, node.first_index]);
        }
    }
    found
}

/// Number of triangles under each node of a binary tree.
fn triangle_counts(bvh: &Bvh2, polygons: &[OccluderPolygon]) -> Vec<u32> {
    let mut counts = vec![0; bvh.nodes.len()];
    for index in below(bvh, 0).into_iter().rev() {
        let node = &bvh.nodes[index as usize];
        let (first, count) = (node.first_index as usize, node.prim_count as usize);
        counts[index as usize] = if node.is_leaf() {
            polygons[first..first + count].iter().map(OccluderPolygon::triangle_count).sum()
        } else {
            counts[first] + counts[first + 1]
        };
    }
    counts
}

/// The up to eight nodes of a binary tree that take the place of the two below its root: those with the largest surface are
/// opened first, since they are met most often.
fn opened(bvh: &Bvh2, root: u32, counts: &[u32]) -> SmallVec<[u32; LANES]> {
    let can_open =
        |index: u32| !bvh.nodes[index as usize].is_leaf() && counts[index as usize] as usize > LEAF;
    let surface = |index: u32| bvh.nodes[index as usize].aabb().half_area();
    let mut nodes: SmallVec<[u32; LANES]> = SmallVec::from_slice(&[root]);
    while nodes.len() < LANES {
        let candidates = (0..nodes.len()).filter(|place| can_open(nodes[*place]));
        let largest = candidates.max_by(|a, b| surface(nodes[*a]).total_cmp(&surface(nodes[*b])));
        let Some(place) = largest else { break };
        let first = bvh.nodes[nodes[place] as usize].first_index;
        nodes[place] = first;
        nodes.push(first + 1);
    }
    nodes.sort_by(|a, b| surface(*b).total_cmp(&surface(*a)));
    nodes
}
