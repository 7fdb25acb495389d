//! What is refused, and in which words.

use serde_json::json;

use crate::import::test_document::{FLOAT, SQUARE, SQUARE_INDICES, TestDocument, UNSIGNED_INT, limited};
use crate::import::{ImportOptions, ImportProblem, import, import_slice};
use document::ReadOptions;

fn problem(bytes: &[u8]) -> ImportProblem {
    *import_slice(bytes, &ImportOptions::default()).unwrap_err().problem
}

/// The message names all of these.
fn assert_names(problem: &ImportProblem, words: &[&str]) {
    let message = problem.to_string();
    for word in words {
        assert!(message.contains(word), "`{word}` is not in: {message}");
    }
}

#[test]
fn message_begins_with_the_file() {
    let error = import_slice(b"hello", &ImportOptions::default()).unwrap_err();
    assert!(error.to_string().starts_with("the glTF: is not a glTF"), "{error}");
    let file = tempfile::NamedTempFile::with_suffix(".glb").unwrap();
    let error = import(file.path(), &ImportOptions::default()).unwrap_err();
    assert!(error.to_string().starts_with(&file.path().display().to_string()), "{error}");
}

#[test]
fn what_is_no_gltf() {
    for bytes in [b"".as_slice(), b"hello", b"\x89PNG\r\n", b"[1, 2]", b"glTT"] {
        assert!(matches!(problem(bytes), ImportProblem::NotGltf), "{bytes:?}");
    }
    assert!(matches!(problem(b"{\"hello\": 1}"), ImportProblem::Malformed { .. }));
    assert!(matches!(problem(b"{\"asset\": }"), ImportProblem::Malformed { .. }));
}

#[test]
fn unreadable_file() {
    let folder = tempfile::tempdir().unwrap();
    let error = import(&folder.path().join("none.glb"), &ImportOptions::default()).unwrap_err();
    assert!(matches!(*error.problem, ImportProblem::Unreadable(_)));
    let error = import(folder.path(), &ImportOptions::default()).unwrap_err();
    assert!(matches!(*error.problem, ImportProblem::Unreadable(_)));
}

#[test]
fn every_truncation_is_an_error_and_most_are_called_so() {
    let glb = TestDocument::square().glb();
    for length in 0..glb.len() {
        let problem = problem(&glb[..length]);
        if length >= 4 {
            assert!(matches!(problem, ImportProblem::Truncated { .. }), "{length}: {problem}");
        }
    }
    let json = TestDocument::square().json(None);
    assert!(matches!(problem(&json[..json.len() / 2]), ImportProblem::Truncated { .. }));
}

#[test]
fn glb_header_that_states_less_than_itself() {
    let mut glb = TestDocument::square().glb();
    glb[8..12].copy_from_slice(&3u32.to_le_bytes());
    assert!(matches!(problem(&glb), ImportProblem::Malformed { .. }));
}

#[test]
fn other_versions() {
    let mut document = TestDocument::square();
    document.root["asset"]["version"] = "1.0".into();
    assert!(matches!(document.problem(), ImportProblem::Version { version } if version == "1.0"));
    let mut glb = TestDocument::square().glb();
    glb[4] = 1;
    assert!(matches!(problem(&glb), ImportProblem::Version { version } if version == "1"));
    // The first version has maps where the second has lists, and states the length of its JSON where the second says that of a chunk.
    let first = br#"{ "asset": { "version": "1.0" }, "accessors": { "a": {} } }"#;
    assert!(matches!(problem(first), ImportProblem::Version { version } if version == "1.0"));
    let first = b"glTF\x01\x00\x00\x00\xff\x00\x00\x00\x0f\x00\x00\x00\x00\x00\x00\x00{}";
    assert!(matches!(problem(first), ImportProblem::Version { version } if version == "1"));
}

#[test]
fn cyclic_and_shared_nodes() {
    let mut document = TestDocument::square();
    let child = document.push("nodes", json!({ "name": "child", "children": [0] }));
    document.root["nodes"][0]["children"] = json!([child]);
    assert!(matches!(document.problem(), ImportProblem::CyclicNodes { node } if node == "node \"thing\""));

    let mut document = TestDocument::square();
    document.root["nodes"][0]["children"] = json!([0]);
    assert!(matches!(document.problem(), ImportProblem::CyclicNodes { .. }));

    let mut document = TestDocument::square();
    document.root_node(json!({ "children": [0] }));
    assert!(matches!(document.problem(), ImportProblem::CyclicNodes { .. }));

    let mut document = TestDocument::square();
    document.root["nodes"][0]["children"] = json!([0]);
    document.root.as_object_mut().unwrap().retain(|key, _| !key.starts_with("scene"));
    assert!(matches!(document.problem(), ImportProblem::CyclicNodes { .. }));
}

