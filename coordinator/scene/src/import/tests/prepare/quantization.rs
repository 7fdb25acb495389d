//! KHR_mesh_quantization, and sparse accessors with it.

use serde_json::json;

use super::{first_triangles, primitive, require};
use crate::import::test_document::{FLOAT, TestDocument};

const BYTE: u32 = 5120;
const UNSIGNED_BYTE: u32 = 5121;
const SHORT: u32 = 5122;
const UNSIGNED_SHORT: u32 = 5123;

/// The square with its positions as bytes of a component type, rows aligned to four bytes.
fn square(component: u32, normalized: bool, rows: &[[i32; 3]; 4]) -> TestDocument {
    let size = if component == BYTE || component == UNSIGNED_BYTE { 1 } else { 2 };
    let mut document = TestDocument::square();
    let mut bytes = Vec::new();
    for row in rows {
        row.iter().for_each(|value| bytes.extend_from_slice(&value.to_le_bytes()[..size]));
        bytes.resize(bytes.len().next_multiple_of(4), 0);
    }
    let accessor = document.accessor(&bytes, component, "VEC3", 4);
    document.root["accessors"][accessor]["normalized"] = normalized.into();
    document.root["accessors"][accessor]["min"] = json!([0, 0, 0]);
    let view = document.root["accessors"][accessor]["bufferView"].as_u64().unwrap() as usize;
    document.root["bufferViews"][view]["byteStride"] = (if size == 1 { 4 } else { 8 }).into();
    primitive(&mut document)["attributes"]["POSITION"] = accessor.into();
    require(&mut document, "KHR_mesh_quantization");
    document
}

#[test]
fn positions_of_all_formats() {
    let cases = [
        (BYTE, false, -100, -100.0),
        (BYTE, true, 127, 1.0),
        (BYTE, true, -128, -1.0),
        (UNSIGNED_BYTE, false, 200, 200.0),
        (UNSIGNED_BYTE, true, 255, 1.0),
        (SHORT, false, -30_000, -30_000.0),
        (SHORT, true, -32_767, -1.0),
        (UNSIGNED_SHORT, false, 60_000, 60_000.0),
        (UNSIGNED_SHORT, true, 65_535, 1.0),
    ];
    for (component, normalized, a, value) in cases {
        let document = square(component, normalized, &[[0, 0, 0], [a, 0, 0], [a, a, 0], [0, a, 0]]);
        let scene = document.scene();
        let expected = [[0.0, 0.0, 0.0], [value, 0.0, 0.0], [value, value, 0.0]];
        assert_eq!(first_triangles(&scene), [(0, expected)], "{component} {normalized}");
        let positions = scene.source.root.accessors.last().unwrap();
        let bounds = (positions.min.clone().unwrap(), positions.max.clone().unwrap());
        assert_eq!(
            bounds,
            (json!([value.min(0.0), value.min(0.0), 0.0]), json!([value.max(0.0), value.max(0.0), 0.0]))
        );
        assert!(scene.source.root.extensions_required.is_empty());
    }
}

