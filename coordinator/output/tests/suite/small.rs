//! Compressed outputs: what is read from them is what was written, and they are small.

use std::collections::HashMap;
use std::path::Path;

use fixtures::{light, open};
use glam::DVec3;
use gltf::Semantic;
use output::export::{Compression, ExportSettings, export};
use scene::{ImportOptions, Scene, import};

/// Writes the lit scene.
fn written(scene: &Scene, compression: Compression, path: &Path) -> u64 {
    let lit =
        light(scene, 3, |place| DVec3::new(1.0 + place.x.sin().powi(2), 0.5, 0.25 + place.z.abs() * 1e-3));
    export(scene, &lit, &ExportSettings { compression, ..ExportSettings::default() }, path).unwrap();
    std::fs::metadata(path).unwrap().len()
}

/// Vertices of each primitive: place, normal, colour and irradiance.
fn vertices(path: &Path) -> Vec<Vec<[f32; 12]>> {
    let scene = import(path, &ImportOptions { needs_light: false, ..ImportOptions::default() }).unwrap();
    let document = gltf::Document::from_json(scene.source.root.clone()).unwrap();
    let data = |buffer: gltf::Buffer| scene.source.buffers.get(buffer.index()).map(Vec::as_slice);
    let of = |primitive: gltf::Primitive| {
        let reader = primitive.reader(data);
        let places = reader.read_positions().unwrap();
        let normals = reader.read_normals().unwrap();
        let colours = reader.read_colors(0).unwrap().into_rgb_f32();
        let irradiance = primitive.get(&Semantic::Extras("IRRADIANCE".into())).unwrap();
        let irradiance = gltf::accessor::Iter::<[f32; 3]>::new(irradiance, data).unwrap();
        let all = places.zip(normals).zip(colours).zip(irradiance);
        all.map(|(((a, b), c), d)| [a, b, c, d].concat().try_into().unwrap()).collect()
    };
    document.meshes().flat_map(|mesh| mesh.primitives().map(of).collect::<Vec<_>>()).collect()
}

#[test]
fn a_compressed_file_is_the_plain_one_to_the_digits_that_it_keeps() {
    let folder = tempfile::tempdir().unwrap();
    let [plain, small] = ["plain.glb", "small.glb"].map(|name| folder.path().join(name));
    let scene = open("cornell-textured.glb");
    let before = written(&scene, Compression::None, &plain);
    let after = written(&scene, Compression::Meshopt, &small);
    assert!(after * 3 < before, "{after} of {before} bytes");
    let (plain, small) = (vertices(&plain), vertices(&small));
    assert_eq!(plain.len(), small.len());
    for (plain, small) in plain.iter().zip(&small) {
        assert_eq!(plain.len(), small.len());
        for vertex in plain {
            let difference = |other: &[f32; 12]| {
                let scaled = |at: usize| (vertex[at] - other[at]).abs() * if at < 3 { 4.0 } else { 1.0 };
                (0..12).map(scaled).fold(0.0, f32::max)
            };
            let nearest = small.iter().map(difference).fold(f32::INFINITY, f32::min);
            // A thousandth in places of some metres, four in directions and light.
            assert!(nearest < 4e-3, "{nearest} at {vertex:?}");
        }
    }
}

#[test]
fn what_is_compressed_stays_so_by_default() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lit.glb");
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/compressed");
    let used = |name: &str, compression: Compression| -> Vec<String> {
        let scene = import(&fixtures.join(name), &ImportOptions::default()).unwrap();
        written(&scene, compression, &path);
        let file = std::fs::read(&path).unwrap();
        let glb = gltf::binary::Glb::from_slice(&file).unwrap();
        let json: serde_json::Value = serde_json::from_slice(&glb.json).unwrap();
        let names = |list: &str| -> Vec<String> {
            json[list].as_array().into_iter().flatten().map(|name| name.as_str().unwrap().into()).collect()
        };
        let compressed = |name: &String| name.contains("meshopt") || name.contains("quantization");
        let required: Vec<String> = names("extensionsRequired").into_iter().filter(compressed).collect();
        let used: Vec<String> = names("extensionsUsed").into_iter().filter(compressed).collect();
        assert_eq!(used, required);
        used
    };
    let both = ["EXT_meshopt_compression", "KHR_mesh_quantization"];
    assert_eq!(used("meshopt_plain.glb", Compression::AsInput), both);
    assert_eq!(used("meshopt_plain.glb", Compression::None), [""; 0]);
    assert_eq!(used("draco_sequential.glb", Compression::AsInput), [""; 0]);
    assert_eq!(used("plain.glb", Compression::AsInput), [""; 0]);
    assert_eq!(used("plain.glb", Compression::Meshopt), both);
}

#[test]
fn the_order_of_triangles_changes_and_their_corners_do_not() {
    let folder = tempfile::tempdir().unwrap();
    let [plain, small] = ["plain.glb", "small.glb"].map(|name| folder.path().join(name));
    let scene = open("cornell-textured.glb");
    written(&scene, Compression::None, &plain);
    written(&scene, Compression::Meshopt, &small);
    // Each triangle by its middle, with the side that it faces.
    let triangles = |path: &Path| -> HashMap<[i64; 6], usize> {
        let scene = import(path, &ImportOptions { needs_light: false, ..ImportOptions::default() }).unwrap();
        let mut count = HashMap::new();
        for triangle in scene.surfaces.iter().flat_map(|own| &own.facets).flat_map(|facet| &facet.triangles) {
            let [a, b, c] = triangle.positions.map(|place| scene.frame.to_world(place));
            let (middle, normal) = ((a + b + c) / 3.0, (b - a).cross(c - a).normalize());
            let key = [middle, normal].map(|vector| (vector * 20.0).round().as_i64vec3().to_array());
            *count.entry([key[0], key[1]].concat().try_into().unwrap()).or_default() += 1;
        }
        count
    };
    let (plain, small) = (triangles(&plain), triangles(&small));
    let same = plain.iter().filter(|(key, count)| small.get(*key) == Some(count)).count();
    // Some middles lie on the border of two keys.
    assert!(same as f64 > 0.95 * plain.len() as f64, "{same} of {}", plain.len());
}
