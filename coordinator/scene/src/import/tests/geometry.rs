//! Nodes, transforms, and triangles out of primitives.

use glam::DVec3;
use serde_json::{Value, json};

use crate::facet::Facet;
use crate::import::test_document::{SQUARE, SQUARE_INDICES, TestDocument};
use crate::model::{Scene, Surface};

fn world_corners(scene: &Scene, facet: &Facet) -> Vec<DVec3> {
    facet.corners.iter().map(|corner| scene.frame.to_world(corner.position)).collect()
}

/// The unit square under one node with these properties.
fn square_under(node: Value) -> Scene {
    let mut document = TestDocument::square();
    document.root["nodes"][0].as_object_mut().unwrap().extend(node.as_object().unwrap().clone());
    document.scene()
}

/// Vertices of all source triangles of the only surface, each beginning with its smallest.
fn source_triangles(scene: &Scene) -> Vec<[u32; 3]> {
    let triangles = scene.surfaces[0].facets.iter().flat_map(|facet| &facet.triangles);
    let mut vertices: Vec<[u32; 3]> = triangles.map(|triangle| triangle.vertices).collect();
    for triangle in &mut vertices {
        let smallest = (0..3).min_by_key(|&i| triangle[i]).unwrap();
        triangle.rotate_left(smallest);
    }
    vertices.sort_unstable();
    vertices
}

#[test]
fn square_fills_the_frame() {
    let scene = TestDocument::square().scene();
    let facet = &scene.surfaces[0].facets[0];
    assert_eq!((scene.frame.centre, scene.frame.scale), (DVec3::new(0.5, 0.5, 0.0), 1.0 / 1024.0));
    assert_eq!(facet.corners[0].position, DVec3::new(-512.0, -512.0, 0.0));
    assert_eq!(world_corners(&scene, facet), SQUARE.map(|corner| DVec3::from_array(corner.map(f64::from))));
    assert_eq!(scene.surfaces[0].name, "node \"thing\", primitive 0");
}

#[test]
fn transforms_of_parents_apply_after_those_of_children() {
    let mut document = TestDocument::square();
    document.root["nodes"][0]["translation"] = json!([1, 0, 0]);
    let quarter_turn_about_z = [0.0, 0.0, 0.5f32.sqrt(), 0.5f32.sqrt()];
    document.push("nodes", json!({ "children": [0], "rotation": quarter_turn_about_z, "scale": [2, 3, 4] }));
    document.root["scenes"][0]["nodes"] = json!([1]);
    let scene = document.scene();
    let corners = world_corners(&scene, &scene.surfaces[0].facets[0]);
    for (corner, expected) in corners.iter().zip([[0.0, 2.0], [0.0, 4.0], [-3.0, 4.0], [-3.0, 2.0]]) {
        assert!(corner.distance(DVec3::new(expected[0], expected[1], 0.0)) < 1e-12, "{corner}");
    }
    assert_eq!(scene.surfaces[0].node, 0);
}

#[test]
fn matrix_is_read_column_by_column() {
    let scene = square_under(json!({ "matrix": [0, 2, 0, 0, 0, 0, 3, 0, 5, 0, 0, 0, 7, 8, 9, 1] }));
    let corners = world_corners(&scene, &scene.surfaces[0].facets[0]);
    let expected = [[7.0, 8.0, 9.0], [7.0, 10.0, 9.0], [7.0, 10.0, 12.0], [7.0, 8.0, 12.0]];
    assert_eq!(corners, expected.map(DVec3::from_array));
}

#[test]
fn mirrored_node_keeps_its_front_in_front() {
    for scale in [[-1, 1, 1], [1, -2, 1], [-1, -1, -1]] {
        let scene = square_under(json!({ "scale": scale }));
        let facet = &scene.surfaces[0].facets[0];
        // A mirror that swaps left and right leaves the front where it was; one along the normal turns it with the object.
        let expected = DVec3::Z * f64::from(scale[2]);
        assert_eq!(facet.normal, expected, "{scale:?}");
        assert_eq!(
            kernel::geometry::area_vector(&facet.corners.iter().map(|c| c.position).collect::<Vec<_>>())
                .normalize(),
            expected
        );
        for triangle in &facet.triangles {
            let [a, b, c] = triangle.positions;
            assert!((b - a).cross(c - a).dot(expected) > 0.0);
            let in_file = DVec3::from_array(SQUARE[triangle.vertices[1] as usize].map(f64::from));
            let scaled = in_file * DVec3::from_array(scale.map(f64::from));
            assert_eq!(scene.frame.to_world(b), scaled);
        }
    }
}

