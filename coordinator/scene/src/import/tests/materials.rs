//! Reflectance, exitance, and what is said about them.

use std::f64::consts::PI;

use glam::DVec3;
use serde_json::{Value, json};

use crate::import::ImportProblem;
use crate::import::test_document::{SQUARE, TestDocument};
use crate::model::Scene;

/// A lit square of this material, beside a lamp.
fn document_with(material: Value) -> TestDocument {
    let mut document = TestDocument::square();
    let material = document.push("materials", material);
    document.node_with(json!({ "attributes": { "POSITION": 0 }, "indices": 1, "material": material }));
    document
}

fn scene_with(material: Value) -> Scene {
    document_with(material).scene()
}

#[test]
fn reflectance_is_base_colour_times_what_is_not_metallic() {
    let scene = scene_with(json!({
        "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.25, 0.125, 1.0], "metallicFactor": 0.5 },
    }));
    assert_eq!(scene.surfaces[1].reflectance, DVec3::new(0.25, 0.125, 0.0625));
    assert_eq!(scene.surfaces[1].exitance, DVec3::ZERO);
    assert!(scene.warnings.is_empty());
}

#[test]
fn exitance_is_pi_times_emission() {
    let scene = scene_with(json!({
        "emissiveFactor": [1.0, 0.5, 0.25],
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 8.0 } },
    }));
    assert_eq!(scene.surfaces[1].exitance, PI * DVec3::new(8.0, 4.0, 2.0));
    assert_eq!(scene.surfaces[0].exitance, PI * DVec3::ONE);
}

#[test]
fn default_material_is_metallic() {
    let mut document = TestDocument::square();
    document.node_with(json!({ "attributes": { "POSITION": 0 }, "indices": 1 }));
    let scene = document.scene();
    assert_eq!(scene.surfaces[1].reflectance, DVec3::ZERO);
    assert!(scene.warnings[0].starts_with("the default material: fully metallic"), "{:?}", scene.warnings);
    let scene = scene_with(json!({ "name": "steel" }));
    assert!(scene.warnings[0].contains("\"steel\": fully metallic"), "{:?}", scene.warnings);
}

#[test]
fn reflectance_of_one_is_clamped_with_one_warning_per_material() {
    let mut document =
        document_with(json!({ "name": "snow", "pbrMetallicRoughness": { "metallicFactor": 0.0 } }));
    document.root_node(json!({ "mesh": 1, "translation": [0, 0, 1] }));
    let scene = document.scene();
    assert_eq!(scene.surfaces[1].reflectance, DVec3::splat(0.999));
    assert_eq!(scene.surfaces[2].reflectance, DVec3::splat(0.999));
    assert_eq!(scene.warnings, ["material \"snow\": reflectance clamped from 1.000 to 0.999"]);
}

#[test]
fn only_the_channels_that_reach_one_are_clamped() {
    let scene = scene_with(json!({
        "pbrMetallicRoughness": { "baseColorFactor": [2.0, 0.5, 0.0, 1.0], "metallicFactor": 0.0 },
    }));
    assert_eq!(scene.surfaces[1].reflectance, DVec3::new(0.999, 0.5, 0.0));
    assert_eq!(scene.warnings.len(), 1);
}

#[test]
fn factors_out_of_range_are_errors() {
    let strength = |strength: Value| {
        let extension = json!({ "emissiveStrength": strength });
        json!({ "name": "odd", "extensions": { "KHR_materials_emissive_strength": extension } })
    };
    let base =
        |colour: Value| json!({ "name": "odd", "pbrMetallicRoughness": { "baseColorFactor": colour } });
    let metallic =
        |value: Value| json!({ "name": "odd", "pbrMetallicRoughness": { "metallicFactor": value } });
    let cases = [
        ("baseColorFactor", base(json!([-0.1, 0, 0, 1]))),
        ("baseColorFactor", base(json!([0, 1e39, 0, 1]))),
        ("metallicFactor", metallic(json!(-1))),
        ("metallicFactor", metallic(json!(1.5))),
        ("emissiveFactor", json!({ "name": "odd", "emissiveFactor": [0, 0, -1] })),
        ("emissiveStrength", strength(json!(-2))),
        ("emissiveStrength", strength(json!(1e39))),
    ];
    for (name, material) in cases {
        let problem = document_with(material).problem();
        assert!(
            matches!(&problem, ImportProblem::Factor { factor, .. } if *factor == name),
            "{name}: {problem}"
        );
        assert!(problem.to_string().contains("material \"odd\""), "{problem}");
    }
}

#[test]
fn materials_that_no_triangle_uses_do_not_matter() {
    let mut document = TestDocument::square();
    document.push("materials", json!({ "emissiveFactor": [-1, -1, -1] }));
    assert_eq!(document.scene().surfaces.len(), 1);
}

#[test]
fn double_sided_material_makes_two_surfaces() {
    use crate::model::Side;

    let mut document = TestDocument::square();
    document.root["materials"][0]["doubleSided"] = true.into();
    let scene = document.scene();
    let [front, back] = &scene.surfaces[..] else { panic!("{} surfaces", scene.surfaces.len()) };
    assert_eq!((front.side, back.side), (Side::Front, Side::Back));
    let (front, back) = (&front.facets[0], &back.facets[0]);
    assert_eq!((front.normal, back.normal), (DVec3::Z, DVec3::NEG_Z));
    assert_eq!((front.plane, scene.plane_count), (back.plane, 1));
    let reversed: Vec<DVec3> = back.corners.iter().rev().map(|corner| corner.position).collect();
    assert_eq!(front.corners.iter().map(|corner| corner.position).collect::<Vec<_>>(), reversed);
    assert!(back.corners.iter().all(|corner| corner.normal == DVec3::NEG_Z));
    for triangle in &back.triangles {
        let [a, b, c] = triangle.positions;
        assert!((b - a).cross(c - a).z < 0.0);
        let as_in_file = triangle
            .vertices
            .map(|vertex| scene.frame.to_frame(DVec3::from_array(SQUARE[vertex as usize].map(f64::from))));
        assert_eq!(triangle.positions, as_in_file);
    }
}
