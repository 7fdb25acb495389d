//! The hierarchy over all elements: clusters of elements that look the same way and lie together.

use glam::DVec3;
use kernel::geometry::{Bounds, PlaneId};

use super::element::{Element, IN_PLANE};

/// Clusters whose normals differ by more than this are divided by their normals, others by place.
const WIDEST_SPREAD: f64 = 0.5;

/// Some elements, or one.
pub struct Cluster {
    /// Box around the elements.
    pub bounds: Bounds,
    /// A direction near to all normals.
    normal: DVec3,
    /// Largest distance of a unit normal from that.
    spread: f64,
    /// The plane that all elements lie in, if it is one.
    pub plane: Option<PlaneId>,
    /// The elements: a range of [`Tree::order`].
    pub elements: std::ops::Range<usize>,
    /// The two halves; none for a single element.
    pub halves: Option<[usize; 2]>,
}

/// All clusters; the root, if there is one, is the last.
pub struct Tree {
    /// The clusters, halves before wholes.
    pub clusters: Vec<Cluster>,
    /// Indices of elements, those of each cluster together.
    pub order: Vec<u32>,
}

impl Cluster {
    /// Number of elements.
    pub fn count(&self) -> usize {
        self.elements.len()
    }

    /// Largest extent.
    pub fn size(&self) -> f64 {
        self.bounds.extent().max_element()
    }

    /// True where no element of this cluster can lie in a plane with this normal.
    pub fn is_across(&self, normal: DVec3) -> bool {
        self.normal.dot(normal).abs() + self.spread < 1.0 - 1e-3
    }

    /// True where nothing of another cluster lies before any element of this one.
    pub fn is_behind(&self, other: &Self) -> bool {
        if self.plane.is_some() && self.plane == other.plane {
            return true;
        }
        let (own, other) = (self.bounds, other.bounds);
        let offset = (other.low + other.high - own.low - own.high) * 0.5;
        let reach = (other.high - other.low + own.high - own.low) * 0.5;
        let highest = self.normal.dot(offset) + self.normal.abs().dot(reach);
        highest + self.spread * (offset.abs() + reach).length() <= IN_PLANE
    }
}

impl Tree {
    /// Builds the hierarchy.
    pub fn new(elements: &[Element]) -> Self {
        let mut tree = Self { clusters: vec![], order: (0..elements.len() as u32).collect() };
        let centres: Vec<DVec3> = elements.iter().map(|element| element.polygon.corner_mean()).collect();
        if !elements.is_empty() {
            tree.build(elements, &centres, 0..elements.len());
        }
        tree
    }

    /// Index of the cluster of all elements.
    pub fn root(&self) -> Option<usize> {
        self.clusters.len().checked_sub(1)
    }

    fn build(&mut self, elements: &[Element], centres: &[DVec3], range: std::ops::Range<usize>) -> usize {
        let mut cluster = around(elements, &self.order[range.clone()], range.clone());
        if range.len() > 1 {
            let normals = cluster.spread > WIDEST_SPREAD;
            let key = |index: &u32| {
                let index = *index as usize;
                if normals { elements[index].normal } else { centres[index] }
            };
            let order = &mut self.order[range.clone()];
            let middle = range.start + divide(order, key, normals);
            cluster.halves = Some([
                self.build(elements, centres, range.start..middle),
                self.build(elements, centres, middle..range.end),
            ]);
        }
        self.clusters.push(cluster);
        self.clusters.len() - 1
    }
}

fn around(elements: &[Element], order: &[u32], range: std::ops::Range<usize>) -> Cluster {
    let members = || order.iter().map(|index| &elements[*index as usize]);
    let corners = members().flat_map(|element| element.corners());
    let normal = members().map(|element| element.normal).sum::<DVec3>().normalize_or(DVec3::Z);
    let plane = elements[order[0] as usize].plane();
    Cluster {
        bounds: Bounds::around(corners),
        normal,
        spread: members().map(|element| element.normal.distance(normal)).fold(0.0, f64::max),
        plane: members().all(|element| element.plane() == plane).then_some(plane),
        elements: range,
        halves: None,
    }
}

/// Sorts into two halves along the longest axis of the keys: at the middle of their extent, or with as many on both sides.
/// Returns how many the first half has, at least one and not all.
fn divide(order: &mut [u32], key: impl Fn(&u32) -> DVec3, at_middle: bool) -> usize {
    let Bounds { low, high } = Bounds::around(order.iter().map(&key));
    let axis = (high - low).max_position();
    order.sort_by(|a, b| key(a)[axis].total_cmp(&key(b)[axis]).then(a.cmp(b)));
    let middle = 0.5 * (low[axis] + high[axis]);
    let first =
        if at_middle { order.partition_point(|index| key(index)[axis] < middle) } else { order.len() / 2 };
    first.clamp(1, order.len() - 1)
}
