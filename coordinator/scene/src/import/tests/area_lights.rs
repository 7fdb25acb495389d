//! EXT_lights_area.

use std::f64::consts::PI;

use glam::DVec3;
use serde_json::{Value, json};

use crate::import::test_document::TestDocument;
use crate::import::{ImportOptions, LightUnit, import_slice};
use crate::light::{AreaLight, AreaShape, LightEntry, LightKind};
use crate::model::Scene;

const NAME: &str = "EXT_lights_area";

/// A square with a node of an area light.
fn lit_by(light: Value, mut node: Value) -> TestDocument {
    let mut document = TestDocument::square();
    document.root["extensionsUsed"] = json!([NAME]);
    document.root["extensionsRequired"] = json!([NAME]);
    document.root["extensions"] = json!({ NAME: { "lights": [light] } });
    node["extensions"] = json!({ NAME: { "light": 0 } });
    document.root_node(node);
    document
}

/// The only light, with its middle and sides in the world.
fn area(scene: &Scene) -> AreaLight {
    let [light] = scene.lights.as_slice() else { panic!("{:?}", scene.lights) };
    let LightKind::Area(area) = light.kind else { panic!("{light:?}") };
    let scale = scene.frame.scale;
    AreaLight {
        centre: scene.frame.to_world(area.centre),
        across: area.across * scale,
        along: area.along * scale,
        ..area
    }
}

#[test]
fn defaults_are_those_of_the_draft() {
    for (kind, shape) in [("rect", AreaShape::Rectangle), ("disk", AreaShape::Disk)] {
        let scene = lit_by(json!({ "type": kind }), json!({})).scene();
        let light = area(&scene);
        assert_eq!(light.shape, shape);
        assert_eq!((light.across.length(), light.along.length(), light.normal()), (0.5, 0.5, DVec3::NEG_Z));
        assert_eq!(scene.lights[0].intensity, DVec3::splat(1000.0));
        assert_eq!(scene.lights[0].entry, LightEntry::Area(0));
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        assert_eq!(scene.source.root.extensions_required, [NAME]);
    }
}

#[test]
fn the_largest_scale_of_a_node_scales_its_light_evenly() {
    let half = 0.5_f64.sqrt();
    let light = json!({ "type": "rect", "size": 2.0, "rect": { "aspect": 3.0 }, "color": [1.0, 0.5, 0.25], "intensity": 8.0 });
    let turned = |scale: Value| json!({ "name": "panel", "rotation": [-half, 0.0, 0.0, half], "scale": scale, "translation": [0, 5, 0] });
    for scale in
        [json!([1.0, 0.5, -0.25]), json!([-0.5, 1.0, 0.5]), json!([0.0, 1.0, 0.5]), json!([1.0, 0.0, 1.0])]
    {
        let mirrored = scale[2] == -0.25;
        let scene = lit_by(light.clone(), turned(scale.clone())).scene();
        let own = area(&scene);
        assert!(
            (own.across.length() - 3.0).abs() <= 1e-6 && (own.along.length() - 1.0).abs() <= 1e-6,
            "{own:?}"
        );
        let front = if mirrored { DVec3::Y } else { DVec3::NEG_Y };
        assert!(own.normal().distance(front) <= 1e-6, "{scale}: {own:?}");
        assert!(own.across.cross(DVec3::X).length() <= 1e-6, "{own:?}");
        assert_eq!(own.centre, DVec3::Y * 5.0);
        assert_eq!(scene.lights[0].intensity, DVec3::new(8.0, 4.0, 2.0));
        let flux = scene.lights[0].flux(&scene.frame).x;
        assert!((flux / (PI * 8.0 * 12.0) - 1.0).abs() <= 1e-6, "{flux}");
    }
}

#[test]
fn watts_leave_radiances_as_they_are() {
    let options = ImportOptions { light_unit: LightUnit::Watt, ..ImportOptions::default() };
    let document = lit_by(json!({ "type": "disk", "intensity": 5.0 }), json!({}));
    assert_eq!(import_slice(&document.glb(), &options).unwrap().lights[0].intensity, DVec3::splat(5.0));
}

#[test]
fn lights_in_a_surface_share_its_plane() {
    let scene =
        lit_by(json!({ "type": "rect", "size": 0.1 }), json!({ "translation": [0.5, 0.5, 0] })).scene();
    assert_eq!(area(&scene).plane, scene.surfaces[0].facets[0].plane);
    let scene = lit_by(json!({ "type": "rect" }), json!({ "translation": [0, 0, 1] })).scene();
    assert_ne!(area(&scene).plane, scene.surfaces[0].facets[0].plane);
    assert!(area(&scene).plane.0 < scene.plane_count);
}

