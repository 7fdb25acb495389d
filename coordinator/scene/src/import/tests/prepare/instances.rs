//! EXT_mesh_gpu_instancing.

use serde_json::json;

use super::{first_triangles, require};
use crate::import::test_document::TestDocument;

const BYTE: u32 = 5120;
const SHORT: u32 = 5122;

fn instanced(document: &mut TestDocument, attributes: serde_json::Value) {
    require(document, "EXT_mesh_gpu_instancing");
    document.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"] = json!({ "attributes": attributes });
}

#[test]
fn instances_are_nodes_below_theirs() {
    let mut document = TestDocument::square();
    let translation = document.vectors(&[[0.0, 0.0, 1.0], [5.0, 0.0, 0.0]]);
    // A quarter turn about z, and none.
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let rotation = document.floats("VEC4", &[[0.0, 0.0, half, half], [0.0, 0.0, 0.0, 1.0]]);
    let scale = document.vectors(&[[1.0, 1.0, 1.0], [2.0, 3.0, 1.0]]);
    instanced(&mut document, json!({ "TRANSLATION": translation, "ROTATION": rotation, "SCALE": scale }));
    document.root["nodes"][0]["translation"] = json!([0, 10, 0]);
    let scene = document.scene();
    assert_eq!(
        first_triangles(&scene),
        [
            (1, [[0.0, 10.0, 1.0], [0.0, 11.0, 1.0], [-1.0, 11.0, 1.0]]),
            (2, [[5.0, 10.0, 0.0], [7.0, 10.0, 0.0], [7.0, 13.0, 0.0]]),
        ]
    );
    let root = &scene.source.root;
    assert!(root.extensions_used.is_empty() && root.extensions_required.is_empty());
    assert_eq!(root.nodes[0].mesh, None);
    let names: Vec<_> = root.nodes.iter().map(|node| node.name.clone().unwrap()).collect();
    assert_eq!(names, ["thing", "thing/0", "thing/1"]);
}

#[test]
fn rotations_of_integers() {
    for (component, bytes) in [(BYTE, vec![0, 0, 90, 90]), (SHORT, vec![0, 0, 0, 0, 0x82, 0x5a, 0x82, 0x5a])]
    {
        let mut document = TestDocument::square();
        let rotation = document.accessor(&bytes, component, "VEC4", 1);
        document.root["accessors"][rotation]["normalized"] = true.into();
        instanced(&mut document, json!({ "ROTATION": rotation }));
        let [(_, triangle)] = first_triangles(&document.scene())[..] else { panic!() };
        assert_eq!(triangle, [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]);
    }
}

#[test]
fn attributes_that_do_not_fit_are_errors() {
    let mut document = TestDocument::square();
    let (two, three) = (document.vectors(&[[0.0; 3]; 2]), document.vectors(&[[1.0; 3]; 3]));
    instanced(&mut document, json!({ "TRANSLATION": two, "SCALE": three }));
    let message = document.problem().to_string();
    assert!(message.contains("the instances of node \"thing\"") && message.contains("differ"), "{message}");

    for wrong in [1, 99] {
        let mut document = TestDocument::square();
        instanced(&mut document, json!({ "TRANSLATION": wrong }));
        let message = document.problem().to_string();
        assert!(message.contains("TRANSLATION of the instances of node \"thing\""), "{message}");
    }
}

#[test]
fn other_attributes_alone_change_nothing() {
    let mut document = TestDocument::square();
    instanced(&mut document, json!({ "_ID": 1 }));
    let scene = document.scene();
    assert_eq!(scene.surfaces.len(), 1);
    assert_eq!(scene.surfaces[0].node, 0);
}
