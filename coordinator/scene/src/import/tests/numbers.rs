//! Numbers that no light survives, found before the bake.

use serde_json::{Value, json};

use crate::import::ImportProblem;
use crate::import::test_document::{SQUARE, SQUARE_INDICES, TestDocument};

/// The square with an attribute of these floats.
fn with_attribute<const N: usize>(name: &str, shape: &str, values: &[[f32; N]]) -> TestDocument {
    let mut document = TestDocument::square();
    let accessor = document.floats(shape, values);
    document.root["meshes"][0]["primitives"][0]["attributes"][name] = accessor.into();
    document
}

fn assert_names(problem: &ImportProblem, words: &[&str]) {
    let message = problem.to_string();
    for word in words {
        assert!(message.contains(word), "`{word}` is not in: {message}");
    }
}

#[test]
fn attributes_that_the_output_takes_over_are_finite() {
    for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let (mut pair, mut four) = ([[0.5; 2]; 4], [[0.5; 4]; 4]);
        (pair[2][1], four[2][3]) = (wrong, wrong);
        let documents = [
            ("TEXCOORD_0", with_attribute("TEXCOORD_0", "VEC2", &pair)),
            ("TEXCOORD_3", with_attribute("TEXCOORD_3", "VEC2", &pair)),
            ("COLOR_0", with_attribute("COLOR_0", "VEC4", &four)),
            ("COLOR_1", with_attribute("COLOR_1", "VEC4", &four)),
            ("TANGENT", with_attribute("TANGENT", "VEC4", &four)),
            ("_WEAR", with_attribute("_WEAR", "SCALAR", &[[0.0], [0.0], [wrong], [0.0]])),
        ];
        for (name, document) in documents {
            let problem = document.problem();
            assert!(
                matches!(problem, ImportProblem::NonFiniteAttribute { vertex: 2, .. }),
                "{name}: {problem}"
            );
            assert_names(&problem, &["node \"thing\", primitive 0", name, "repair or remove"]);
        }
        // Light of an earlier bake is not taken over, nor are matrices.
        with_attribute("_IRRADIANCE", "VEC3", &[[wrong; 3]; 4]).scene();
        with_attribute("_FRAME", "MAT4", &[[wrong; 16]; 4]).scene();
    }
}

#[test]
fn animations_are_finite() {
    for wrong in [f32::NAN, f32::INFINITY] {
        for (what, times, values) in
            [("times", [0.0, wrong], [[1.0; 3]; 2]), ("values", [0.0, 1.0], [[wrong; 3]; 2])]
        {
            let mut document = TestDocument::square();
            let times = document.floats("SCALAR", &times.map(|time| [time]));
            let values = document.floats("VEC3", &values);
            document.root["animations"] = json!([{
                "name": "rise",
                "samplers": [{ "input": times, "output": values }],
                "channels": [{ "sampler": 0, "target": { "node": 0, "path": "translation" } }],
            }]);
            let problem = document.problem();
            assert!(matches!(problem, ImportProblem::NonFiniteAnimation { .. }), "{problem}");
            assert_names(&problem, &["animation \"rise\", sampler 0", what, "repair or remove"]);
        }
    }
}

