use glam::DVec3;
use kernel::geometry::area_vector;
use kernel::replica::{Receiver, Receivers};
use rayon::prelude::*;

use super::clusters::{ClusterLimits, clusters};
use super::{Mesh, Patch, PatchId, Surroundings, Vertex, VertexId, WELD, surroundings};

/// How far a receiver is moved from its vertex into the surface around it, relative to that surface's width. A vertex on a
/// room's edge lies in the planes of both walls and sees nothing of the other; a hair inside, half of its hemisphere is the
/// other wall, and the form factors of a closed room sum to 1.
pub const INWARD: f64 = 1e-3;

/// The same in frame units, at least, on the outline of a flat surface: beside a thing that stands there, rounded coordinates may put
/// a vertex inside of it.
const LEAST_INWARD: f64 = 5.0 * WELD;

/// On an outline the way inward is longer than this, relative to the root of the area around; elsewhere it cancels out, but for rounding.
const ON_OUTLINE: f64 = 0.05;

/// A vertex under an edge that hovers is moved by this much of its height to either side: right below it, half of the hemisphere is hidden,
/// as it is nowhere around.
const CLEAR: f64 = 2.0;

/// Receivers are moved by this part of the leaf or of the surface's width at most.
const MOST_INWARD: f64 = 0.5;

/// Sines below this are rounding.
const ROUNDING: f64 = 1e-9;

/// Vertices as receivers.
pub struct VertexReceivers {
    /// The receivers, by rising index of the first vertex of each.
    pub receivers: Receivers,
    /// The surroundings of each receiver.
    pub around: Vec<Surroundings>,
}

/// The vertices from `first` on as receivers.
#[must_use]
pub fn receivers(mesh: &Mesh, first: VertexId) -> VertexReceivers {
    let around = surroundings(mesh, first);
    let vertices = &mesh.vertices[first.index()..];
    let with_around = || vertices.par_iter().zip(&around).with_min_len(1024);
    let outlines: Vec<Option<DVec3>> =
        with_around().map(|(vertex, around)| way_from_outline(vertex, around)).collect();
    let parts = with_around().zip(reaches(mesh, first, &outlines));
    let receivers = parts.map(|((vertex, around), reach)| receiver_at(vertex, around, reach)).collect();
    VertexReceivers { receivers: Receivers { first_key: u64::from(first.0), receivers }, around }
}

/// All vertices as receivers, and the index of the receiver of each; `None` where each has its own. The vertices of a cluster of small
/// leaves share one in its middle: light hardly varies over it.
#[must_use]
pub fn shared_receivers(mesh: &Mesh, limits: Option<ClusterLimits>) -> (VertexReceivers, Option<Vec<u32>>) {
    let own = receivers(mesh, VertexId(0));
    let Some(limits) = limits else { return (own, None) };
    let middle_of_leaf = clusters(mesh, limits);
    let mut middles: Vec<Option<PatchId>> = vec![None; mesh.vertices.len()];
    for (id, patch) in mesh.leaves() {
        if let Some(middle) = middle_of_leaf[id.index()] {
            patch.corners.iter().for_each(|corner| middles[corner.index()] = Some(middle));
        }
    }
    let mut of_vertices = Vec::with_capacity(middles.len());
    // Of the cluster with each leaf in its middle.
    let mut first_of: Vec<Option<u32>> = vec![None; mesh.patches.len()];
    let (mut receivers, mut around) = (vec![], vec![]);
    for ((own, surroundings), middle) in own.receivers.receivers.iter().zip(own.around).zip(middles) {
        let next = around.len() as u32;
        let receiver = middle.map_or(next, |leaf| *first_of[leaf.index()].get_or_insert(next));
        of_vertices.push(receiver);
        if receiver < next {
            let shared: &mut Surroundings = &mut around[receiver as usize];
            shared.area += surroundings.area;
        } else {
            around.push(surroundings);
            receivers.push(middle.map_or(*own, |leaf| receiver_in(mesh, leaf)));
        }
    }
    let shared = VertexReceivers { receivers: Receivers { first_key: 0, receivers }, around };
    (shared, first_of.iter().any(Option::is_some).then_some(of_vertices))
}