#[test]
fn normals_and_texture_coordinates() {
    let mut document = square(SHORT, false, &[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]);
    // Leaning: half as far along x as along z.
    let normals = document.accessor(&[45, 0, 90, 0].repeat(4), BYTE, "VEC3", 4);
    document.root["accessors"][normals]["normalized"] = true.into();
    let view = document.root["accessors"][normals]["bufferView"].as_u64().unwrap() as usize;
    document.root["bufferViews"][view]["byteStride"] = 4.into();
    let bytes: Vec<u8> =
        [0i16, 0, 300, 0, 300, -300, 0, -300].into_iter().flat_map(i16::to_le_bytes).collect();
    let coordinates = document.accessor(&bytes, SHORT, "VEC2", 4);
    let core = document.accessor(&[0, 0, 255, 0, 255, 255, 0, 255], UNSIGNED_BYTE, "VEC2", 4);
    document.root["accessors"][core]["normalized"] = true.into();
    let attributes = &mut primitive(&mut document)["attributes"];
    attributes["NORMAL"] = normals.into();
    attributes["TEXCOORD_0"] = coordinates.into();
    attributes["TEXCOORD_1"] = core.into();
    let scene = document.scene();
    let normal = scene.surfaces[0].facets[0].corners[0].normal;
    assert!(normal.distance(glam::DVec3::new(1.0, 0.0, 2.0).normalize()) < 1e-6, "{normal}");
    let gltf = gltf::Document::from_json(scene.source.root.clone()).unwrap();
    let mesh = gltf.meshes().next().unwrap();
    let primitive = mesh.primitives().next().unwrap();
    let reader = primitive.reader(|buffer| scene.source.buffers.get(buffer.index()).map(Vec::as_slice));
    let read: Vec<[f32; 2]> = reader.read_tex_coords(0).unwrap().into_f32().collect();
    assert_eq!(read, [[0.0, 0.0], [300.0, 0.0], [300.0, -300.0], [0.0, -300.0]]);
    // What glTF itself allows stays byte for byte.
    let kept = &scene.source.root.accessors[core];
    assert_eq!(kept.buffer_view.unwrap().value(), document.root["accessors"][core]["bufferView"]);
}

#[test]
fn sparse_positions() {
    // Zeros, but for three vertices: with and without the extension, as integers and as floats.
    for quantized in [true, false] {
        let mut document = TestDocument::square();
        let (component, bytes): (u32, Vec<u8>) = if quantized {
            (SHORT, [1i16, 0, 0, 0, 1, 1, 0, 0, 0, 1, 0, 0].into_iter().flat_map(i16::to_le_bytes).collect())
        } else {
            let values = [1f32, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0];
            (FLOAT, values.into_iter().flat_map(f32::to_le_bytes).collect())
        };
        let values = document.accessor(&bytes, component, "VEC3", 3);
        let values = document.root["accessors"][values]["bufferView"].clone();
        if quantized {
            document.root["bufferViews"][values.as_u64().unwrap() as usize]["byteStride"] = 8.into();
            require(&mut document, "KHR_mesh_quantization");
        }
        let places = document.accessor(&[1, 2, 3], UNSIGNED_BYTE, "SCALAR", 3);
        let places = document.root["accessors"][places]["bufferView"].clone();
        let sparse = document.push(
            "accessors",
            json!({
                "componentType": component, "type": "VEC3", "count": 4, "min": [0, 0, 0], "max": [1, 1, 0],
                "sparse": {
                    "count": 3, "values": { "bufferView": values },
                    "indices": { "bufferView": places, "componentType": UNSIGNED_BYTE },
                },
            }),
        );
        primitive(&mut document)["attributes"]["POSITION"] = sparse.into();
        let triangles = first_triangles(&document.scene());
        assert_eq!(triangles, [(0, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])], "{quantized}");
    }
}

#[test]
fn sparse_indices_over_zeros() {
    let mut document = TestDocument::square();
    let values = document.accessor(&[1, 0, 2, 0, 2, 0, 3, 0], UNSIGNED_SHORT, "SCALAR", 4);
    let values = document.root["accessors"][values]["bufferView"].clone();
    let places = document.accessor(&[1, 2, 4, 5], UNSIGNED_BYTE, "SCALAR", 4);
    let places = document.root["accessors"][places]["bufferView"].clone();
    let sparse = document.push(
        "accessors",
        json!({
            "componentType": UNSIGNED_SHORT, "type": "SCALAR", "count": 6,
            "sparse": {
                "count": 4, "values": { "bufferView": values },
                "indices": { "bufferView": places, "componentType": UNSIGNED_BYTE },
            },
        }),
    );
    primitive(&mut document)["indices"] = sparse.into();
    let scene = document.scene();
    let triangles: Vec<_> =
        scene.surfaces[0].facets[0].triangles.iter().map(|triangle| triangle.vertices).collect();
    assert_eq!(triangles, [[0, 1, 2], [0, 2, 3]]);
}