/// JSON has numbers that no float can hold.
#[test]
fn transforms_of_textures_are_finite() {
    let transforms = [
        ("scale", json!({ "scale": [1, 1e39] })),
        ("offset", json!({ "offset": [-1e39, 0] })),
        ("rotation", json!({ "rotation": 1e39 })),
    ];
    let glossy = "KHR_materials_pbrSpecularGlossiness";
    for (name, transform) in transforms {
        let texture = json!({ "index": 0, "extensions": { "KHR_texture_transform": transform } });
        let materials = [
            json!({ "pbrMetallicRoughness": { "baseColorTexture": texture } }),
            json!({ "pbrMetallicRoughness": { "metallicRoughnessTexture": texture } }),
            json!({ "emissiveTexture": texture }),
            json!({ "extensions": { glossy: { "diffuseTexture": texture } } }),
            json!({ "extensions": { glossy: { "specularGlossinessTexture": texture } } }),
            json!({ "extensions": { "KHR_materials_specular": { "specularTexture": texture } } }),
            json!({ "extensions": { "KHR_materials_specular": { "specularColorTexture": texture } } }),
        ];
        for mut material in materials {
            let mut document = TestDocument::square();
            material["name"] = "cloth".into();
            document.root["images"] = json!([{ "uri": "none.png" }]);
            document.root["textures"] = json!([{ "source": 0 }]);
            document.root["materials"] = json!([material]);
            let problem = document.problem();
            let is_it = matches!(problem, ImportProblem::Factor { factor, .. } if factor == name);
            assert!(is_it, "{material}: {problem}");
            assert_names(&problem, &["material \"cloth\"", "inf", "it must be finite"]);
        }
    }
}

#[test]
fn attributes_of_the_application_lie_within_their_buffers() {
    let mut document = with_attribute("_WEAR", "SCALAR", &[[0.0]; 4]);
    document.root["accessors"][2]["byteOffset"] = 4.into();
    assert!(matches!(document.problem(), ImportProblem::AccessorOutOfBounds { accessor: 2, .. }));
    let document = with_attribute("_WEAR", "SCALAR", &[[0.0]; 3]);
    assert!(matches!(document.problem(), ImportProblem::AttributeCount { found: 3, expected: 4, .. }));
}

#[test]
fn places_of_sparse_accessors_are_in_range_and_in_order() {
    let moved = |places: &[u32]| {
        let mut document = TestDocument::square();
        let values = document.vectors(&vec![[0.5, 0.5, 0.0]; places.len()]);
        let places = document.indices(places);
        document.root["accessors"][0]["sparse"] = json!({
            "count": document.root["accessors"][places]["count"],
            "indices": { "bufferView": places, "componentType": 5125 },
            "values": { "bufferView": values },
        });
        document
    };
    moved(&[1, 2]).scene();
    for (places, wrong) in [([1, 4], 4), ([2, 1], 1), ([3, 3], 3), ([u32::MAX, 0], u32::MAX)] {
        let problem = moved(&places).problem();
        assert!(
            matches!(problem, ImportProblem::SparseIndex { index, count: 4, .. } if index == u64::from(wrong)),
            "{places:?}: {problem}"
        );
        assert_names(&problem, &["thing", "POSITION", "in range and in order"]);
    }
}

#[test]
fn a_file_that_needs_a_later_version_is_refused() {
    for (least, is_read) in [("2.0", true), ("2.1", false), ("9.0", false), ("1.0", false), ("x", false)] {
        let mut document = TestDocument::square();
        document.root["asset"]["minVersion"] = least.into();
        if is_read {
            document.scene();
            continue;
        }
        let problem = document.problem();
        assert!(matches!(problem, ImportProblem::Version { .. }), "{least}: {problem}");
        assert_names(&problem, &[least]);
    }
}

#[test]
fn what_is_nested_too_deep_to_be_written_is_found_by_node() {
    let mut document = TestDocument::square();
    let nested = |depth: usize| (0..depth).fold(json!({}), |inner, _| json!({ "a": inner }));
    document.root["nodes"][0]["extras"] = nested(50);
    document.scene();
    document.root["nodes"][0]["extras"] = nested(110);
    let problem = document.problem();
    assert!(matches!(&problem, ImportProblem::NestedTooDeep { .. }), "{problem}");
    assert_names(&problem, &["nodes[0]", "extras"]);
}