#[test]
fn long_chain_of_nodes_does_not_overflow_the_stack() {
    let mut document = TestDocument::square();
    for _ in 0..100_000 {
        let child = document.root["nodes"].as_array().unwrap().len() - 1;
        document.push("nodes", json!({ "children": [child] }));
    }
    let top = document.root["nodes"].as_array().unwrap().len() - 1;
    document.root["scenes"][0]["nodes"] = json!([top]);
    assert_eq!(document.scene().surfaces.len(), 1);
}

#[test]
fn transforms_that_are_not_finite() {
    let transforms = [json!({ "translation": [1e39, 0, 0] }), json!({ "rotation": [0, 0, 0, 0] })];
    for transform in transforms {
        let mut document = TestDocument::square();
        document.root["nodes"][0].as_object_mut().unwrap().extend(transform.as_object().unwrap().clone());
        let problem = document.problem();
        assert!(matches!(problem, ImportProblem::NodeTransform { .. }), "{problem}");
        assert_names(&problem, &["thing", "finite"]);
    }
}

#[test]
fn positions_that_are_not_finite() {
    for value in [f32::NAN, f32::INFINITY] {
        let mut positions = SQUARE;
        positions[2][1] = value;
        let problem = TestDocument::with_triangles(&positions, &SQUARE_INDICES).problem();
        assert!(matches!(problem, ImportProblem::NonFinitePosition { vertex: 2, .. }), "{problem}");
        assert_names(&problem, &["node \"thing\"", "primitive 0"]);
    }
}

#[test]
fn vertex_index_out_of_range() {
    let problem = TestDocument::with_triangles(&SQUARE, &[0, 1, 4]).problem();
    assert!(matches!(problem, ImportProblem::IndexOutOfRange { index: 4, count: 4, .. }), "{problem}");
}

#[test]
fn accessors_out_of_bounds() {
    let bend: [fn(&mut TestDocument); 6] = [
        |document| document.root["accessors"][0]["count"] = 1000.into(),
        |document| document.root["accessors"][0]["count"] = u64::MAX.into(),
        |document| document.root["accessors"][0]["byteOffset"] = 4.into(),
        |document| document.root["bufferViews"][0]["byteOffset"] = u64::MAX.into(),
        |document| document.root["bufferViews"][0]["byteStride"] = 4.into(),
        |document| document.root["bufferViews"][1]["byteLength"] = 8.into(),
    ];
    for bend in bend {
        let mut document = TestDocument::square();
        bend(&mut document);
        let problem = document.problem();
        assert!(matches!(problem, ImportProblem::AccessorOutOfBounds { .. }), "{problem}");
        assert_names(&problem, &["thing", "accessor"]);
    }
}

#[test]
fn empty_accessor() {
    let mut document = TestDocument::square();
    document.root["accessors"][1]["count"] = 0.into();
    assert!(matches!(document.problem(), ImportProblem::AccessorEmpty { accessor: 1, .. }));
}

#[test]
fn accessor_of_another_format() {
    let mut document = TestDocument::square();
    document.root["accessors"][0]["componentType"] = 5122.into();
    let problem = document.problem();
    assert!(matches!(problem, ImportProblem::AccessorFormat { accessor: 0, .. }), "{problem}");
    assert_names(&problem, &["POSITION", "extensionsRequired"]);

    let mut document = TestDocument::square();
    document.root["accessors"][1]["componentType"] = FLOAT.into();
    assert!(matches!(document.problem(), ImportProblem::AccessorFormat { accessor: 1, .. }));
    for (attribute, shape, component) in
        [("TEXCOORD_0", "VEC3", FLOAT), ("COLOR_0", "VEC2", FLOAT), ("NORMAL", "VEC3", UNSIGNED_INT)]
    {
        let mut document = TestDocument::square();
        let accessor = document.accessor(&[0; 64], component, shape, 4);
        document.root["meshes"][0]["primitives"][0]["attributes"][attribute] = accessor.into();
        let problem = document.problem();
        assert!(matches!(problem, ImportProblem::AccessorFormat { .. }), "{attribute}: {problem}");
    }
}

