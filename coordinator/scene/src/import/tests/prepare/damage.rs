//! Damaged files: an error or a scene, within the limits.

use std::fs;

use serde_json::json;

use super::{fixture, primitive, require};
use crate::import::test_document::{TestDocument, limited};
use crate::{ImportProblem, import_slice};
use document::ReadOptions;

#[test]
fn any_byte_may_be_wrong() {
    let options = limited(ReadOptions { max_bytes: 1 << 20, max_triangles: 2_000, ..ReadOptions::default() });
    for name in ["meshopt_plain", "meshopt_filtered", "draco_edgebreaker", "draco_sequential"] {
        let file = fs::read(fixture(name)).unwrap();
        let json = u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize;
        let mut refused = 0;
        for index in 20 + json..file.len() {
            for change in [0x01, 0x80, 0xff] {
                let mut bytes = file.clone();
                bytes[index] ^= change;
                refused += u32::from(import_slice(&bytes, &options).is_err());
            }
        }
        assert!(refused > 0, "{name}");
    }
}

#[test]
fn what_is_damaged_is_named() {
    let mut document = TestDocument::square();
    require(&mut document, "EXT_meshopt_compression");
    document.root["bufferViews"][0]["extensions"]["EXT_meshopt_compression"] =
        json!({ "buffer": 0, "byteLength": 48, "byteStride": 12, "count": 4, "mode": "ATTRIBUTES" });
    let message = document.problem().to_string();
    assert!(message.contains("buffer view 0, compressed by meshoptimizer: cannot be decoded"), "{message}");

    let mut document = TestDocument::square();
    require(&mut document, "KHR_draco_mesh_compression");
    document.root["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"] =
        json!({ "bufferView": 0, "attributes": { "POSITION": 0 } });
    let message = document.problem().to_string();
    assert!(message.contains("mesh 0, primitive 0, compressed by Draco: cannot be decoded"), "{message}");
}

#[test]
fn numbers_are_checked_before_anything_is_decoded() {
    let cases = [
        (json!({ "byteStride": 6 }), "stride or count"),
        (json!({ "byteStride": 260 }), "stride or count"),
        (json!({ "mode": "TRIANGLES", "byteStride": 4 }), "stride or count"),
        (json!({ "mode": "INDICES", "byteStride": 8 }), "stride or count"),
        (json!({ "filter": "OCTAHEDRAL" }), "filter"),
        (json!({ "filter": "QUATERNION" }), "filter"),
        (json!({ "filter": "EXPONENTIAL", "mode": "INDICES", "byteStride": 4 }), "filter"),
        (json!({ "count": 48 * 1024 / 12 + 1 }), "too short for so many elements"),
        (json!({ "count": 1_u64 << 40, "byteStride": 256 }), "too short for so many elements"),
        (json!({ "count": 147, "mode": "TRIANGLES", "byteStride": 4 }), "too short for so many elements"),
        (json!({ "count": 49, "mode": "INDICES", "byteStride": 4 }), "too short for so many elements"),
        (json!({ "byteOffset": 1000 }), "outside their buffer"),
        (json!({ "buffer": 7 }), "outside their buffer"),
    ];
    for (change, expected) in cases {
        let mut document = TestDocument::square();
        require(&mut document, "KHR_meshopt_compression");
        let mut view =
            json!({ "buffer": 0, "byteLength": 48, "byteStride": 12, "count": 4, "mode": "ATTRIBUTES" });
        view.as_object_mut().unwrap().extend(change.as_object().unwrap().clone());
        document.root["bufferViews"][0]["extensions"]["KHR_meshopt_compression"] = view;
        let message = document.problem().to_string();
        assert!(message.contains(expected), "{expected} is not in {message}");
    }
}

