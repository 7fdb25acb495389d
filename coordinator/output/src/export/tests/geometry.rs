//! Positions, winding and sides.

use glam::{DMat3, DVec3};
use gltf::Semantic;
use serde_json::{Value, json};

use super::*;
use ::document::placement::world_matrices;
use fixtures::{Builder, light, square};
use scene::Side;

#[test]
fn every_node_of_a_shared_mesh_gets_its_own_light() {
    let mut builder = Builder::default();
    let square = builder.square();
    let scene = builder.import(json!({
        "meshes": [{"name": "card", "primitives": [square]}, {"name": "spare", "primitives": [square]}],
        "nodes": [
            {"name": "left", "mesh": 0},
            {"name": "arm", "scale": [2, 2, 2], "children": [2]},
            {"name": "right", "mesh": 0, "translation": [5, 0, 0], "rotation": [0, 0.6, 0, 0.8]},
        ],
        "scenes": [{"nodes": [0, 1]}],
    }));
    let lit = light(&scene, 1, |world| world + DVec3::splat(20.0));
    let (exported, gltf) = round_trip(&scene, &lit);

    assert_eq!((exported.vertices, exported.triangles), (18, 16));
    let names: Vec<_> = gltf.meshes().map(|mesh| mesh.name().unwrap().to_owned()).collect();
    assert_eq!(names, ["card", "spare", "card"], "the first keeps its place");
    let world = world_matrices(&gltf);
    for node in [0, 2] {
        let primitive = first_primitive(&gltf, node);
        let positions = attribute(&gltf, &primitive, &Semantic::Positions);
        for (position, irradiance) in positions.iter().zip(attribute(&gltf, &primitive, &irradiance())) {
            let position = point(position);
            let halves = position * 2.0;
            assert!(halves.distance(halves.round()) < 1e-6, "corners and middles of the unit square");
            let expected = world[node].transform_point3(position) + DVec3::splat(20.0);
            assert!((point(&irradiance) - expected).length() < 1e-5);
        }
        let accessor = primitive.get(&Semantic::Positions).unwrap();
        let bound = |pick: fn(f32, f32) -> f32| -> Value {
            (0..3).map(|i| positions.iter().map(|row| row[i]).reduce(pick).unwrap()).collect()
        };
        assert_eq!((accessor.min(), accessor.max()), (Some(bound(f32::min)), Some(bound(f32::max))));
    }
}

/// A node twice as wide as high stretches what lies along x, not its normals: the file's go back into its coordinates as they were.
#[test]
fn normals_that_lean_too_far_for_light_are_the_inputs() {
    let mut builder = Builder::default();
    let mut square = builder.square();
    let leaning = [[1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0; 3], [0.0, 0.0, -1.0]];
    square["attributes"]["NORMAL"] = builder.floats(&leaning).into();
    let mut scene = builder.import(json!({
        "meshes": [{ "primitives": [square] }],
        "materials": [{ "doubleSided": true }],
        "nodes": [{ "mesh": 0, "scale": [2, 1, 1] }],
        "scenes": [{ "nodes": [0] }],
    }));
    for keeps_normals in [false, true] {
        scene.surfaces.iter_mut().for_each(|surface| surface.keeps_normals = keeps_normals);
        let lit = light(&scene, 0, |_| DVec3::ONE);
        let (_, gltf) = round_trip(&scene, &lit);
        let mesh = gltf.meshes().next().unwrap();
        for (primitive, side) in mesh.primitives().zip([1.0, -1.0]) {
            let positions = attribute(&gltf, &primitive, &Semantic::Positions);
            let normals = attribute(&gltf, &primitive, &Semantic::Normals);
            for (position, normal) in positions.iter().map(|row| point(row)).zip(&normals) {
                // Zero, and what points away from the front, is no normal.
                let leans = keeps_normals && position.y < 0.5;
                let expected = if leans { DVec3::new(1.0, 0.0, 1.0).normalize() } else { DVec3::Z };
                assert!(point(normal).distance(side * expected) < 1e-6, "{position}: {normal:?}");
            }
        }
    }
}