#[test]
fn a_node_that_squeezes_its_mesh_flat_is_refused_before_the_bake() {
    let mut document = TestDocument::square();
    document.root["nodes"][0]["scale"] = json!([1, 1, 0]);
    document.root["nodes"][0]["name"] = json!("decal");
    let error = document.problem().to_string();
    assert!(error.contains("decal") && error.contains("small scale"), "{error}");
}

#[test]
fn singular_node_only_drops_its_triangles() {
    let mut document = TestDocument::square();
    document.root_node(json!({ "mesh": 0, "scale": [1, 0, 1] }));
    let scene = document.scene();
    assert_eq!((scene.surfaces.len(), scene.degenerate_triangles), (1, 2));
}

#[test]
fn only_the_default_scene_is_read() {
    let mut document = TestDocument::square();
    document.push("nodes", json!({ "mesh": 0 }));
    assert_eq!(document.scene().surfaces.len(), 1);
    document.root["scenes"] = json!([{ "nodes": [0] }, { "nodes": [0, 1] }]);
    document.root["scene"] = 1.into();
    assert_eq!(document.scene().surfaces.len(), 2);
    document.root.as_object_mut().unwrap().remove("scene");
    assert_eq!(document.scene().surfaces.len(), 1);
    document.root.as_object_mut().unwrap().remove("scenes");
    assert_eq!(document.scene().surfaces.len(), 2);
}

#[test]
fn nodes_come_in_the_order_of_the_file_parents_first() {
    let mut document = TestDocument::square();
    document.push("nodes", json!({ "mesh": 0 }));
    document.push("nodes", json!({ "mesh": 0, "children": [1, 0] }));
    document.push("nodes", json!({ "mesh": 0 }));
    document.root["scenes"][0]["nodes"] = json!([3, 2]);
    let scene = document.scene();
    assert_eq!(scene.surfaces.iter().map(|surface| surface.node).collect::<Vec<_>>(), [3, 2, 1, 0]);
}

/// A zigzag of five points, so that the triangles of strips and fans differ.
const ZIGZAG: [[f32; 3]; 5] = [[0.0; 3], [0.0, 1.0, 0.0], [1.0, 0.0, 0.3], [1.0, 1.0, 1.0], [2.0, 0.5, 5.0]];

#[test]
fn hidden_nodes_and_what_is_below_them_are_left_out() {
    let mut document = TestDocument::square();
    let lamp = json!({ "type": "point", "intensity": 1.0 });
    document.light(lamp, json!({ "mesh": 0, "translation": [0, 0, 2] }));
    let child = document.push("nodes", json!({ "mesh": 0, "translation": [0, 0, 4] }));
    document.root["nodes"][1]["children"] = json!([child]);
    let count = |visible: Option<bool>| {
        let mut document = TestDocument { root: document.root.clone(), bin: document.bin.clone() };
        if let Some(visible) = visible {
            document.root["nodes"][1]["extensions"]["KHR_node_visibility"] = json!({ "visible": visible });
            document.root["extensionsUsed"] = json!(["KHR_lights_punctual", "KHR_node_visibility"]);
            document.root["extensionsRequired"] = json!(["KHR_node_visibility"]);
        }
        let scene = document.scene();
        (scene.surfaces.len(), scene.lights.len(), scene.warnings)
    };
    assert_eq!(count(None), (3, 1, vec![]));
    assert_eq!(count(Some(true)), (3, 1, vec![]));
    let told = "nodes with a mesh left out, since KHR_node_visibility hides them: 2".to_owned();
    assert_eq!(count(Some(false)), (1, 0, vec![told]));
}

#[test]
fn modes_make_the_triangles_of_the_specification() {
    let cases: [(u32, &[[u32; 3]]); 3] =
        [(4, &[[0, 1, 2]]), (5, &[[0, 1, 2], [1, 3, 2], [2, 3, 4]]), (6, &[[0, 1, 2], [0, 2, 3], [0, 3, 4]])];
    for (mode, expected) in cases {
        for indexed in [false, true] {
            let mut document = TestDocument::new();
            let positions = document.vectors(&ZIGZAG);
            let mut primitive =
                json!({ "attributes": { "POSITION": positions }, "mode": mode, "material": 0 });
            if indexed {
                primitive["indices"] = document.indices(&[0, 1, 2, 3, 4]).into();
            }
            document.node_with(primitive);
            assert_eq!(source_triangles(&document.scene()), expected, "mode {mode}");
        }
    }
}

