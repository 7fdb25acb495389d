//! Building the tree: the binary tree that the builder makes, with its nodes taken together.

use glam::DVec3;
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use smallvec::SmallVec;

use super::lanes::LANES;
use super::node::Node;
use super::packet::Packet;
use crate::geometry::{ConvexPolygon, PlaneId};
use crate::hierarchy::PaddedBox;

/// A part of the tree with at most this many triangles becomes one packet.
const LEAF: usize = LANES;

/// Boxes are padded by this part of the scene's largest coordinate: rays are rounded to f32 when they meet a box, and must
/// not slip past one that their exact counterpart touches.
pub const PADDING: f64 = 1e-6;

/// The binary tree over some polygons, and their largest coordinate.
#[must_use]
pub fn binary_tree(polygons: &[ConvexPolygon]) -> (Bvh2, f64) {
    let corners = || polygons.iter().flat_map(|polygon| &polygon.corners);
    let largest = corners().map(|corner| corner.abs().max_element()).fold(0.0, f64::max);
    let boxes: Vec<PaddedBox> = polygons
        .iter()
        .map(|polygon| PaddedBox::around(polygon.corners.iter().copied(), largest * PADDING))
        .collect();
    (build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut Default::default()), largest)
}

/// Triangles and the tree over them.
pub struct Tree {
    /// The first one is the root.
    pub(super) nodes: Vec<Node>,
    pub(super) packets: Vec<Packet>,
    /// Largest coordinate.
    pub(super) largest: f32,
    /// Where the triangles are, in the order of their numbers: places of polygons, and of the triangle in its fan.
    places: Vec<(u32, u32)>,
}

/// A convex polygon, as triangles around its first corner.
pub trait Fan {
    /// The corners, three or more.
    fn corners(&self) -> &[DVec3];

    /// Plane of the polygon.
    fn plane(&self) -> PlaneId;

    /// Number of triangles.
    fn triangle_count(&self) -> u32 {
        self.corners().len() as u32 - 2
    }

    /// Corners of a triangle, by its place.
    fn triangle(&self, place: u32) -> [DVec3; 3] {
        let (corners, place) = (self.corners(), place as usize);
        [corners[0], corners[place + 1], corners[place + 2]]
    }
}

impl Fan for &ConvexPolygon {
    fn corners(&self) -> &[DVec3] {
        &self.corners
    }

    fn plane(&self) -> PlaneId {
        self.plane
    }
}

impl Tree {
    /// Takes over a binary tree whose leaves name polygons by their place. `largest`: their largest coordinate.
    #[must_use]
    pub fn new(bvh: &Bvh2, largest: f32, polygons: &[impl Fan]) -> Self {
        let mut tree = Self { nodes: vec![], packets: vec![], largest, places: vec![] };
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
    /// Where the triangles are, by their numbers: places of polygons, and of the triangle in its fan.
    #[must_use]
    pub fn places(&self) -> &[(u32, u32)] {
        &self.places
    }

    /// Largest coordinate of the triangles, rounded.
    #[must_use]
    pub fn largest(&self) -> f32 {
        self.largest
    }

    /// Writes the triangles of a part of the binary tree; the number of the first packet.
    fn push_packets(&mut self, bvh: &Bvh2, root: u32, polygons: &[impl Fan]) -> u32 {
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
        for (index, chunk) in chunks.enumerate() {
            let triangle = |(polygon, place): &(u32, u32)| {
                let polygon = &polygons[*polygon as usize];
                (polygon.triangle(*place), polygon.plane())
            };
            let triangles: SmallVec<[_; LANES]> = chunk.iter().map(triangle).collect();
            self.packets.push(Packet::new(&triangles, self.places.len() as u32, index < last));
            self.places.extend_from_slice(chunk);
        }
        first
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
fn triangle_counts(bvh: &Bvh2, polygons: &[impl Fan]) -> Vec<u32> {
    let mut counts = vec![0; bvh.nodes.len()];
    for index in below(bvh, 0).into_iter().rev() {
        let node = &bvh.nodes[index as usize];
        let (first, count) = (node.first_index as usize, node.prim_count as usize);
        counts[index as usize] = if node.is_leaf() {
            polygons[first..first + count].iter().map(Fan::triangle_count).sum()
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
