//! KHR_lights_punctual.

use glam::DVec3;
use serde_json::{Value, json};

use crate::import::test_document::TestDocument;
use crate::import::{ImportOptions, ImportProblem, LightUnit, import_slice};
use crate::light::LightKind;

#[test]
fn point_light_stands_where_its_node_does() {
    let mut document = TestDocument::square();
    let light = json!({ "type": "point", "intensity": 8.0, "color": [1.0, 0.5, 0.25] });
    document.light(light, json!({ "name": "bulb", "translation": [1, 0, 0] }));
    // Put it under a node that is scaled and moved: only its position is inherited.
    document.root["scenes"][0]["nodes"] = json!([0]);
    document.root_node(json!({ "children": [1], "scale": [3, 3, 3], "translation": [0, 0, 5] }));
    let scene = document.scene();
    let light = &scene.lights[0];
    assert_eq!(scene.frame.to_world(light.kind.position().unwrap()), DVec3::new(3.0, 0.0, 5.0));
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
    assert_eq!(scene.frame.to_world(scene.lights[0].kind.position().unwrap()), DVec3::new(0.5, 0.5, 100.0));
}

/// A square and a light of this kind whose nodes are these, the first of them first.
fn lit_by(light: Value, nodes: &[Value]) -> TestDocument {
    let mut document = TestDocument::square();
    document.light(light, nodes[0].clone());
    for node in &nodes[1..] {
        let mut node = node.clone();
        node["extensions"] = json!({ "KHR_lights_punctual": { "light": 0 } });
        document.root_node(node);
    }
    document
}

