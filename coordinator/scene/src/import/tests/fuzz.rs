//! Whatever the bytes, the answer is a scene or an error.

use proptest::prelude::*;

use crate::import::test_document::{TestDocument, limited};
use crate::import::{ImportOptions, import_slice};
use document::ReadOptions;

/// Limits that keep a lucky guess small.
fn options() -> ImportOptions {
    limited(ReadOptions { max_bytes: 1 << 20, max_triangles: 10_000, ..ReadOptions::default() })
}

/// A document that has some of everything that is read.
fn rich_document() -> TestDocument {
    use serde_json::json;

    let mut document = TestDocument::square();
    let normals = document.vectors(&[[0.0, 0.0, 1.0]; 4]);
    let coordinates = document.floats("VEC2", &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    let colours = document.floats("VEC4", &[[1.0; 4]; 4]);
    let (sparse_indices, sparse_values) =
        (document.indices(&[0, 2]), document.vectors(&[[0.5; 3], [0.5, 0.0, 0.0]]));
    let positions = document.push(
        "accessors",
        json!({
            "componentType": 5126, "type": "VEC3", "count": 4, "min": [0, 0, 0], "max": [1, 1, 1],
            "sparse": {
                "count": 2,
                "indices": { "bufferView": sparse_indices, "componentType": 5125 },
                "values": { "bufferView": sparse_values },
            },
        }),
    );
    let attributes =
        json!({ "POSITION": 0, "NORMAL": normals, "TEXCOORD_0": coordinates, "COLOR_0": colours });
    document.node_with(json!({ "attributes": attributes, "indices": 1, "mode": 5, "material": 0 }));
    document.node_with(json!({ "attributes": { "POSITION": positions }, "mode": 6, "material": 0 }));
    document.light(json!({ "type": "point" }), json!({ "rotation": [0, 0, 0, 1], "children": [0] }));
    document.root["scenes"][0]["nodes"] = json!([1, 2, 3]);
    document
}

#[test]
fn rich_document_is_read() {
    let scene = import_slice(&rich_document().glb(), &options()).unwrap();
    assert_eq!(scene.surfaces.len(), 3);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn random_bytes_do_not_panic(bytes in prop::collection::vec(any::<u8>(), 0..400), glb in any::<bool>()) {
        let start: &[u8] = if glb { b"glTF\x02\0\0\0" } else { b"" };
        prop_assert!(import_slice(&[start, &bytes].concat(), &options()).is_err());
    }

    #[test]
    fn damaged_bytes_do_not_panic(damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8)) {
        let mut glb = rich_document().glb();
        for (index, value) in damage {
            let index = index.index(glb.len());
            glb[index] = value;
        }
        check_answer(&glb);
    }

    #[test]
    fn damaged_numbers_do_not_panic(damage in prop::collection::vec((any::<prop::sample::Index>(), 0usize..12), 1..4)) {
        const VALUES: [&str; 12] = [
            "0", "1", "2", "3", "5", "255", "5121", "5123", "4294967295", "18446744073709551615", "-1", "1e39",
        ];
        let mut json = String::from_utf8(rich_document().json(Some("data:;base64,"))).unwrap();
        for (index, value) in damage {
            let numbers = numbers(&json);
            let start = numbers[index.index(numbers.len())];
            let rest = &json[start..];
            let length = rest.find(|end: char| !(end.is_ascii_digit() || ".e".contains(end))).unwrap_or(rest.len());
            json.replace_range(start..start + length, VALUES[value]);
        }
        let uri = json.find("data:;base64,").unwrap() + "data:;base64,".len();
        json.insert_str(uri, &base64_of(&rich_document().bin));
        check_answer(json.as_bytes());
    }
}

/// Where the numbers of a JSON begin, those in names left out.
fn numbers(json: &str) -> Vec<usize> {
    let begins = |&(at, digit): &(usize, char)| {
        let continues = |before: char| before.is_ascii_alphanumeric() || ".-_".contains(before);
        digit.is_ascii_digit() && !json[..at].ends_with(continues)
    };
    json.char_indices().filter(begins).map(|(at, _)| at).collect()
}

/// A scene, if there is one, has only numbers that the solver can take.
fn check_answer(bytes: &[u8]) {
    let Ok(scene) = import_slice(bytes, &options()) else { return };
    assert!(scene.surfaces.iter().any(|surface| !surface.facets.is_empty()));
    for surface in &scene.surfaces {
        assert!(surface.reflectance.min_element() >= 0.0 && surface.reflectance.max_element() < 1.0);
        assert!(surface.exitance.is_finite());
        for facet in &surface.facets {
            assert!(facet.plane.0 < scene.plane_count && facet.corners.len() >= 3);
            for corner in &facet.corners {
                assert!(corner.position.abs().max_element() <= 1024.0);
                assert!((corner.normal.length() - 1.0).abs() < 1e-9);
            }
        }
    }
}

fn base64_of(bytes: &[u8]) -> String {
    use base64::Engine;
    base64::engine::general_purpose::STANDARD.encode(bytes)
}