/// The centre of a flat leaf as a receiver.
fn receiver_in(mesh: &Mesh, leaf: PatchId) -> Receiver {
    let Vertex { normal, plane, .. } = mesh.vertices[mesh.patch(leaf).corners[0].index()];
    Receiver { position: mesh.centre(leaf), normal, plane }
}

/// A vertex as a receiver; on an outline the leaf reaches that far inward.
fn receiver_at(vertex: &Vertex, around: &Surroundings, reach: Option<f64>) -> Receiver {
    // Facets around a smooth vertex lie under its horizon or rise over it: start above them all.
    let lift = if vertex.smooth { vertex.normal * around.area.sqrt() } else { DVec3::ZERO };
    let way = way_in(vertex, around);
    let width = way.length();
    let shift = match (vertex.hovering, reach) {
        (Some(height), _) => (CLEAR * height).clamp(INWARD * width, MOST_INWARD * width),
        (None, Some(reach)) => (INWARD * width).max(LEAST_INWARD).min(MOST_INWARD * reach),
        (None, None) => INWARD * width,
    };
    Receiver {
        position: vertex.position + way.normalize_or_zero() * shift + lift * INWARD,
        normal: vertex.normal,
        plane: vertex.plane,
    }
}

/// The direction from a vertex into the surface around it, about as long as that is wide.
fn way_in(vertex: &Vertex, around: &Surroundings) -> DVec3 {
    around.inward - vertex.normal * vertex.normal.dot(around.inward)
}

/// The way inward of a vertex on the outline of a flat surface, under no edge that hovers.
fn way_from_outline(vertex: &Vertex, around: &Surroundings) -> Option<DVec3> {
    let way = way_in(vertex, around);
    let is_on_outline = way.length() > ON_OUTLINE * around.area.sqrt();
    (is_on_outline && !vertex.smooth && vertex.hovering.is_none()).then_some(way)
}

/// How far the way into the surface leads through the leaf that it enters, at each vertex from `first` on; `None` where it enters none,
/// or there is no way.
fn reaches(mesh: &Mesh, first: VertexId, ways: &[Option<DVec3>]) -> Vec<Option<f64>> {
    let of_leaf = |(id, _): (PatchId, &Patch)| {
        let corners = mesh.patch(id).corners.iter().enumerate();
        corners.filter_map(move |(corner, vertex)| {
            let index = vertex.index().checked_sub(first.index())?;
            Some((index, reach(mesh, id, corner, ways[index]?)?))
        })
    };
    let found: Vec<(usize, f64)> = mesh.par_leaves().flat_map_iter(of_leaf).collect();
    let mut reaches: Vec<Option<f64>> = vec![None; ways.len()];
    for (index, reach) in found {
        reaches[index] = Some(reaches[index].map_or(reach, |other| other.max(reach)));
    }
    reaches
}

