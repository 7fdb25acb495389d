//! What the mesh promises, whatever is divided: shares tile the surface, patches and their polygons are convex, triangles
//! meet edge to edge, and neighbours differ by one level at most.

use std::collections::HashMap;

use bake::lit::LitTriangle;
use bake::mesh::{Mesh, PatchId, triangulate};
use glam::{DMat4, DVec3};
use proptest::prelude::*;
use scene::Scene;
use tests::baking::imported;
use tests::builder::{Material, SceneBuilder};
use tests::shapes;

/// Relative error of sums of areas.
const ROUNDING: f64 = 1e-9;

/// Lengths below this, in frame units, are 0: what the mesh welds.
const WELD: f64 = 2e-4;

/// Rooms, each a single part: a cube, a prism over a concave floor, and a tetrahedron with no side along an axis.
fn rooms() -> Vec<Scene> {
    let turn = DMat4::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    [
        (shapes::unit_room(), DMat4::IDENTITY),
        (shapes::prism_facing_in(&shapes::l_shape(), 1.0), DMat4::IDENTITY),
        (shapes::tetrahedron_facing_in(), turn),
    ]
    .map(|(polygons, placed)| {
        let material = Material::grey(0.5).emitting(1.0);
        imported(&SceneBuilder::new().part("room", &polygons, material).placed(placed).glb())
    })
    .to_vec()
}

/// A room with a box that stands on its floor: contacts cut the floor.
fn room_with_a_box() -> Scene {
    let material = Material::grey(0.5).emitting(1.0);
    let standing = shapes::box_facing_out(DVec3::new(0.3, 0.2, 0.0), DVec3::new(0.6, 0.7, 0.4));
    let builder = SceneBuilder::new().part("room", &shapes::unit_room(), material);
    imported(&builder.part("box", &standing, material).glb())
}

fn mesh_of(scene: &Scene, longest_edge: f64) -> Mesh {
    let corners =
        || scene.surfaces.iter().flat_map(|s| &s.facets).flat_map(|f| &f.corners).map(|c| c.position);
    let extent = corners().fold(DVec3::MIN, DVec3::max) - corners().fold(DVec3::MAX, DVec3::min);
    Mesh::new(scene, extent.max_element(), longest_edge * extent.max_element(), 8, &[])
}

/// Divides leaves, chosen by numbers of any size.
fn divide(mesh: &mut Mesh, choices: &[u32]) {
    for choice in choices {
        let leaves: Vec<PatchId> = mesh.leaves().map(|(id, _)| id).collect();
        mesh.divide(leaves[*choice as usize % leaves.len()]);
    }
}

fn area(corners: &[DVec3]) -> DVec3 {
    corners[1..].windows(2).map(|pair| (pair[0] - corners[0]).cross(pair[1] - corners[0])).sum::<DVec3>()
        / 2.0
}

fn surface_area(scene: &Scene, surface: usize) -> f64 {
    let triangles = scene.surfaces[surface].facets.iter().flat_map(|facet| &facet.triangles);
    triangles.map(|triangle| area(&triangle.positions).length()).sum()
}

/// Convex and counter-clockwise seen against the normal; corners on a straight line are allowed.
fn assert_convex(corners: &[DVec3], normal: DVec3) {
    let count = corners.len();
    assert!(area(corners).dot(normal) > 0.0, "{corners:?} is clockwise");
    for i in 0..count {
        let (before, after) = (corners[(i + count - 1) % count], corners[(i + 1) % count]);
        let (along, onward) = (corners[i] - before, after - corners[i]);
        let turn = along.cross(onward).dot(normal) / (along.length() * onward.length());
        assert!(turn >= -1e-6, "{corners:?} turns back by {turn:e} at corner {i}");
    }
}

fn assert_shares_tile(scene: &Scene, mesh: &Mesh) {
    let shares = mesh.shares(scene);
    let mut areas = vec![0.0; scene.surfaces.len()];
    for share in &shares {
        let of_polygons: f64 = share.polygons.iter().map(|polygon| area(&polygon.corners).length()).sum();
        assert!((of_polygons / share.area - 1.0).abs() <= ROUNDING, "{of_polygons} of {}", share.area);
        areas[share.surface as usize] += share.area;
        for polygon in &share.polygons {
            assert_convex(&polygon.corners, mesh.vertices[share.vertex.index()].normal);
        }
    }
    for (surface, area) in areas.iter().enumerate() {
        let whole = surface_area(scene, surface);
        assert!((area / whole - 1.0).abs() <= ROUNDING, "surface {surface}: shares {area}, surface {whole}");
    }
}