/// A grey room of this scale about a lamp of one metre.
fn room_about_a_lamp(scale: f64) -> TestDocument {
    let mut document = TestDocument::square();
    let room = SQUARE.map(|[x, y, _]| [4.0 * (x - 0.5), 4.0 * (y - 0.5), -2.0]);
    let (positions, indices) = (document.vectors(&room), document.indices(&SQUARE_INDICES));
    let grey = document.push(
        "materials",
        json!({ "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1.0], "metallicFactor": 0.0 } }),
    );
    let node = document
        .node_with(json!({ "attributes": { "POSITION": positions }, "indices": indices, "material": grey }));
    document.root["nodes"][node]["name"] = "room".into();
    document.root["nodes"][node]["scale"] = json!([scale, scale, scale]);
    document
}

#[test]
fn parts_that_are_nothing_beside_the_scene_are_found_by_node() {
    for scale in [1e-3, 1.0, 1e4] {
        assert_eq!(room_about_a_lamp(scale).scene().warnings, <[&str; 0]>::default(), "{scale}");
    }
    for scale in [1e8, 1e20, 1e30] {
        let problem = room_about_a_lamp(scale).problem();
        assert!(matches!(problem, ImportProblem::TooSmall { .. }), "{scale}: {problem}");
        assert_names(&problem, &["node \"thing\"", "node \"room\"", "scales and places"]);
    }
    for scale in [1e-8, 1e-20, 1e-30] {
        let warnings = room_about_a_lamp(scale).scene().warnings;
        assert!(
            warnings
                .iter()
                .any(|warning| warning.contains("node \"room\"") && warning.contains("too small to be lit")),
            "{scale}: {warnings:?}"
        );
    }
    // A lamp that is far from all else, and everything that is too large or too small.
    let mut document = room_about_a_lamp(1.0);
    document.root["nodes"][1]["translation"] = json!([1e9, 0, 0]);
    assert!(matches!(document.problem(), ImportProblem::TooSmall { .. }));
    for scale in [1e10, 1e-10] {
        let mut document = TestDocument::square();
        document.root["nodes"][0]["scale"] = json!([scale, scale, scale]);
        let warnings = document.scene().warnings;
        assert!(warnings.len() == 1 && warnings[0].contains("node \"thing\""), "{warnings:?}");
    }
    // A mesh that is a point in the file is nobody's mistake of scale.
    let mut document = TestDocument::square();
    let (positions, indices) = (document.vectors(&[[0.5; 3]; 3]), document.indices(&[0, 1, 2]));
    document.node_with(json!({ "attributes": { "POSITION": positions }, "indices": indices, "material": 0 }));
    assert_eq!(document.scene().warnings, <[&str; 0]>::default());
}

#[test]
fn lights_that_are_too_bright_for_numbers_are_found_by_node() {
    let lit = |light: Value, distance: f64| {
        let mut document = TestDocument::square();
        document.light(light, json!({ "name": "sun", "translation": [0, 0, distance] }));
        document
    };
    // The sun where it is.
    lit(json!({ "type": "point", "intensity": 3e27 }), 1.5e11).scene();
    for kind in ["point", "directional"] {
        for intensity in [1e30, 1e38, 3e38] {
            let problem = lit(json!({ "type": kind, "intensity": intensity }), 2.0).problem();
            assert!(matches!(problem, ImportProblem::TooBright { .. }), "{kind} {intensity}: {problem}");
            assert_names(&problem, &["the light of node \"sun\"", "intensity"]);
        }
    }
    // Bright enough because everything is small.
    let mut small = lit(json!({ "type": "point", "intensity": 1.0 }), 1.0);
    for node in 0..2 {
        small.root["nodes"][node]["scale"] = json!([1e-20, 1e-20, 1e-20]);
        small.root["nodes"][node]["translation"] = json!([0, 0, 0]);
    }
    assert!(matches!(small.problem(), ImportProblem::TooBright { .. }));
    let mut document = TestDocument::square();
    document.root["extensionsUsed"] = json!(["KHR_materials_emissive_strength"]);
    document.root["materials"][0]["extensions"] =
        json!({ "KHR_materials_emissive_strength": { "emissiveStrength": 1e38 } });
    let problem = document.problem();
    assert!(matches!(problem, ImportProblem::TooBright { .. }), "{problem}");
    assert_names(&problem, &["material \"lamp\""]);
}
