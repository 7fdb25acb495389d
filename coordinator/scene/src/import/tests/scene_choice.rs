//! Files of several scenes.

use serde_json::json;

use crate::import::import_slice;
use crate::import::test_document::{TestDocument, limited};
use crate::model::Scene;
use document::ImportProblem;
use document::ReadOptions;

/// A lamp in scene 0, two in the default scene 1, and a point light in a scene that is called "0".
fn document() -> TestDocument {
    let mut document = TestDocument::square();
    document.light(json!({ "type": "point" }), json!({ "name": "bulb" }));
    document.push("nodes", json!({ "name": "second", "mesh": 0, "translation": [0, 0, 1] }));
    document.root["scenes"] = json!([
        { "name": "one", "nodes": [0] }, { "name": "both", "nodes": [0, 2] }, { "name": "0", "nodes": [0, 1] },
        { "name": "twice", "nodes": [] }, { "name": "twice", "nodes": [] },
    ]);
    document.root["scene"] = 1.into();
    document
}

fn read(document: &TestDocument, scene: Option<&str>) -> Result<Scene, ImportProblem> {
    let options = limited(ReadOptions { scene: scene.map(str::to_owned), ..ReadOptions::default() });
    import_slice(&document.glb(), &options).map_err(|error| *error.problem)
}

#[test]
fn scenes_go_by_name_and_by_index() {
    let document = document();
    let sizes = |scene: Option<&str>| {
        let scene = read(&document, scene).unwrap();
        let default = scene.source.root.scene.unwrap().value();
        (scene.surfaces.len(), scene.lights.len(), default)
    };
    assert_eq!(sizes(None), (2, 0, 1));
    assert_eq!(sizes(Some("one")), (1, 0, 0));
    assert_eq!(sizes(Some("both")), (2, 0, 1));
    // A name comes before an index.
    assert_eq!(sizes(Some("0")), (1, 1, 2));
    assert_eq!(sizes(Some("1")), (2, 0, 1));
}

#[test]
fn what_is_not_chosen_stays_in_the_document() {
    let scene = read(&document(), Some("one")).unwrap();
    assert_eq!(scene.source.root.scenes.len(), 5);
    assert_eq!(scene.source.root.nodes.len(), 3);
    assert_eq!(scene.surfaces[0].node, 0);
}

/// A scene may state no nodes, as the specification has it.
#[test]
fn scenes_without_nodes_do_not_hide_the_others() {
    let mut document = TestDocument::square();
    document.root["scenes"] = json!([{ "nodes": [0] }, { "name": "empty" }]);
    assert_eq!(read(&document, None).unwrap().source.root.scenes.len(), 2);
    let problem = read(&document, Some("empty")).unwrap_err();
    assert_eq!(problem.to_string(), ImportProblem::NoTriangles.to_string());
}

#[test]
fn a_scene_that_is_not_there_is_named_with_those_that_are() {
    for wanted in ["garden", "5", "-1", ""] {
        let message = read(&document(), Some(wanted)).unwrap_err().to_string();
        let expected =
            format!("no scene `{wanted}`, but 0 \"one\", 1 \"both\", 2 \"0\", 3 \"twice\" and 4 \"twice\"");
        assert!(message.contains(&expected) && message.contains("--scene"), "{message}");
    }
    let message = read(&document(), Some("twice")).unwrap_err().to_string();
    assert!(message.contains("several scenes `twice`") && message.contains("by its index"), "{message}");
    assert_eq!(read(&document(), Some("3")).unwrap_err().to_string(), ImportProblem::NoTriangles.to_string());
}

#[test]
fn long_lists_of_scenes_are_cut() {
    let mut document = TestDocument::square();
    document.root["scenes"] = (0..30).map(|_| json!({ "nodes": [0] })).collect();
    let message = read(&document, Some("x")).unwrap_err().to_string();
    assert!(message.contains(" 18, 19 and 10 more;"), "{message}");
}