/// No edge of a leaf has more than one vertex between its ends.
fn assert_balanced(mesh: &Mesh) {
    for (id, _) in mesh.leaves() {
        for (a, b) in mesh.edges(id) {
            if let Some(middle) = mesh.middle_of(a, b) {
                for end in [a, b] {
                    assert!(
                        mesh.middle_of(end, middle).is_none(),
                        "patch {id:?} has a neighbour two levels finer"
                    );
                }
            }
        }
    }
}

/// Every edge of the triangles is used by two of them, once in each direction, or lies on the border of its flat face: in these
/// rooms, in the plane of another facet too.
fn assert_edge_to_edge(scene: &Scene, mesh: &Mesh, surfaces: &[Vec<LitTriangle>]) {
    let facets = || scene.surfaces.iter().flat_map(|surface| &surface.facets);
    for (surface, triangles) in surfaces.iter().enumerate() {
        let mut found = 0.0;
        let mut uses: HashMap<(u32, u32), usize> = HashMap::new();
        for triangle in triangles {
            let corners = triangle.vertices.map(|vertex| mesh.vertices[vertex as usize].position);
            let normal = scene.surfaces[surface].facets[triangle.facet as usize].normal;
            assert!(area(&corners).dot(normal) > 0.0, "triangle {triangle:?} is turned over");
            found += area(&corners).length();
            let [a, b, c] = triangle.vertices;
            for edge in [(a, b), (b, c), (c, a)] {
                *uses.entry(edge).or_default() += 1;
            }
        }
        let whole = surface_area(scene, surface);
        assert!(
            (found / whole - 1.0).abs() <= ROUNDING,
            "surface {surface}: triangles {found}, surface {whole}"
        );
        for (&(a, b), &count) in &uses {
            assert_eq!(count, 1, "edge {a} {b} is used more than once in one direction");
            if uses.contains_key(&(b, a)) {
                continue;
            }
            let [from, to] = [a, b].map(|vertex| mesh.vertices[vertex as usize]);
            let on_border = facets().filter(|facet| facet.normal.dot(from.normal) < 0.999).any(|facet| {
                let height = |point: DVec3| facet.normal.dot(point - facet.corners[0].position).abs();
                height(from.position) <= WELD && height(to.position) <= WELD
            });
            assert!(on_border, "edge {:?} {:?} has one triangle only", from.position, to.position);
        }
    }
}

fn assert_sound(scene: &Scene, mesh: &Mesh) {
    assert_shares_tile(scene, mesh);
    assert_balanced(mesh);
    // Any value will do: it only chooses between triangulations.
    let value = |vertex: bake::mesh::VertexId| mesh.position(vertex).map(|x| (x * 0.01).sin());
    assert_edge_to_edge(scene, mesh, &triangulate(mesh, scene.surfaces.len(), value));
}

#[test]
fn meshes_of_shooting_size() {
    for scene in rooms().into_iter().chain([room_with_a_box()]) {
        for longest_edge in [2.0, 0.5, 0.15, 0.06] {
            assert_sound(&scene, &mesh_of(&scene, longest_edge));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn meshes_divided_at_random(
        room in 0_usize..4,
        choices in prop::collection::vec(any::<u32>(), 0..120),
    ) {
        let scene = rooms().into_iter().chain([room_with_a_box()]).nth(room).unwrap();
        let mut mesh = mesh_of(&scene, 0.5);
        divide(&mut mesh, &choices);
        assert_sound(&scene, &mesh);
    }

    /// The same corner again and again: the steepest change of level that there is.
    #[test]
    fn meshes_divided_towards_one_vertex(room in 0_usize..4, choice in any::<u32>(), depth in 1_usize..8) {
        let scene = rooms().into_iter().chain([room_with_a_box()]).nth(room).unwrap();
        let mut mesh = mesh_of(&scene, 0.5);
        let leaves: Vec<PatchId> = mesh.leaves().map(|(id, _)| id).collect();
        let mut leaf = leaves[choice as usize % leaves.len()];
        for _ in 0..depth {
            mesh.divide(leaf);
            leaf = mesh.children(leaf).next().unwrap();
        }
        assert_sound(&scene, &mesh);
    }
}
