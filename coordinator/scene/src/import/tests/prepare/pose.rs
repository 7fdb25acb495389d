//! Morph targets and skins as they stand.

use glam::{Mat4, Quat, Vec3};
use serde_json::json;

use super::{first_triangles, primitive};
use crate::import::test_document::TestDocument;
use document::ImportProblem;

/// The square with a target that lifts it by 1 and one that lifts it by 10.
fn morphing() -> TestDocument {
    let mut document = TestDocument::square();
    let (one, ten) = (document.vectors(&[[0.0, 0.0, 1.0]; 4]), document.vectors(&[[0.0, 0.0, 10.0]; 4]));
    primitive(&mut document)["targets"] = json!([{ "POSITION": one }, { "POSITION": ten }]);
    document
}

fn height(document: &TestDocument) -> f64 {
    first_triangles(&document.scene())[0].1[0][2]
}

#[test]
fn morph_targets_count_by_the_weights_of_the_node_or_else_of_the_mesh() {
    let mut document = morphing();
    assert_eq!(height(&document), 0.0);
    document.root["meshes"][0]["weights"] = json!([0.5, 0.25]);
    assert_eq!(height(&document), 3.0);
    document.root["nodes"][0]["weights"] = json!([0.0, 1.0]);
    assert_eq!(height(&document), 10.0);
    let scene = document.scene();
    assert_eq!(scene.warnings, ["morph targets baked at the file's own weights: node \"thing\""]);
    let node = &scene.source.root.nodes[0];
    assert!(node.weights.is_none() && node.mesh.unwrap().value() == 1);
    assert!(scene.source.root.meshes[1].primitives[0].targets.is_none());
}

#[test]
fn hidden_nodes_keep_their_targets() {
    let mut document = morphing();
    document.root["meshes"][0]["weights"] = json!([0.5, 0.25]);
    document.root["nodes"][0]["extensions"] = json!({ "KHR_node_visibility": { "visible": false } });
    document.root_node(json!({ "name": "seen", "mesh": 0, "translation": [0, 0, 20] }));
    let scene = document.scene();
    let nodes = &scene.source.root.nodes;
    assert_eq!([0, 1].map(|node: usize| nodes[node].mesh.unwrap().value()), [0, 1]);
    assert!(scene.source.root.meshes[0].primitives[0].targets.is_some());
    assert_eq!(first_triangles(&scene)[0].1[0][2], 23.0);
    assert!(scene.warnings.iter().all(|warning| !warning.contains("thing")), "{:?}", scene.warnings);
}

#[test]
fn sparse_displacements() {
    let mut document = morphing();
    let values = document.root["accessors"][2]["bufferView"].clone();
    let places = document.accessor(&[0], 5121, "SCALAR", 1);
    let places = document.root["accessors"][places]["bufferView"].clone();
    let sparse = document.push("accessors", json!({
        "componentType": 5126, "type": "VEC3", "count": 4,
        "sparse": { "count": 1, "values": { "bufferView": values }, "indices": { "bufferView": places, "componentType": 5121 } },
    }));
    primitive(&mut document)["targets"] = json!([{ "POSITION": sparse }]);
    document.root["meshes"][0]["weights"] = json!([1.0]);
    let triangle = first_triangles(&document.scene())[0].1;
    assert_eq!(triangle.map(|corner| corner[2]), [1.0, 0.0, 0.0]);
}

/// The square on two joints: corners 0 and 1 on the first, the others on the second.
fn skinned() -> TestDocument {
    let mut document = TestDocument::square();
    let joints = document.accessor(&[0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0], 5121, "VEC4", 4);
    let weights = document.floats("VEC4", &[[1.0, 0.0, 0.0, 0.0]; 4]);
    let attributes = &mut primitive(&mut document)["attributes"];
    attributes["JOINTS_0"] = joints.into();
    attributes["WEIGHTS_0"] = weights.into();
    // Bound at (0, 0, 0) and (0, 1, 0); now the first stands at (3, 0, 0), and the second above it at (3, 1, 2).
    let inverse = [Mat4::IDENTITY, Mat4::from_translation(Vec3::new(0.0, -1.0, 0.0))];
    let inverse = document.floats("MAT4", &inverse.map(|matrix| matrix.to_cols_array()));
    let first = document.root_node(json!({ "translation": [3, 0, 0] }));
    let second = document.push("nodes", json!({ "translation": [0, 1, 2] }));
    document.root["nodes"][first]["children"] = json!([second]);
    document.root["skins"] = json!([{ "joints": [first, second], "inverseBindMatrices": inverse }]);
    document.root["nodes"][0]["skin"] = 0.into();
    document
}