/// One light at several nodes shines from each, along the -Z axis, however the node is scaled or mirrored.
#[test]
fn lights_shine_along_the_axis_of_each_node() {
    let half = 0.5_f64.sqrt();
    let nodes = [
        json!({}),
        json!({ "rotation": [-half, 0.0, 0.0, half], "scale": [2.0, 0.001, 3.0] }),
        json!({ "rotation": [0.0, half, 0.0, half], "scale": [-1.0, 1.0, 1e-30], "translation": [1, 2, 3] }),
        json!({ "scale": [1.0, 1.0, -2.0] }),
    ];
    let axes = [DVec3::NEG_Z, DVec3::NEG_Y, DVec3::NEG_X, DVec3::Z];
    let spot = json!({ "type": "spot", "intensity": 3.0, "spot": { "innerConeAngle": 0.25, "outerConeAngle": 0.5 } });
    let scene = lit_by(spot, &nodes).scene();
    assert_eq!(scene.lights.len(), 4);
    for (light, axis) in scene.lights.iter().zip(axes) {
        let LightKind::Spot(spot) = light.kind else { panic!("{light:?}") };
        assert!(spot.direction.distance(axis) <= 1e-7, "{spot:?}, not {axis}");
        assert_eq!((spot.inner_cosine, spot.outer_cosine), (0.25_f64.cos(), 0.5_f64.cos()));
        assert_eq!(light.intensity, DVec3::splat(3.0));
    }
    let position = scene.lights[2].kind.position().unwrap();
    assert_eq!(scene.frame.to_world(position), DVec3::new(1.0, 2.0, 3.0));
    let scene = lit_by(json!({ "type": "directional", "intensity": 3.0 }), &nodes).scene();
    for (light, axis) in scene.lights.iter().zip(axes) {
        let LightKind::Directional { along } = light.kind else { panic!("{light:?}") };
        assert!(along.distance(axis) <= 1e-7, "{along}, not {axis}");
        assert_eq!(light.kind.position(), None);
    }
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn a_spot_light_has_the_cones_of_the_specification_where_the_file_has_none() {
    let scene = lit_by(json!({ "type": "spot", "spot": {} }), &[json!({})]).scene();
    let LightKind::Spot(spot) = scene.lights[0].kind else { panic!("{:?}", scene.lights) };
    assert_eq!(spot.inner_cosine, 1.0);
    assert!((spot.outer_cosine - 0.5_f64.sqrt()).abs() <= 1e-7);
}

#[test]
fn cones_out_of_range_are_errors() {
    for (inner, outer) in [(0.0, 0.0), (0.0, 1.6), (0.6, 0.5), (-0.1, 0.5), (0.0, -1.0)] {
        let spot = json!({ "innerConeAngle": inner, "outerConeAngle": outer });
        let problem = lit_by(json!({ "type": "spot", "spot": spot }), &[json!({ "name": "beam" })]).problem();
        assert!(matches!(problem, ImportProblem::Factor { .. }), "{problem}");
        assert!(problem.to_string().contains("node \"beam\""), "{problem}");
    }
    // A half turn as f32 has it, and a cone without a soft edge.
    let wide = json!({ "innerConeAngle": std::f32::consts::FRAC_PI_2, "outerConeAngle": std::f32::consts::FRAC_PI_2 });
    let scene = lit_by(json!({ "type": "spot", "spot": wide }), &[json!({})]).scene();
    let LightKind::Spot(spot) = scene.lights[0].kind else { panic!("{:?}", scene.lights) };
    assert_eq!((spot.inner_cosine, spot.outer_cosine), (0.0, 0.0));
}

#[test]
fn ranges_are_ignored_and_a_light_without_a_direction_is_left_out_with_a_warning() {
    let flat = json!({ "name": "flat", "scale": [1, 1, 0] });
    let scene = lit_by(json!({ "type": "directional", "range": 3.0 }), &[json!({}), json!({}), flat]).scene();
    assert_eq!((scene.lights.len(), scene.warnings.len()), (2, 2), "{:?}", scene.warnings);
    assert!(scene.warnings[0].starts_with("light 0: range ignored"), "{:?}", scene.warnings);
    assert!(scene.warnings[1].starts_with("node \"flat\": light left out"), "{:?}", scene.warnings);
}

#[test]
fn watts_are_spread_over_the_sphere() {
    let options = ImportOptions { light_unit: LightUnit::Watt, ..ImportOptions::default() };
    for (kind, expected) in [("point", 1.0), ("spot", 1.0), ("directional", 4.0 * std::f64::consts::PI)] {
        let light = json!({ "type": kind, "intensity": 4.0 * std::f64::consts::PI, "spot": {} });
        let scene = import_slice(&lit_by(light, &[json!({})]).glb(), &options).unwrap();
        assert!((scene.lights[0].intensity.x / expected - 1.0).abs() <= 1e-7, "{kind}");
    }
}

/// Of a point light in watts, Blender writes W / (4 pi), times 683 in its mode Standard.
#[test]
fn lamps_of_blender_are_watts_in_both_modes_of_its_exporter() {
    for (unit, factor) in [(LightUnit::Blender, 683.0), (LightUnit::BlenderUnitless, 1.0)] {
        for kind in ["point", "spot", "directional"] {
            let light = json!({ "type": kind, "intensity": 2.0 * factor, "spot": {} });
            let options = ImportOptions { light_unit: unit, ..ImportOptions::default() };
            let scene = import_slice(&lit_by(light, &[json!({})]).glb(), &options).unwrap();
            assert!((scene.lights[0].intensity.x - 2.0).abs() <= 1e-6, "{kind}, {unit:?}");
        }
    }
}

#[test]
fn lamps_of_blender_far_from_emission_are_warned_of_with_the_other_unit() {
    // The square emits pi.
    let warnings = |generator: &str, kind: &str, intensity: f64, unit| {
        let mut document = lit_by(json!({ "type": kind, "intensity": intensity, "spot": {} }), &[json!({})]);
        document.root["asset"]["generator"] = json!(generator);
        let options = ImportOptions { light_unit: unit, ..ImportOptions::default() };
        import_slice(&document.glb(), &options).unwrap().warnings
    };
    let blender = "Khronos glTF Blender I/O v4.5.48";
    for (kind, watts) in [("point", 0.25), ("spot", 0.9), ("directional", 4.0)] {
        let standard = warnings(blender, kind, watts * 683.0, LightUnit::Candela);
        assert!(standard[0].ends_with("mode Standard, give --light-unit blender"), "{standard:?}");
        assert_eq!(warnings(blender, kind, watts * 683.0, LightUnit::Blender), [""; 0]);
        assert_eq!(warnings(blender, kind, watts, LightUnit::Candela), [""; 0]);
        assert_eq!(warnings(blender, kind, watts, LightUnit::BlenderUnitless), [""; 0]);
        let unitless = warnings(blender, kind, watts, LightUnit::Blender);
        assert!(unitless[0].ends_with("mode Unitless, give --light-unit blender-unitless"), "{unitless:?}");
        assert_eq!(warnings("another exporter", kind, watts * 683.0, LightUnit::Candela), [""; 0]);
    }
}

#[test]
fn sky_is_light_enough() {
    let mut document = TestDocument::square();
    document.root["materials"][0]["emissiveFactor"] = json!([0, 0, 0]);
    assert!(matches!(document.problem(), ImportProblem::NoLight));
    let options = ImportOptions { sky: DVec3::new(0.0, 0.0, 1.0), ..ImportOptions::default() };
    assert_eq!(import_slice(&document.glb(), &options).unwrap().sky, DVec3::Z);
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