#[test]
fn nothing_is_allocated_beyond_the_limit() {
    let mut document = TestDocument::square();
    require(&mut document, "EXT_meshopt_compression");
    document.root["bufferViews"][0]["extensions"]["EXT_meshopt_compression"] = json!(
        { "buffer": 0, "byteLength": 48, "byteStride": 12, "count": 48 * 1024 / 12, "mode": "ATTRIBUTES" });
    let options = limited(ReadOptions { max_bytes: 1 << 14, ..ReadOptions::default() });
    let problem = import_slice(&document.glb(), &options).unwrap_err().problem;
    assert!(matches!(*problem, ImportProblem::TooLarge { .. }), "{problem}");

    // Zeros, without a byte in the file.
    let mut document = TestDocument::square();
    require(&mut document, "EXT_mesh_gpu_instancing");
    let places = document.push("accessors", json!({
        "componentType": 5126, "type": "VEC3", "count": 1_u64 << 30,
        "sparse": { "count": 1, "indices": { "bufferView": 1, "componentType": 5125 }, "values": { "bufferView": 0 } },
    }));
    document.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"] =
        json!({ "attributes": { "TRANSLATION": places } });
    assert!(matches!(document.problem(), ImportProblem::TooLarge { .. }));
}

/// Each vertex has a byte somewhere: what claims more would only take memory.
#[test]
fn zeros_are_no_more_than_the_bytes_of_the_file() {
    let with_zeros = |count: u64, attribute: &str| {
        let mut document = TestDocument::square();
        let places = document.push("accessors", json!({
            "componentType": 5126, "type": "VEC3", "count": count, "min": [0, 0, 0], "max": [1, 1, 1],
            "sparse": { "count": 1, "indices": { "bufferView": 1, "componentType": 5125 }, "values": { "bufferView": 0 } },
        }));
        primitive(&mut document)["attributes"][attribute] = places.into();
        document
    };
    let claimed = with_zeros(300_000_000, "POSITION").problem();
    assert!(matches!(claimed, ImportProblem::AccessorOutOfBounds { .. }), "{claimed}");
    assert!(claimed.to_string().contains("more elements than the file has bytes"), "{claimed}");
    // As many normals as vertices are all zero but for one, and they are few.
    let problem = with_zeros(4, "NORMAL").scene().warnings;
    assert!(problem.is_empty(), "{problem:?}");

    let mut displaced = with_zeros(300_000_000, "NORMAL");
    let zeros = primitive(&mut displaced)["attributes"]["NORMAL"].clone();
    primitive(&mut displaced)["attributes"].as_object_mut().unwrap().remove("NORMAL");
    primitive(&mut displaced)["targets"] = json!([{ "POSITION": zeros }]);
    displaced.root["meshes"][0]["weights"] = json!([1.0]);
    let claimed = displaced.problem().to_string();
    assert!(claimed.contains("more elements than the file has bytes"), "{claimed}");
}

/// Forty million triangles in twenty bytes: refused before there is room for them.
#[test]
fn draco_data_are_not_taken_at_their_word() {
    let mut document = TestDocument::square();
    require(&mut document, "KHR_draco_mesh_compression");
    // Version 2.2, a mesh, of the edge breaker, no flags; then its kind, numbers of vertices and faces, no further attributes,
    // numbers of symbols and splits.
    const FORTY_MILLION: [u8; 4] = [0x80, 0xb4, 0x89, 0x13];
    let mut data = b"DRACO\x02\x02\x01\x01\x00\x00".to_vec();
    data.extend([&[0][..], &FORTY_MILLION, &FORTY_MILLION, &[0], &FORTY_MILLION, &[0; 8]].concat());
    let compressed = document.accessor(&data, 5121, "SCALAR", data.len());
    let view = document.root["accessors"][compressed]["bufferView"].clone();
    primitive(&mut document)["extensions"]["KHR_draco_mesh_compression"] =
        json!({ "bufferView": view, "attributes": { "POSITION": 0 } });
    let message = document.problem().to_string();
    assert!(message.contains("faces") && message.contains("ceiling"), "{message}");
}
