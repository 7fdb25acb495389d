//! The polygons of a shooter in a tree: those that lie and face together count as one from afar.

use std::ops::Range;

use super::bodies::bodies_of;
use crate::form_factor::{ClusterLanes, PolygonCluster, PreparedPolygon, ReceiverLanes};
use crate::geometry::{Bounds, ConvexPolygon};

/// Most polygons that are looked at one by one where they do not count as one.
const LEAF: usize = 2;

/// A polygon of a shooter, with its weights in `N` channels.
pub(super) struct Part<const N: usize> {
    pub(super) polygon: PreparedPolygon,
    pub(super) weights: [f64; N],
}

/// Polygons by body, and those of a body in a tree.
pub(super) struct PolygonTree<const N: usize> {
    parts: Vec<Part<N>>,
    /// Their numbers, those of a node side by side.
    order: Vec<usize>,
    /// Sum of the areas times all weights of those of a body in this order, up to each.
    ends: Vec<f64>,
    nodes: Vec<Node<N>>,
    /// Numbers of the nodes of whole bodies.
    roots: Vec<usize>,
}

/// Polygons of one body.
struct Node<const N: usize> {
    place: Place,
    cluster: PolygonCluster<N>,
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
    /// Sum of their areas times all weights.
    pub(super) shining: f64,
}

