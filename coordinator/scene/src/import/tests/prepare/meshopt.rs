//! Both meshopt extensions, encoded here: codecs of both versions, every filter.

use meshopt::{
    EncodeExpMode, encode_filter_color, encode_filter_exp, encode_filter_oct, encode_filter_quat,
    encode_index_buffer, encode_index_sequence, encode_vertex_buffer_level,
};
use serde_json::json;

use super::{first_triangles, primitive, require};
use crate::import::test_document::{FLOAT, SQUARE, SQUARE_INDICES, TestDocument, UNSIGNED_INT};

const NAMES: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Adds an accessor over compressed bytes, whose own view lies in a buffer without data.
fn compressed(
    document: &mut TestDocument,
    bytes: &[u8],
    (name, mode, filter): (&str, &str, &str),
    (component, shape, count, stride): (u32, &str, usize, usize),
) -> usize {
    let index = document.accessor(bytes, component, shape, count);
    let view = document.root["accessors"][index]["bufferView"].as_u64().unwrap() as usize;
    let offset = document.root["bufferViews"][view]["byteOffset"].clone();
    document.root["bufferViews"][view] =
        json!({ "buffer": 1, "byteOffset": 0, "byteLength": count * stride });
    if mode == "ATTRIBUTES" {
        document.root["bufferViews"][view]["byteStride"] = stride.into();
    }
    document.root["bufferViews"][view]["extensions"][name] = json!({
        "buffer": 0, "byteOffset": offset, "byteLength": bytes.len(), "byteStride": stride, "count": count,
        "mode": mode, "filter": filter,
    });
    index
}

/// The square, all of it compressed.
fn square(name: &str, version: i32, filter: &str, mode: &str) -> TestDocument {
    let mut document = TestDocument::square();
    let positions = match filter {
        "EXPONENTIAL" => encode_vertex_buffer_level(
            &encode_filter_exp(&SQUARE, 15, EncodeExpMode::Separate),
            2,
            Some(version),
        ),
        _ => encode_vertex_buffer_level(&SQUARE, 2, Some(version)),
    };
    let positions =
        compressed(&mut document, &positions.unwrap(), (name, "ATTRIBUTES", filter), (FLOAT, "VEC3", 4, 12));
    let indices = match mode {
        "TRIANGLES" => encode_index_buffer(&SQUARE_INDICES, 4),
        _ => encode_index_sequence(&SQUARE_INDICES, 4),
    };
    let indices =
        compressed(&mut document, &indices.unwrap(), (name, mode, "NONE"), (UNSIGNED_INT, "SCALAR", 6, 4));
    primitive(&mut document)["attributes"]["POSITION"] = positions.into();
    primitive(&mut document)["indices"] = indices.into();
    require(&mut document, name);
    finish(&mut document);
    document
}

/// The buffers, now that the first one's size is known.
fn finish(document: &mut TestDocument) {
    document.root["buffers"] = json!([{ "byteLength": document.bin.len() }, { "byteLength": 4096 }]);
}

#[test]
fn all_modes_and_both_versions() {
    for name in NAMES {
        for (version, filter, mode) in [
            (0, "NONE", "TRIANGLES"),
            (0, "EXPONENTIAL", "INDICES"),
            (1, "NONE", "INDICES"),
            (1, "EXPONENTIAL", "TRIANGLES"),
        ] {
            let scene = square(name, version, filter, mode).scene();
            let expected = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
            assert_eq!(first_triangles(&scene), [(0, expected)], "{name} {version} {filter} {mode}");
            assert_eq!(scene.source.buffers[1].len(), 0, "the placeholder stays empty");
        }
    }
}

#[test]
fn octahedral_normals_and_colours() {
    // Leaning by 24 degrees.
    let (x, z) = (0.4, 0.9165);
    for (bits, component, stride) in [(8, 5120, 4), (12, 5122, 8)] {
        let mut document = square(NAMES[1], 1, "NONE", "TRIANGLES");
        let (normal, colour) = ([[x, 0.0, z, 0.0]; 4], [[1.0, 0.25, 0.5, 1.0]; 4]);
        let (normals, colours) = if bits == 8 {
            (
                encode_vertex_buffer_level(&encode_filter_oct::<i8>(&normal, bits), 2, Some(1)),
                encode_vertex_buffer_level(&encode_filter_color::<u8>(&colour, bits), 2, Some(1)),
            )
        } else {
            (
                encode_vertex_buffer_level(&encode_filter_oct::<i16>(&normal, bits), 2, Some(1)),
                encode_vertex_buffer_level(&encode_filter_color::<u16>(&colour, bits), 2, Some(1)),
            )
        };
        let filters = [
            (normals, "OCTAHEDRAL", "VEC3", "NORMAL", component),
            (colours, "COLOR", "VEC4", "COLOR_0", component + 1),
        ];
        for (bytes, filter, shape, attribute, component) in filters {
            let how = (NAMES[1], "ATTRIBUTES", filter);
            let index = compressed(&mut document, &bytes.unwrap(), how, (component, shape, 4, stride));
            document.root["accessors"][index]["normalized"] = true.into();
            primitive(&mut document)["attributes"][attribute] = index.into();
        }
        document.root["extensionsRequired"] = json!([NAMES[1], "KHR_mesh_quantization"]);
        finish(&mut document);
        let scene = document.scene();
        let found = scene.surfaces[0].facets[0].corners[0].normal;
        assert!((found.x - f64::from(x)).abs() < 8e-3 && found.y.abs() < 8e-3, "{found}");
        let gltf = gltf::Document::from_json(scene.source.root.clone()).unwrap();
        let mesh = gltf.meshes().next().unwrap();
        let primitive = mesh.primitives().next().unwrap();
        let reader = primitive.reader(|buffer| scene.source.buffers.get(buffer.index()).map(Vec::as_slice));
        for read in reader.read_colors(0).unwrap().into_rgba_f32() {
            let off = read.iter().zip(&colour[0]).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off < 1e-2, "{read:?}");
        }
    }
}

#[test]
fn quaternions_of_instances() {
    let mut document = square(NAMES[0], 0, "NONE", "TRIANGLES");
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let turns = encode_filter_quat(&[[0.0, 0.0, half, half], [0.0, 0.0, -half, half]], 16);
    let bytes = encode_vertex_buffer_level(&turns, 2, Some(0)).unwrap();
    let rotation =
        compressed(&mut document, &bytes, (NAMES[0], "ATTRIBUTES", "QUATERNION"), (5122, "VEC4", 2, 8));
    document.root["accessors"][rotation]["normalized"] = true.into();
    document.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"] =
        json!({ "attributes": { "ROTATION": rotation } });
    document.root["extensionsRequired"] = json!([NAMES[0], "EXT_mesh_gpu_instancing"]);
    finish(&mut document);
    let near = |found: [[f64; 3]; 3], expected: [[f64; 3]; 3]| {
        let pairs = found.as_flattened().iter().zip(expected.as_flattened());
        assert!(pairs.clone().all(|(a, b)| (a - b).abs() < 2e-4), "{found:?}");
    };
    let triangles = first_triangles(&document.scene());
    near(triangles[0].1, [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]);
    near(triangles[1].1, [[0.0, 0.0, 0.0], [0.0, -1.0, 0.0], [1.0, -1.0, 0.0]]);
}