#[test]
fn the_report_counts_lights_by_their_shape() {
    let mut document = lit_by(json!({ "type": "disk" }), json!({}));
    document.root["extensions"][NAME]["lights"].as_array_mut().unwrap().push(json!({ "type": "rect" }));
    for _ in 0..2 {
        document.root_node(json!({ "extensions": { NAME: { "light": 1 } }, "translation": [0, 0, 1] }));
    }
    let modelled = document.scene().account.modelled;
    assert!(
        modelled.ends_with(&["2 rectangular area lights".into(), "1 disk area light".into()]),
        "{modelled:?}"
    );
}

#[test]
fn lights_without_a_direction_or_size_are_left_out_with_a_warning() {
    let light = json!({ "type": "rect", "size": 1e-30 });
    for (node, why) in [
        (json!({ "name": "flat", "scale": [1, 1, 0] }), "scaled to zero"),
        (json!({ "name": "flat", "scale": [0, 0, 1] }), "scaled to zero"),
        (json!({ "name": "flat", "scale": [0, 0, 0] }), "scaled to zero"),
        (json!({ "name": "flat", "translation": [1, 1, 1] }), "too small"),
        (json!({ "name": "flat", "scale": [1e38, 1e38, 1e38] }), ""),
        (json!({ "name": "flat", "translation": [1e38, 1, 1] }), "too far"),
    ] {
        let scene = lit_by(light.clone(), node.clone()).scene();
        if why.is_empty() {
            continue;
        }
        assert!(scene.lights.is_empty(), "{node}: {:?}", scene.lights);
        let [warning] = scene.warnings.as_slice() else { panic!("{:?}", scene.warnings) };
        assert!(warning.starts_with("node \"flat\": light left out") && warning.contains(why), "{warning}");
    }
}

#[test]
fn bad_lights_are_errors_that_name_their_node() {
    let node = json!({ "name": "panel" });
    for (light, why) in [
        (json!({}), "type is missing"),
        (json!({ "type": "sphere" }), "unknown variant `sphere`"),
        (json!({ "type": 3 }), "expected"),
        (json!({ "shape": "rect", "width": 1.0 }), "type is missing"),
        (json!({ "type": "rect", "size": 0.0 }), "size is 0"),
        (json!({ "type": "disk", "size": -1.0 }), "size is -1"),
        (json!({ "type": "rect", "size": 1e39 }), "size is inf"),
        (json!({ "type": "rect", "size": "1" }), "invalid type: string"),
        (json!({ "type": "rect", "rect": { "aspect": 0 } }), "aspect is 0"),
        (json!({ "type": "rect", "rect": 2 }), "invalid type"),
        (json!({ "type": "rect", "intensity": -1 }), "intensity is -1"),
        (json!({ "type": "rect", "intensity": null }), "invalid type: null"),
        (json!({ "type": "rect", "color": [1, -1, 1] }), "color is -1"),
        (json!({ "type": "rect", "color": [1, 1] }), "invalid length 2"),
        (json!(7), "invalid type"),
    ] {
        let problem = lit_by(light.clone(), node.clone()).problem().to_string();
        assert!(problem.contains("node \"panel\"") && problem.contains(why), "{light}: {problem}");
    }
    type Damage = fn(&mut Value);
    let damages: [(Damage, &str); 6] = [
        (|root| root["nodes"][1]["extensions"][NAME]["light"] = json!(1), "light 1 of 1"),
        (|root| root["nodes"][1]["extensions"][NAME]["light"] = json!(-1), "does not say which"),
        (|root| root["nodes"][1]["extensions"][NAME] = json!([]), "does not say which"),
        (|root| root["extensions"] = json!({}), "no list"),
        (|root| root["extensions"][NAME] = json!({}), "no list"),
        (|root| root["extensions"][NAME]["lights"] = json!({ "0": 1 }), "no list"),
    ];
    for (damage, why) in damages {
        let mut document = lit_by(json!({ "type": "rect" }), node.clone());
        damage(&mut document.root);
        let problem = document.problem().to_string();
        assert!(problem.contains("node \"panel\"") && problem.contains(why), "{problem}");
    }
}

/// In the document too: brightness and colour that were not there, and those that were.
#[test]
fn entries_are_multiplied_in_the_document() {
    for (light, colour, intensity) in [
        (json!({ "type": "rect" }), [0.25, 1.0, 0.5], 2000.0),
        (json!({ "type": "rect", "color": [0.5, 0.25, 0.0], "intensity": 4.0 }), [0.25, 0.5, 0.0], 4.0),
    ] {
        let scene = lit_by(light, json!({})).scene();
        let mut root = scene.source.root.clone();
        scene.lights[0].entry.multiply(&mut root, DVec3::new(0.5, 2.0, 1.0));
        let light = &root.extensions.unwrap().others[NAME]["lights"][0];
        assert_eq!((&light["color"], &light["intensity"]), (&json!(colour), &json!(intensity)));
    }
}