/// How far a leaf reaches from one of its corners along a direction; `None` where that does not lead into it.
fn reach(mesh: &Mesh, id: PatchId, corner: usize, way: DVec3) -> Option<f64> {
    let corners = mesh.corners(id);
    let normal = area_vector(&corners).try_normalize()?;
    // Rounding turns small leaves a little.
    let direction = (way - normal * normal.dot(way)).try_normalize()?;
    let mut reach = f64::INFINITY;
    for (k, from) in corners.iter().enumerate() {
        let next = (k + 1) % corners.len();
        let inward = normal.cross(corners[next] - from).normalize_or_zero();
        let nearing = -inward.dot(direction);
        if k == corner || next == corner {
            if nearing > ROUNDING {
                return None;
            }
        } else if nearing > ROUNDING {
            reach = reach.min(inward.dot(corners[corner] - from) / nearing);
        }
    }
    reach.is_finite().then_some(reach)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{facet, scene};

    const EXTENT: f64 = 1000.0;

    #[test]
    fn corners_of_a_small_leaf_share_a_receiver() {
        let floor =
            facet(0, &[[0.0, 0.0, 0.0], [0.0, 0.0, EXTENT], [EXTENT, 0.0, EXTENT], [EXTENT, 0.0, 0.0]]);
        let crumb = facet(1, &[[5.0, 5.0, 5.0], [5.0, 5.0, 8.0], [8.0, 5.0, 8.0]]);
        let scene = scene(vec![vec![floor], vec![crumb]], vec![]);
        let mesh = Mesh::new(&scene, EXTENT, EXTENT, 0, &[]);
        let (alone, of_vertices) = shared_receivers(&mesh, None);
        assert_eq!(of_vertices, None);
        assert_eq!(alone.receivers.receivers.len(), mesh.vertices.len());

        let (some, of_vertices) = shared_receivers(&mesh, Some(ClusterLimits { width: 5.0, angle: 0.1 }));
        let of_vertices = of_vertices.unwrap();
        let of_surface = |surface: u32| -> Vec<u32> {
            let leaves = mesh.leaves().filter(|(_, patch)| patch.surface == surface);
            let mut all: Vec<u32> = leaves
                .flat_map(|(_, patch)| &patch.corners)
                .map(|vertex| of_vertices[vertex.index()])
                .collect();
            all.sort_unstable();
            all.dedup();
            all
        };
        assert_eq!(of_surface(0).len(), 4);
        let [shared] = of_surface(1)[..] else { panic!("{:?}", of_surface(1)) };
        let place = some.receivers.receivers[shared as usize].position;
        assert!(place.distance(DVec3::new(6.0, 5.0, 7.0)) < 1e-9, "{place}");
        assert!((some.around[shared as usize].area - 4.5).abs() < 1e-9);
        assert_eq!(some.receivers.receivers.len(), 5);
    }

    /// Else every second vertex around a knob on a wall lies within the knob, and a sliver's vertices on its other side.
    #[test]
    fn receivers_leave_the_outline_but_not_the_surface() {
        let rectangle = |width: f64, height: f64| {
            let corners = [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]];
            let scene = scene(vec![vec![facet(0, &corners.map(|[x, y]| [x, y, 0.0]))]], vec![]);
            let mesh = Mesh::new(&scene, EXTENT, EXTENT, 0, &[]);
            receivers(&mesh, VertexId(0)).receivers.receivers
        };
        let inside = |at: DVec3, width: f64, height: f64| at.x.min(width - at.x).min(at.y).min(height - at.y);
        let small = rectangle(0.1, 0.1);
        assert!(small.iter().all(|at| inside(at.position, 0.1, 0.1) > 0.5 * LEAST_INWARD), "{small:?}");
        let thin = 0.5 * LEAST_INWARD;
        let sliver = rectangle(EXTENT, thin);
        assert!(sliver.iter().all(|at| inside(at.position, EXTENT, thin) > 0.0), "{sliver:?}");
    }

    /// Right below a picture's edge half of the hemisphere is hidden, which is so nowhere around.
    #[test]
    fn vertices_under_a_hovering_edge_are_moved_to_either_side_of_it() {
        let square = |plane, least: f64, most: f64, height| {
            let corners = [[least, least], [most, least], [most, most], [least, most]];
            facet(plane, &corners.map(|[x, y]| [x, y, height]))
        };
        let height = 1.0;
        let scene =
            scene(vec![vec![square(0, 0.0, EXTENT, 0.0)], vec![square(1, 400.0, 600.0, height)]], vec![]);
        let mesh = Mesh::new(&scene, EXTENT, 200.0, 0, &[]);
        // Distance from the outline, negative inside.
        let outside = |at: DVec3| (at - DVec3::new(500.0, 500.0, at.z)).abs().max_element() - 100.0;
        let all = receivers(&mesh, VertexId(0)).receivers.receivers;
        let on_wall = mesh.vertices.iter().zip(&all).filter(|(vertex, _)| vertex.position.z == 0.0);
        let moved: Vec<f64> = on_wall
            .filter(|(vertex, _)| outside(vertex.position).abs() < 1e-6)
            .map(|(_, receiver)| outside(receiver.position))
            .collect();
        assert!(moved.iter().any(|outside| *outside > 0.0) && moved.iter().any(|outside| *outside < 0.0));
        assert!(moved.iter().all(|outside| outside.abs() > height), "{moved:?}");
        assert!(moved.iter().all(|outside| outside.abs() < 3.0 * height), "{moved:?}");
    }
}
