//! Leaves with all corners inside of other bodies, and a part between them in the open: a bar of a window that ends in its frame.
//!
//! Light between corners is interpolated, and that of these corners is none: the whole leaf would be dark. It is divided until one of its
//! corners is in the open; refinement then finds the rest.

use glam::DVec3;
use kernel::geometry::PlaneId;
use kernel::hemisphere::{SeenPolygons, directions};
use rayon::prelude::*;

use super::{INWARD, Mesh, PatchId};
use scene::{Scene, Surface};

/// Size of the smallest leaves that are looked at, relative to the longest edge of a patch.
const SMALLEST: f64 = 1.0 / 32.0;

/// Rays of a point. One that escapes, or meets a side that is lit, tells that it is in the open.
const RAYS: u32 = 16;

/// Places that are looked at between the corners of a leaf, as parts of the way from its centre to each of them,
const TO_CORNERS: [f64; 4] = [0.2, 0.4, 0.6, 0.8];

/// and to the middle of each edge.
const TO_MIDDLES: [f64; 2] = [0.45, 0.9];

/// How often a leaf is divided at most.
const ROUNDS: usize = 3;

/// The opaque surfaces of a scene, with the backs that are lit.
struct Bodies(SeenPolygons);

impl Bodies {
    fn new(scene: &Scene) -> Self {
        let opaque = scene.surfaces.iter().filter(|surface| surface.opacity >= 1.0);
        let lit = opaque.flat_map(Surface::lit_facets).map(|(_, facet)| facet.polygon());
        Self(SeenPolygons::new(&lit.collect::<Vec<_>>(), &[]))
    }

    /// Whether a point of a plane, seen from the side of a normal, lies inside of a body: nothing but dark backs is seen from it.
    fn bury(&self, point: DVec3, normal: DVec3, plane: PlaneId) -> bool {
        directions(normal, RAYS, 0).all(|(_, direction)| {
            self.0.nearest(point, direction, 0.0, plane).is_some_and(|hit| !hit.is_front)
        })
    }

    /// Whether all corners of a leaf are inside of bodies, and something between them is not.
    fn bury_corners(&self, scene: &Scene, mesh: &Mesh, leaf: PatchId) -> bool {
        let patch = mesh.patch(leaf);
        let facet = &scene.surfaces[patch.surface as usize].facets[patch.facet as usize];
        let buries = |point: DVec3| self.bury(point, facet.normal, facet.plane);
        let (corners, centre) = (mesh.corners(leaf), mesh.centre(leaf));
        if !corners.iter().all(|corner| buries(corner.lerp(centre, INWARD))) {
            return false;
        }
        let next = corners.iter().cycle().skip(1);
        let mut between = corners.iter().zip(next).flat_map(|(corner, next)| {
            let middle = corner.midpoint(*next);
            let on_way = TO_CORNERS.iter().map(|part| centre.lerp(*corner, *part));
            on_way.chain(TO_MIDDLES.iter().map(move |part| centre.lerp(middle, *part)))
        });
        !buries(centre) || between.any(|point| !buries(point))
    }
}