/// How some receivers see a place.
pub(super) enum Sight<'a, const N: usize> {
    /// Those that it counts as one to.
    AsOne(&'a ClusterLanes<N>),
    /// A polygon by itself, of those that have a bit here.
    Alone(&'a Part<N>, u32),
}

impl<const N: usize> Part<N> {
    /// Area times all weights.
    fn shining(&self) -> f64 {
        self.polygon.area() * self.weights.iter().sum::<f64>()
    }
}

impl<const N: usize> PolygonTree<N> {
    /// A tree of polygons with their weights.
    pub(super) fn new(polygons: Vec<(&ConvexPolygon, [f64; N])>) -> Self {
        let (polygons, weights): (Vec<&ConvexPolygon>, Vec<[f64; N]>) = polygons.into_iter().unzip();
        let bodies = bodies_of(&polygons);
        let part = |(polygon, weights): (&ConvexPolygon, [f64; N])| Part {
            polygon: PreparedPolygon::new(polygon),
            weights,
        };
        let mut order: Vec<usize> = (0..polygons.len()).collect();
        order.sort_by_key(|index| bodies[*index]);
        let parts = polygons.into_iter().zip(weights).map(part).collect();
        let mut tree = Self { parts, order, ends: vec![], nodes: vec![], roots: vec![] };
        let mut start = 0;
        while let Some(first) = tree.order.get(start) {
            let body = bodies[*first];
            let count = tree.order[start..].partition_point(|index| bodies[*index] == body);
            let root = tree.add(start..start + count, body);
            tree.roots.push(root);
            let mut end = 0.0;
            for at in start..start + count {
                end += tree.shining(at);
                tree.ends.push(end);
            }
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

    /// The polygon of some that is at this part, from 0 to 1, of their area times all weights.
    pub(super) fn choose(&self, range: &Range<usize>, part: f64) -> &Part<N> {
        if range.len() == 1 {
            return &self.parts[self.order[range.start]];
        }
        let ends = &self.ends[range.clone()];
        let own = |at: usize| ends[at] - self.shining(range.start + at);
        let wanted = own(0) + part * (ends[range.len() - 1] - own(0));
        let place = ends.partition_point(|end| *end <= wanted).min(range.len() - 1);
        &self.parts[self.order[range.start + place]]
    }

    /// Area times all weights of the polygon at this place of the order.
    fn shining(&self, at: usize) -> f64 {
        self.parts[self.order[at]].shining()
    }

    /// Adds a node of polygons, at least one; returns its number. Those before it are in the tree.
    fn add(&mut self, range: Range<usize>, body: usize) -> usize {
        let parts = self.order[range.clone()].iter().map(|index| &self.parts[*index]);
        let cluster = PolygonCluster::new(parts.map(|part| (&part.polygon, part.weights)));
        let is_narrow = cluster.is_narrow();
        let shining = range.clone().map(|at| self.shining(at)).sum();
        let number = self.nodes.len();
        let place = Place { range: range.clone(), body, shining };
        self.nodes.push(Node { place, cluster, halves: None });
        if range.len() > LEAF {
            let middle = range.start + split(&self.parts, &mut self.order[range.clone()], is_narrow);
            let halves = [range.start..middle, middle..range.end].map(|half| self.add(half, body));
            self.nodes[number].halves = Some(halves);
        }
        number
    }

    /// Shows what these receivers, the first `count` lanes, see to `see`, up to the relative error `tolerance`: places in an order that
    /// does not depend on the receivers. To be called under [`crate::simd::widest`].
    #[inline(always)]
    pub(super) fn look(
        &self,
        (receivers, count): (&ReceiverLanes, usize),
        tolerance: f64,
        mut see: impl FnMut(Place, Sight<N>),
    ) {
        let all = (1 << count) - 1;
        let mut open: Vec<(usize, u32)> = self.roots.iter().rev().map(|root| (*root, all)).collect();
        while let Some((number, looking)) = open.pop() {
            let Node { place, cluster, halves } = &self.nodes[number];
            let mut left = looking;
            if place.range.len() > 1 {
                let view = cluster.view_lanes(receivers, tolerance, looking);
                if view.as_one != 0 {
                    see(place.clone(), Sight::AsOne(&view));
                }
                left = view.open;
            }
            match halves {
                _ if left == 0 => {}
                Some([one, other]) => open.extend([(*other, left), (*one, left)]),
                None => {
                    for at in place.range.clone() {
                        let part = &self.parts[self.order[at]];
                        let alone = Place { range: at..at + 1, body: place.body, shining: part.shining() };
                        see(alone, Sight::Alone(part, left));
                    }
                }
            }
        }
    }
}

/// Puts the one half of these polygons before the other, which faces another way, or lies elsewhere where all face together; returns the
/// size of the first.
fn split<const N: usize>(parts: &[Part<N>], order: &mut [usize], is_narrow: bool) -> usize {
    let point = |index: usize| {
        let polygon = &parts[index].polygon;
        if is_narrow { polygon.centre() } else { polygon.normal() }
    };
    let bounds = Bounds::around(order.iter().map(|index| point(*index)));
    let axis = bounds.extent().max_position();
    let along = |index: usize| point(index)[axis];
    let half = order.len() / 2;
    // In the order of their numbers on both sides: what an unstable sort does with equal places may change.
    let halved = |order: &mut [usize]| {
        let by_place = |a: &usize, b: &usize| along(*a).total_cmp(&along(*b)).then(a.cmp(b));
        order.select_nth_unstable_by(half, by_place);
        order[..half].sort_unstable();
        order[half..].sort_unstable();
        half
    };
    if is_narrow {
        return halved(order);
    }
    let centre = bounds.centre()[axis];
    order.sort_by_key(|index| along(*index) > centre);
    let middle = order.partition_point(|index| along(*index) <= centre);
    // Normals so wide apart are not all on one side, unless they are no numbers.
    if (1..order.len()).contains(&middle) { middle } else { halved(order) }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::geometry::PlaneId;

    /// A panel of 8 x 8 tiles that faces up, with the tiles of one row without an area where `flat`.
    fn panel(flat: bool) -> Vec<ConvexPolygon> {
        let tile = |index: u32| {
            let corner = |[x, y]: [u32; 2]| {
                let y = if flat && index < 8 { 0 } else { index / 8 + y };
                DVec3::new(f64::from(index % 8 + x), f64::from(y), 0.0)
            };
            let corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(corner).to_vec();
            ConvexPolygon { plane: PlaneId(0), corners }
        };
        (0..64).map(tile).collect()
    }

    /// The ranges that a receiver at this height over the panel sees.
    fn places(polygons: &[ConvexPolygon], height: f64) -> Vec<Range<usize>> {
        let tree = PolygonTree::new(polygons.iter().map(|polygon| (polygon, [1.0])).collect());
        let receivers = ReceiverLanes::new([(DVec3::new(4.0, 4.0, height), DVec3::NEG_Z)]);
        let mut places = vec![];
        tree.look((&receivers, 1), 3e-3, |place, sight| {
            match sight {
                Sight::AsOne(view) => assert_eq!((view.as_one, view.factors[1..].iter().sum()), (1, 0.0)),
                Sight::Alone(part, looking) => assert_eq!((part.weights, looking), ([1.0], 1)),
            }
            let own: f64 = place.range.clone().map(|at| tree.shining(at)).sum();
            assert_eq!(place.shining, own);
            places.push(place.range);
        });
        places
    }

    #[test]
    fn every_polygon_is_in_one_place_and_from_afar_there_are_few() {
        for (height, most) in [(0.1, 64), (60.0, 16), (300.0, 1)] {
            let places = places(&panel(false), height);
            assert!(places.len() <= most, "{height}: {places:?}");
            assert_eq!(places.iter().flat_map(Clone::clone).collect::<Vec<_>>(), (0..64).collect::<Vec<_>>());
        }
        assert!(places(&panel(false), -300.0).is_empty());
    }

    #[test]
    fn polygons_without_an_area_harm_no_others() {
        let seen = places(&panel(true), 300.0);
        assert!(!seen.is_empty() && seen.len() < 40, "{seen:?}");
        let tree = PolygonTree::new(panel(true)[..8].iter().map(|polygon| (polygon, [1.0])).collect());
        assert_eq!((tree.len(), tree.bodies()), (8, 1));
    }

    /// A polygon that is twice as bright is chosen twice as often.
    #[test]
    fn polygons_are_chosen_by_what_they_emit() {
        let polygons = panel(false);
        let weight = |index: usize| f64::from(1 + index as u32 % 2);
        let tree =
            PolygonTree::new((0..).map(weight).zip(&polygons).map(|(weight, own)| (own, [weight])).collect());
        for range in [0..64, 24..32, 63..64] {
            let all: f64 = range.clone().map(|at| tree.shining(at)).sum();
            let draws = 9600;
            let mut found = vec![0.0; 64];
            for draw in 0..draws {
                let chosen = tree.choose(&range, (f64::from(draw) + 0.5) / f64::from(draws));
                let at = range
                    .clone()
                    .find(|at| tree.parts[tree.order[*at]].polygon.centre() == chosen.polygon.centre());
                found[at.unwrap()] += 1.0;
            }
            for at in range {
                let wanted = tree.shining(at) / all * f64::from(draws);
                assert!((found[at] - wanted).abs() <= 1.0, "{at}: {} times, not {wanted}", found[at]);
            }
        }
    }
}