#[test]
fn skins_stand_where_their_joints_are() {
    let expected = [[3.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 1.0, 2.0]];
    let mut document = skinned();
    let scene = document.scene();
    assert_eq!(first_triangles(&scene), [(0, expected)]);
    assert_eq!(scene.warnings, ["skins baked as the joints stand without animation: node \"thing\""]);
    assert!(scene.source.root.nodes[0].skin.is_none());
    let attributes = &scene.source.root.meshes[1].primitives[0].attributes;
    assert_eq!(attributes.len(), 1, "joints and weights end");
    // Wherever the skinned node itself stands.
    let turn = Quat::from_rotation_y(1.0).to_array();
    document.root["nodes"][0]["translation"] = json!([7, 8, 9]);
    document.root["nodes"][0]["rotation"] = json!(turn);
    document.root["nodes"][0]["scale"] = json!([2, 4, 0.5]);
    assert_eq!(first_triangles(&document.scene()), [(0, expected)]);
}

#[test]
fn weights_are_shares_of_their_sum() {
    let mut document = skinned();
    // Half on each joint, as bytes that add up to 254.
    let joints = document.accessor(&[0, 1, 0, 0].repeat(4), 5121, "VEC4", 4);
    let weights = document.accessor(&[127, 127, 0, 0].repeat(4), 5121, "VEC4", 4);
    document.root["accessors"][weights]["normalized"] = true.into();
    let attributes = &mut primitive(&mut document)["attributes"];
    attributes["JOINTS_0"] = joints.into();
    attributes["WEIGHTS_0"] = weights.into();
    let expected = [[3.0, 0.0, 1.0], [4.0, 0.0, 1.0], [4.0, 1.0, 1.0]];
    assert_eq!(first_triangles(&document.scene()), [(0, expected)]);
}

#[test]
fn normals_follow_the_joints() {
    let mut document = skinned();
    let normals = document.vectors(&[[0.25, 0.0, 0.75]; 4]);
    primitive(&mut document)["attributes"]["NORMAL"] = normals.into();
    let half = std::f32::consts::FRAC_1_SQRT_2;
    // A quarter turn about z: x becomes y.
    document.root["nodes"][1]["rotation"] = json!([0, 0, half, half]);
    document.root["nodes"][2] = json!({ "translation": [0, 1, 0] });
    let scene = document.scene();
    let normal = scene.surfaces[0].facets[0].corners[0].normal;
    let expected = glam::DVec3::new(0.0, 0.25, 0.75).normalize();
    assert!((normal - expected).length() < 1e-6, "{normal}");
}

#[test]
fn faults_are_named() {
    let mut document = skinned();
    document.root["skins"][0]["joints"] = json!([1]);
    let message = document.problem().to_string();
    assert!(message.contains("node \"thing\", primitive 0") && message.contains("joint 1 of 1"), "{message}");

    let mut document = skinned();
    document.root["skins"][0]["inverseBindMatrices"] = 0.into();
    assert!(document.problem().to_string().contains("inverse bind matrix"));

    let mut document = skinned();
    document.root["nodes"][0]["scale"] = json!([0, 1, 1]);
    assert!(matches!(document.problem(), ImportProblem::FlatNode { .. }));

    let mut document = morphing();
    let three = document.vectors(&[[0.0; 3]; 3]);
    primitive(&mut document)["targets"] = json!([{ "POSITION": three }]);
    document.root["meshes"][0]["weights"] = json!([1.0]);
    assert!(document.problem().to_string().contains("a morph target"));
}

#[test]
fn weights_are_finite() {
    for wrong in [f32::NAN, f32::INFINITY] {
        let mut document = skinned();
        let weights = document.floats("VEC4", &[[1.0, 0.0, wrong, 0.0]; 4]);
        primitive(&mut document)["attributes"]["WEIGHTS_0"] = weights.into();
        let message = document.problem().to_string();
        assert!(message.contains("node \"thing\"") && message.contains("has a weight of"), "{message}");
    }
}

/// Nodes times joints is far more than the file has of either.
#[test]
fn many_nodes_with_a_skin_of_many_joints_are_refused_before_they_are_placed() {
    let mut document = skinned();
    let first = document.root["nodes"].as_array().unwrap().len();
    for _ in 0..3000 {
        document.root_node(json!({}));
    }
    document.root["skins"] = json!([{ "joints": (first..first + 3000).collect::<Vec<_>>() }]);
    for _ in 0..3000 {
        document.root_node(json!({ "name": "again", "mesh": 0, "skin": 0 }));
    }
    let message = document.problem().to_string();
    assert!(message.contains("more joints than a file of this length can need"), "{message}");
}