/// Divides leaves whose corners are all inside of other bodies, but not what is between them. `longest_edge` is that of a patch; leaves of
/// `shortest_edge` or less stay whole. Both are in frame units. The mesh gets half of the vertices that it may still have at most, the
/// rest is for refinement.
pub fn divide_buried(mesh: &mut Mesh, scene: &Scene, longest_edge: f64, shortest_edge: f64, most: usize) {
    let least = shortest_edge.max(SMALLEST * longest_edge);
    let most = usize::midpoint(mesh.vertices.len(), most.max(mesh.vertices.len()));
    let is_large = |mesh: &Mesh, id: PatchId| mesh.size(id) > least;
    let mut leaves: Vec<PatchId> = mesh.leaves().map(|(id, _)| id).filter(|id| is_large(mesh, *id)).collect();
    if leaves.is_empty() {
        return;
    }
    let bodies = Bodies::new(scene);
    for _ in 0..ROUNDS {
        let asked = leaves.par_iter().with_min_len(64);
        let buried: Vec<PatchId> =
            asked.copied().filter(|leaf| bodies.bury_corners(scene, mesh, *leaf)).collect();
        if !buried.iter().all(|id| mesh.divide_within(*id, most)) {
            return;
        }
        leaves = buried.into_iter().flat_map(|id| mesh.children(id)).collect();
        // One may have been divided for the sake of a neighbour.
        leaves.retain(|id| mesh.patch(*id).first_child.is_none() && is_large(mesh, *id));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{facet, scene};
    use scene::Facet;

    const LONGEST_EDGE: f64 = 2000.0;

    /// The six sides of a box, lit from outside.
    fn body(first: u32, [x, y, z]: [[f64; 2]; 3]) -> Vec<Facet> {
        let side = |[a, b, c, d]: [[usize; 3]; 4]| {
            [a, b, c, d].map(|corner| [x[corner[0]], y[corner[1]], z[corner[2]]])
        };
        let sides = [
            [[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]],
            [[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]],
            [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]],
            [[0, 1, 0], [0, 1, 1], [1, 1, 1], [1, 1, 0]],
            [[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]],
            [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
        ];
        (first..).zip(sides).map(|(plane, corners)| facet(plane, &side(corners))).collect()
    }

    /// The upper side of a bar of length 1000, and posts that hold it.
    fn bar(posts: &[[f64; 2]]) -> Scene {
        let bar = facet(0, &[[0.0, 0.0, 0.0], [1000.0, 0.0, 0.0], [1000.0, 20.0, 0.0], [0.0, 20.0, 0.0]]);
        let posts = (1..).step_by(6).zip(posts);
        let posts = posts.map(|(plane, x)| body(plane, [*x, [-50.0, 70.0], [-500.0, 500.0]]));
        scene([vec![bar]].into_iter().chain(posts).collect(), vec![])
    }

    fn mesh(scene: &Scene, most: usize) -> (usize, Mesh) {
        let mut mesh = Mesh::new(scene, 1e6, LONGEST_EDGE, 0, &[]);
        let before = mesh.vertices.len();
        divide_buried(&mut mesh, scene, LONGEST_EDGE, 0.0, most);
        (before, mesh)
    }

    /// Positions along the bar that have vertices.
    fn along_bar(mesh: &Mesh) -> Vec<f64> {
        let own = mesh.vertices.iter().filter(|vertex| vertex.plane == PlaneId(0));
        let mut along: Vec<f64> = own.map(|vertex| vertex.position.x).collect();
        along.sort_by(f64::total_cmp);
        along.dedup();
        along
    }

    #[test]
    fn a_bar_between_posts_gets_vertices_in_the_open() {
        let ends = [[-40.0, 40.0], [960.0, 1040.0]];
        let (_, between_two) = mesh(&bar(&ends), usize::MAX);
        assert_eq!(along_bar(&between_two), [0.0, 500.0, 1000.0]);
        // In the middle there is a post, too.
        let (_, between_three) = mesh(&bar(&[ends[0], ends[1], [480.0, 520.0]]), usize::MAX);
        assert_eq!(along_bar(&between_three), [0.0, 250.0, 500.0, 750.0, 1000.0]);
        // Open near one end only.
        for [from, to] in [[40.0, 260.0], [740.0, 960.0]] {
            let (_, open) = mesh(&bar(&[[-40.0, from], [to, 1040.0]]), usize::MAX);
            let along = along_bar(&open);
            assert!(along.iter().any(|x| (from..to).contains(x)), "open from {from} to {to}: {along:?}");
        }
    }

    #[test]
    fn what_is_wholly_in_the_open_or_inside_stays_whole() {
        for posts in [&[][..], &[[-40.0, 40.0]], &[[-40.0, 1040.0]], &[[300.0, 600.0]]] {
            let scene = bar(posts);
            let (before, mesh) = mesh(&scene, usize::MAX);
            assert_eq!(mesh.vertices.len(), before, "{posts:?}");
        }
    }

    #[test]
    fn no_more_vertices_are_made_than_there_may_be() {
        let scene = bar(&[[-40.0, 40.0], [960.0, 1040.0], [480.0, 520.0]]);
        let (before, bounded) = mesh(&scene, 0);
        assert_eq!(bounded.vertices.len(), before);
        // The bar takes two rounds, and there is room for the first.
        let (undivided, one_round) = mesh(&bar(&[[-40.0, 40.0], [960.0, 1040.0]]), usize::MAX);
        let added = one_round.vertices.len() - undivided;
        let (_, bounded) = mesh(&scene, before + 2 * added);
        assert_eq!(along_bar(&bounded), [0.0, 500.0, 1000.0]);
        assert_eq!(bounded.vertices.len(), before + added);
    }

    #[test]
    fn what_is_as_small_as_a_leaf_may_be_stays_whole() {
        let scene = bar(&[[-40.0, 40.0], [960.0, 1040.0], [480.0, 520.0]]);
        let mut mesh = Mesh::new(&scene, 1e6, LONGEST_EDGE, 0, &[]);
        divide_buried(&mut mesh, &scene, LONGEST_EDGE, 800.0, usize::MAX);
        assert_eq!(along_bar(&mesh), [0.0, 500.0, 1000.0]);
    }

    /// Light comes through glass, and the inside of a sheet that is lit from both sides is no dark one.
    #[test]
    fn glass_and_lit_backs_bury_nothing() {
        let mut scene = bar(&[[-40.0, 40.0], [960.0, 1040.0]]);
        scene.surfaces[1].opacity = 0.5;
        let (before, of_glass) = mesh(&scene, usize::MAX);
        assert_eq!(of_glass.vertices.len(), before);

        let mut scene = bar(&[[-40.0, 40.0], [960.0, 1040.0]]);
        let turned = |own: &Facet| {
            let mut corners: Vec<[f64; 3]> = own.positions().map(|at| at.to_array()).collect();
            corners.reverse();
            facet(own.plane.0, &corners)
        };
        let back = scene.surfaces[1].facets.iter().map(turned).collect();
        scene.surfaces[1].facets.extend::<Vec<Facet>>(back);
        let (before, of_sheets) = mesh(&scene, usize::MAX);
        assert_eq!(of_sheets.vertices.len(), before);
    }
}