#[test]
fn triangles_are_counter_clockwise_where_nodes_mirror_too() {
    let mut builder = Builder::default();
    let square = builder.square();
    let scene = builder.import(json!({
        "meshes": [{"primitives": [square]}],
        "materials": [{"doubleSided": true}],
        "nodes": [{"mesh": 0, "scale": [-1, 3, 1], "rotation": [0.6, 0, 0, 0.8]}, {"mesh": 0}],
        "scenes": [{"nodes": [0, 1]}],
    }));
    let lit = light(&scene, 1, |_| DVec3::ONE);
    let (_, gltf) = round_trip(&scene, &lit);
    let world = world_matrices(&gltf);
    assert!(world[0].determinant() < 0.0);
    for (node, world) in world.into_iter().enumerate() {
        let primitive = first_primitive(&gltf, node);
        let positions = attribute(&gltf, &primitive, &Semantic::Positions);
        let normals = attribute(&gltf, &primitive, &Semantic::Normals);
        let lit_side = scene.surfaces[node].facets[0].normal;
        for triangle in indices(&gltf, &primitive).chunks_exact(3) {
            let [a, b, c] = [0, 1, 2].map(|i| point(&positions[triangle[i] as usize]));
            let geometric = (b - a).cross(c - a).normalize();
            assert!((geometric - DVec3::Z).length() < 1e-6, "counter-clockwise in the node's coordinates");
            assert!((point(&normals[triangle[0] as usize]) - DVec3::Z).length() < 1e-6);
            let normal = DMat3::from_mat4(world).inverse().transpose() * DVec3::Z;
            assert!((normal.normalize() - lit_side).length() < 1e-6, "and facing the lit side in the world");
        }
    }
}

#[test]
fn the_sides_of_a_double_sided_primitive_become_two_primitives() {
    let mut builder = Builder::default();
    let (first, second) = (builder.square(), builder.square());
    let with = |mut primitive: Value, material: usize| {
        primitive["material"] = material.into();
        primitive
    };
    let scene = builder.import(json!({
        "meshes": [{"primitives": [with(first, 0), with(second, 1)]}],
        "materials": [{"name": "paper", "doubleSided": true}, {"name": "wall"}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }));
    let mut lit = light(&scene, 0, |_| DVec3::ONE);
    let back = scene.surfaces.iter().position(|surface| surface.side == Side::Back).unwrap();
    for triangle in lit.surfaces[back].clone() {
        triangle.vertices.iter().for_each(|&v| lit.vertices[v as usize].irradiance = DVec3::splat(3.0));
    }
    let (_, gltf) = round_trip(&scene, &lit);

    let mesh = gltf.meshes().next().unwrap();
    let seen: Vec<_> = mesh
        .primitives()
        .map(|primitive| {
            let normal = point(&attribute(&gltf, &primitive, &Semantic::Normals)[0]);
            let light = attribute(&gltf, &primitive, &irradiance())[0][0];
            let material = primitive.material();
            assert!(!material.double_sided() && material.unlit());
            (material.name().unwrap().to_owned(), normal.z, light)
        })
        .collect();
    let expected = [("paper", 1.0, 1.0), ("wall", 1.0, 1.0), ("paper", -1.0, 3.0)]
        .map(|(name, z, e)| (name.to_owned(), z, e));
    assert_eq!(seen, expected);
    assert_eq!(gltf.materials().count(), 2, "both sides share a material, and the replaced ones are gone");
}

#[test]
fn a_node_squeezed_flat_is_named() {
    let mut builder = Builder::default();
    let square = builder.square();
    let scene = builder.import(json!({
        "meshes": [{"primitives": [square]}],
        "nodes": [{"name": "decal", "mesh": 0, "scale": [1, 1, 0]}],
        "scenes": [{"nodes": [0]}],
    }));
    let lit = light(&scene, 0, |_| DVec3::ONE);
    let directory = TempDir::new().unwrap();
    let error = export(&scene, &lit, &settings(), &directory.path().join("lit.glb")).unwrap_err();
    assert!(matches!(&error, ExportError::SingularNode(name) if name.contains("decal")), "{error}");
}

#[test]
fn values_that_are_not_finite_are_refused_by_name() {
    let mut builder = Builder::default();
    let square = builder.square();
    let scene = builder.import(json!({
        "meshes": [{"primitives": [square]}],
        "nodes": [{"name": "table", "mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }));
    let directory = TempDir::new().unwrap();
    for value in [f64::NAN, f64::INFINITY, 1e39] {
        for exposure in [None, Some(1.0)] {
            let lit = light(&scene, 0, |_| DVec3::new(0.0, value, 0.0));
            let settings = ExportSettings { exposure, ..settings() };
            let error = export(&scene, &lit, &settings, &directory.path().join("lit.glb")).unwrap_err();
            assert!(error.to_string().starts_with("irradiance of table (Front)"), "{error}");
        }
    }
    assert_eq!(fs::read_dir(&directory).unwrap().count(), 0);
}

#[test]
fn a_lit_mesh_of_another_scene_is_refused() {
    let (scene, good) = square();
    let directory = TempDir::new().unwrap();
    let no_surface = LitMesh { surfaces: vec![], ..good.clone() };
    let no_vertex = LitMesh { vertices: good.vertices[..2].to_vec(), ..good.clone() };
    let mut no_facet = good;
    no_facet.surfaces[0][0].facet = 9;
    for lit in [no_surface, no_vertex, no_facet] {
        let error = export(&scene, &lit, &settings(), &directory.path().join("lit.glb")).unwrap_err();
        assert!(matches!(error, ExportError::Mismatch(_)), "{error}");
    }
}