#[test]
fn narrow_indices() {
    let mut document = TestDocument::square();
    for (component, bytes) in
        [(5121, vec![0, 1, 2, 0, 2, 3]), (5123, vec![0, 0, 1, 0, 2, 0, 0, 0, 2, 0, 3, 0])]
    {
        let indices = document.accessor(&bytes, component, "SCALAR", 6);
        document.node_with(json!({ "attributes": { "POSITION": 0 }, "indices": indices, "material": 0 }));
    }
    let scene = document.scene();
    assert_eq!(scene.surfaces.len(), 3);
    let outline = |surface: &Surface| surface.facets[0].positions().map(DVec3::truncate).collect::<Vec<_>>();
    assert!(scene.surfaces.iter().all(|surface| outline(surface) == outline(&scene.surfaces[0])));
}

#[test]
fn interleaved_and_sparse_accessors() {
    let mut document = TestDocument::new();
    let padded = SQUARE.map(|[x, y, z]| [x, y, z, f32::NAN]);
    let positions = document.floats("VEC4", &padded);
    document.root["accessors"][positions]["type"] = "VEC3".into();
    document.root["bufferViews"][positions]["byteStride"] = 16.into();
    let (indices, moved) = (document.indices(&[1, 2]), document.vectors(&[[2.0, 0.0, 0.0], [2.0, 1.0, 0.0]]));
    document.root["accessors"][positions]["sparse"] = json!({
        "count": 2,
        "indices": { "bufferView": indices, "componentType": 5125 },
        "values": { "bufferView": moved },
    });
    let triangles = document.indices(&SQUARE_INDICES);
    document
        .node_with(json!({ "attributes": { "POSITION": positions }, "indices": triangles, "material": 0 }));
    let scene = document.scene();
    let corners = world_corners(&scene, &scene.surfaces[0].facets[0]);
    assert_eq!(corners, [DVec3::ZERO, DVec3::new(2.0, 0.0, 0.0), DVec3::new(2.0, 1.0, 0.0), DVec3::Y]);
}

#[test]
fn points_and_lines_are_left_out_with_a_warning() {
    for mode in 0..4 {
        let mut document = TestDocument::square();
        document.node_with(json!({ "attributes": { "POSITION": 0 }, "mode": mode }));
        let scene = document.scene();
        assert_eq!(scene.surfaces.len(), 1);
        assert_eq!(scene.warnings.len(), 1);
        assert!(scene.warnings[0].contains("points and lines left out"), "{:?}", scene.warnings);
    }
}

#[test]
fn degenerate_triangles_are_dropped_and_counted() {
    let mut positions = SQUARE.to_vec();
    positions.extend([[0.5, 0.0, 0.0], [0.0, 0.0, 0.0], [0.5, 1e-12, 0.0]]);
    let indices = [&SQUARE_INDICES[..], &[0, 4, 1, 0, 0, 1, 0, 5, 2, 0, 1, 6]].concat();
    let scene = TestDocument::with_triangles(&positions, &indices).scene();
    assert_eq!(scene.degenerate_triangles, 4);
    assert_eq!(source_triangles(&scene), [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn slivers_keep_their_area_and_normal() {
    let scene =
        TestDocument::with_triangles(&[[0.0; 3], [1.0, 0.0, 0.0], [0.5, 1e-8, 0.0]], &[0, 1, 2]).scene();
    assert_eq!(scene.degenerate_triangles, 0);
    assert_eq!(scene.surfaces[0].facets[0].normal, DVec3::Z);
}

#[test]
fn duplicate_triangles_are_dropped_and_counted() {
    let mut positions = SQUARE.to_vec();
    positions.extend(SQUARE);
    // The first again, rotated and through other vertices; then its back, which is no duplicate.
    let indices = [&SQUARE_INDICES[..], &[5, 6, 4, 2, 1, 0]].concat();
    let scene = TestDocument::with_triangles(&positions, &indices).scene();
    assert_eq!(scene.warnings, ["node \"thing\", primitive 0: 1 duplicate triangle dropped"]);
    assert_eq!(source_triangles(&scene), [[0, 1, 2], [0, 2, 1], [0, 2, 3]]);
}

#[test]
fn source_document_holds_what_was_read() {
    let document = TestDocument::square();
    let source = document.scene().source;
    assert_eq!(source.buffers, [document.bin]);
    assert_eq!(source.root.nodes[0].name.as_deref(), Some("thing"));
}
