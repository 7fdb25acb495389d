//! The polygons of a shooter in a tree: those that lie and face together count as one from afar.

use std::ops::Range;

use super::bodies::bodies_of;
use crate::form_factor::{ClusterLanes, PolygonCluster, PreparedPolygon, ReceiverLanes};
use crate::geometry::{Bounds, ConvexPolygon};

/// Most polygons that are looked at one by one where they do not count as one.
const LEAF: usize = 2;

/// A polygon of a shooter.
struct Part {
    polygon: PreparedPolygon,
    weight: f64,
}

/// Polygons by body, and those of a body in a tree.
pub(super) struct PolygonTree {
    parts: Vec<Part>,
    /// Their numbers, those of a node side by side.
    order: Vec<usize>,
    /// Area times weight of all in this order before each, and of all.
    shining: Vec<f64>,
    nodes: Vec<Node>,
    /// Numbers of the nodes of whole bodies.
    roots: Vec<usize>,
}

/// Polygons of one body.
struct Node {
    place: Place,
    cluster: PolygonCluster,
    /// Numbers of its two parts; none of a leaf.
    halves: Option<[usize; 2]>,
}

/// Polygons that count as one.
#[derive(Clone)]
pub(super) struct Place {
    /// Which they are, in the order of the tree.
    pub(super) range: Range<usize>,
    /// The body that they belong to.
    pub(super) body: usize,
}

/// How some receivers see a place.
pub(super) enum Sight<'a> {
    /// Those that it counts as one to.
    AsOne(&'a ClusterLanes),
    /// A polygon with its weight by itself, of those that have a bit here.
    Alone(&'a PreparedPolygon, f64, u32),
}

impl PolygonTree {
    /// A tree of polygons with their weights.
    pub(super) fn new<'a>(polygons: impl Iterator<Item = (&'a ConvexPolygon, f64)>) -> Self {
        let (polygons, weights): (Vec<&ConvexPolygon>, Vec<f64>) = polygons.unzip();
        let bodies = bodies_of(&polygons);
        let part = |(polygon, weight): (&ConvexPolygon, f64)| Part {
            polygon: PreparedPolygon::new(polygon),
            weight,
        };
        let mut order: Vec<usize> = (0..polygons.len()).collect();
        order.sort_by_key(|index| bodies[*index]);
        let parts = polygons.into_iter().zip(weights).map(part).collect();
        let mut tree = Self { parts, order, shining: vec![0.0], nodes: vec![], roots: vec![] };
        let mut start = 0;
        while let Some(first) = tree.order.get(start) {
            let body = bodies[*first];
            let count = tree.order[start..].partition_point(|index| bodies[*index] == body);
            let root = tree.add(Place { range: start..start + count, body });
            tree.roots.push(root);
            start += count;
        }
        tree
    }

    /// Number of polygons.
    pub(super) fn len(&self) -> usize {
        self.parts.len()
    }

    /// Number of bodies.
    pub(super) fn bodies(&self) -> usize {
        self.roots.len()
    }

    /// Area times weight of some polygons.
    pub(super) fn shining(&self, range: &Range<usize>) -> f64 {
        self.shining[range.end] - self.shining[range.start]
    }

    /// The polygon of some that is at this part, from 0 to 1, of their area times weight.
    pub(super) fn choose(&self, range: &Range<usize>, part: f64) -> &PreparedPolygon {
        let wanted = self.shining[range.start] + part * self.shining(range);
        let ends = &self.shining[range.start + 1..=range.end];
        let place = ends.partition_point(|end| *end <= wanted).min(range.len() - 1);
        &self.parts[self.order[range.start + place]].polygon
    }

    /// Adds a node of polygons, at least one; returns its number. Those before it are in the tree.
    fn add(&mut self, place: Place) -> usize {
        let Place { range, body } = place.clone();
        let parts = self.order[range.clone()].iter().map(|index| &self.parts[*index]);
        let cluster = PolygonCluster::new(parts.map(|part| (&part.polygon, part.weight)));
        let is_narrow = cluster.is_narrow();
        let number = self.nodes.len();
        self.nodes.push(Node { place, cluster, halves: None });
        if range.len() > LEAF {
            let middle = range.start + split(&self.parts, &mut self.order[range.clone()], is_narrow);
            let halves =
                [range.start..middle, middle..range.end].map(|range| self.add(Place { range, body }));
            self.nodes[number].halves = Some(halves);
        } else {
            for index in &self.order[range] {
                let Part { polygon, weight } = &self.parts[*index];
                self.shining.push(self.shining[self.shining.len() - 1] + polygon.area() * weight);
            }
        }
        number
    }

    /// Shows what these receivers see to `see`, up to the relative error `tolerance`: places in an order that does not depend on the
    /// receivers. To be called under [`crate::simd::widest`].
    #[inline(always)]
    pub(super) fn look(&self, receivers: &ReceiverLanes, tolerance: f64, mut see: impl FnMut(Place, Sight)) {
        let mut open: Vec<(usize, u32)> = self.roots.iter().rev().map(|root| (*root, u32::MAX)).collect();
        while let Some((number, looking)) = open.pop() {
            let Node { place, cluster, halves } = &self.nodes[number];
            if place.range.len() == 1 {
                let Part { polygon, weight } = &self.parts[self.order[place.range.start]];
                see(place.clone(), Sight::Alone(polygon, *weight, looking));
                continue;
            }
            let view = cluster.view_lanes(receivers, tolerance, looking);
            if view.as_one != 0 {
                see(place.clone(), Sight::AsOne(&view));
            }
            if view.open == 0 {
                continue;
            }
            if let Some([one, other]) = halves {
                open.extend([(*other, view.open), (*one, view.open)]);
            } else {
                for at in place.range.clone() {
                    let Part { polygon, weight } = &self.parts[self.order[at]];
                    let alone = Place { range: at..at + 1, body: place.body };
                    see(alone, Sight::Alone(polygon, *weight, view.open));
                }
            }
        }
    }
}

/// Puts the one half of these polygons before the other, which faces another way, or lies elsewhere where all face together; returns the
/// size of the first.
fn split(parts: &[Part], order: &mut [usize], is_narrow: bool) -> usize {
    let point = |index: usize| {
        let polygon = &parts[index].polygon;
        if is_narrow { polygon.centre() } else { polygon.normal() }
    };
    let bounds = Bounds::around(order.iter().map(|index| point(*index)));
    let axis = bounds.extent().max_position();
    let along = |index: usize| point(index)[axis];
    let half = order.len() / 2;
    if is_narrow {
        order.select_nth_unstable_by(half, |a, b| along(*a).total_cmp(&along(*b)));
        return half;
    }
    let centre = bounds.centre()[axis];
    order.sort_unstable_by_key(|index| along(*index) > centre);
    let middle = order.partition_point(|index| along(*index) <= centre);
    // Normals so wide apart are not all on one side.
    if (1..order.len()).contains(&middle) { middle } else { half }
}