#[test]
fn attribute_counts_that_differ() {
    for (attribute, shape) in [("NORMAL", "VEC3"), ("TEXCOORD_1", "VEC2"), ("COLOR_0", "VEC4")] {
        let mut document = TestDocument::square();
        let accessor = document.accessor(&[0; 48], FLOAT, shape, 3);
        document.root["meshes"][0]["primitives"][0]["attributes"][attribute] = accessor.into();
        let problem = document.problem();
        assert!(matches!(problem, ImportProblem::AttributeCount { found: 3, expected: 4, .. }), "{problem}");
        assert_names(&problem, &[attribute]);
    }
}

#[test]
fn dangling_indices() {
    let bend: [fn(&mut TestDocument); 4] = [
        |document| document.root["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 99.into(),
        |document| document.root["meshes"][0]["primitives"][0]["material"] = 99.into(),
        |document| document.root["nodes"][0]["mesh"] = 99.into(),
        |document| document.root["nodes"][0]["extensions"] = json!({ "KHR_lights_punctual": { "light": 0 } }),
    ];
    for bend in bend {
        let mut document = TestDocument::square();
        bend(&mut document);
        let problem = document.problem();
        assert!(matches!(problem, ImportProblem::DanglingIndex { .. }), "{problem}");
    }
}

#[test]
fn required_extensions() {
    let mut document = TestDocument::square();
    document.root["extensionsRequired"] = json!(["KHR_materials_unlit", "ACME_teapot"]);
    let problem = document.problem();
    assert!(matches!(problem, ImportProblem::ExtensionRequired { .. }));
    assert_names(&problem, &["ACME_teapot"]);
    document.root["extensionsRequired"] = json!(["KHR_materials_unlit"]);
    document.root["extensionsUsed"] = json!(["KHR_materials_unlit", "ACME_teapot", "ACME_cup"]);
    assert_eq!(document.scene().warnings, ["extensions ignored: ACME_teapot, ACME_cup"]);
}

/// The output requires them where it has them.
#[test]
fn any_extension_of_materials_may_be_required() {
    let mut document = TestDocument::square();
    let required = json!(["KHR_materials_clearcoat", "KHR_materials_sheen"]);
    document.root["extensionsUsed"] = required.clone();
    document.root["extensionsRequired"] = required;
    let scene = document.scene();
    assert_eq!(scene.warnings, ["extensions ignored: KHR_materials_clearcoat, KHR_materials_sheen"]);
    assert_eq!(scene.source.root.extensions_required, ["KHR_materials_clearcoat", "KHR_materials_sheen"]);
}

#[test]
fn no_triangles() {
    assert!(matches!(TestDocument::new().problem(), ImportProblem::NoTriangles));
    let mut document = TestDocument::square();
    document.root["scenes"][0]["nodes"] = json!([]);
    assert!(matches!(document.problem(), ImportProblem::NoTriangles));
    let line = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
    assert!(matches!(TestDocument::with_triangles(&line, &[0, 1, 2]).problem(), ImportProblem::NoTriangles));
}

#[test]
fn no_light() {
    let mut document = TestDocument::square();
    document.root["materials"][0]["emissiveFactor"] = json!([0, 0, 0]);
    let problem = document.problem();
    assert!(matches!(problem, ImportProblem::NoLight));
    assert_names(&problem, &["emissiveFactor", "KHR_lights_punctual"]);
    document.light(json!({ "type": "point", "intensity": 0.0 }), json!({ "translation": [0, 0, 2] }));
    assert!(matches!(document.problem(), ImportProblem::NoLight));
    document.root["extensions"]["KHR_lights_punctual"]["lights"][0]["intensity"] = 1.0.into();
    assert_eq!(document.scene().lights.len(), 1);
}

#[test]
fn no_extent() {
    let problem = TestDocument::with_triangles(&[[1.0; 3]; 3], &[0, 1, 2]).problem();
    assert!(matches!(problem, ImportProblem::Extent { extent: 0.0 }), "{problem}");
    let mut document = TestDocument::square();
    document.root["nodes"][0]["scale"] = json!([0, 0, 0]);
    assert!(matches!(document.problem(), ImportProblem::Extent { .. }));
}

#[test]
fn too_many_triangles() {
    let options = limited(ReadOptions { max_triangles: 3, ..ReadOptions::default() });
    let mut document = TestDocument::square();
    assert!(import_slice(&document.glb(), &options).is_ok());
    document.root_node(json!({ "name": "again", "mesh": 0 }));
    let problem = *import_slice(&document.glb(), &options).unwrap_err().problem;
    assert!(matches!(problem, ImportProblem::TooManyTriangles { limit: 3, .. }));
    assert_names(&problem, &["again"]);
}
