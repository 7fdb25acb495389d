//! KHR_lights_punctual.

use glam::DVec3;
use serde_json::json;

use crate::import::ImportProblem;
use crate::import::test_document::TestDocument;

#[test]
fn point_light_stands_where_its_node_does() {
    let mut document = TestDocument::square();
    let light = json!({ "type": "point", "intensity": 8.0, "color": [1.0, 0.5, 0.25] });
    document.light(light, json!({ "name": "bulb", "translation": [1, 0, 0] }));
    // Put it under a node that is scaled and moved: only its position is inherited.
    document.root["scenes"][0]["nodes"] = json!([0]);
    document.root_node(json!({ "children": [1], "scale": [3, 3, 3], "translation": [0, 0, 5] }));
    let scene = document.scene();
    let light = &scene.point_lights[0];
    assert_eq!(scene.frame.to_world(light.position), DVec3::new(3.0, 0.0, 5.0));
    assert_eq!(light.intensity, DVec3::new(8.0, 4.0, 2.0));
    assert_eq!(light.name, "node \"bulb\"");
}

#[test]
fn a_light_far_away_does_not_make_the_surfaces_small() {
    let mut document = TestDocument::square();
    document.light(json!({ "type": "point" }), json!({ "translation": [0.5, 0.5, 100] }));
    let scene = document.scene();
    assert_eq!(scene.frame.centre, DVec3::new(0.5, 0.5, 0.0));
    assert_eq!(scene.frame.scale, 1.0 / 1024.0);
    assert_eq!(scene.frame.to_world(scene.point_lights[0].position), DVec3::new(0.5, 0.5, 100.0));
}

#[test]
fn other_kinds_are_left_out_with_a_warning() {
    for kind in ["spot", "directional"] {
        let mut document = TestDocument::square();
        document.light(json!({ "type": kind, "spot": {} }), json!({ "name": "beam" }));
        let scene = document.scene();
        assert!(scene.point_lights.is_empty());
        assert_eq!(scene.warnings.len(), 1);
        let expected = format!("node \"beam\": {kind} light left out, not modelled yet");
        assert!(scene.warnings[0].starts_with(&expected), "{:?}", scene.warnings);
    }
}

#[test]
fn light_factors_out_of_range_are_errors() {
    for light in
        [json!({ "type": "point", "intensity": -1 }), json!({ "type": "point", "color": [0, 1e39, 0] })]
    {
        let mut document = TestDocument::square();
        document.light(light, json!({ "name": "bulb" }));
        let problem = document.problem();
        assert!(matches!(problem, ImportProblem::Factor { .. }), "{problem}");
        assert!(problem.to_string().contains("node \"bulb\""), "{problem}");
    }
}
