//! One scene as other tools compress it: the same scene comes out.

use std::fs;
use std::path::PathBuf;

use glam::DVec3;

use fixtures::light;
use output::export::{Compression, ExportSettings, export};
use scene::{ImportOptions, import};
use scene::{Scene, Surface};

const COMPRESSED: [&str; 5] =
    ["quantized", "meshopt_plain", "meshopt_filtered", "draco_edgebreaker", "draco_sequential"];

fn fixture(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/compressed");
    folder.join(format!("{name}.glb"))
}

fn read(name: &str) -> Scene {
    import(&fixture(name), &ImportOptions::default()).unwrap()
}

/// Integrals over a surface, of what does not depend on the order of triangles and vertices: area, place, place squared,
/// normal, texture coordinates and colour. World units.
fn integrals(scene: &Scene, surface: &Surface) -> Vec<f64> {
    let document = gltf::Document::from_json(scene.source.root.clone()).unwrap();
    let mesh = document.nodes().nth(surface.node).unwrap().mesh().unwrap();
    let primitive = mesh.primitives().nth(surface.primitive).unwrap();
    let reader = primitive.reader(|buffer| scene.source.buffers.get(buffer.index()).map(Vec::as_slice));
    let coordinates: Option<Vec<[f32; 2]>> =
        reader.read_tex_coords(0).map(|values| values.into_f32().collect());
    let colours: Option<Vec<[f32; 3]>> = reader.read_colors(0).map(|values| values.into_rgb_f32().collect());
    let mut sums = vec![0.0; 14];
    for triangle in surface.facets.iter().flat_map(|facet| &facet.triangles) {
        let [a, b, c] = triangle.positions.map(|position| scene.frame.to_world(position));
        let area = (b - a).cross(c - a).length() / 2.0;
        let centre = (a + b + c) / 3.0;
        let squares = (a * a + b * b + c * c) / 3.0;
        let mut add = |first: usize, values: &[f64]| {
            values.iter().enumerate().for_each(|(i, value)| sums[first + i] += area * value);
        };
        add(0, &[1.0]);
        add(1, &centre.to_array());
        add(4, &squares.to_array());
        for vertex in triangle.vertices.map(|vertex| vertex as usize) {
            if let Some(values) = &coordinates {
                add(7, &values[vertex].map(|value| f64::from(value) / 3.0));
            }
            if let Some(values) = &colours {
                add(9, &values[vertex].map(|value| f64::from(value) / 3.0));
            }
        }
    }
    let normals: DVec3 =
        surface.facets.iter().flat_map(|facet| &facet.corners).map(|corner| corner.normal).sum();
    sums[12] = normals.normalize().x;
    sums[13] = normals.normalize().y;
    sums
}

#[test]
fn compressed_files_are_the_plain_one() {
    let plain = read("plain");
    assert_eq!(plain.surfaces.len(), 2);
    for name in COMPRESSED {
        let scene = read(name);
        assert!(scene.warnings.is_empty(), "{name}: {:?}", scene.warnings);
        assert_eq!(scene.surfaces.len(), 2, "{name}");
        for (surface, original) in scene.surfaces.iter().zip(&plain.surfaces) {
            let count =
                |surface: &Surface| surface.facets.iter().map(|facet| facet.triangles.len()).sum::<usize>();
            assert_eq!(count(surface), count(original), "{name}");
            // Vertex colours multiply it.
            let difference = (surface.reflectance - original.reflectance).abs().max_element();
            assert!(difference < 6e-3, "{name}: {} for {}", surface.reflectance, original.reflectance);
            let (found, expected) = (integrals(&scene, surface), integrals(&plain, original));
            for (index, (found, expected)) in found.iter().zip(&expected).enumerate() {
                // Positions of 11 bits and more over 3 m, colours and texture coordinates of 8 bits and more.
                assert!((found - expected).abs() < 6e-3, "{name}, {index}: {found} for {expected}");
            }
        }
    }
}

#[test]
fn outputs_are_plain_where_that_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    for name in COMPRESSED {
        let scene = read(name);
        let lit = light(&scene, 0, |_| DVec3::ONE);
        let output = folder.path().join(format!("{name}.glb"));
        let settings = ExportSettings {
            exposure: Some(1.0),
            compression: Compression::None,
            ..ExportSettings::default()
        };
        export(&scene, &lit, &settings, &output).unwrap();
        let bytes = fs::read(&output).unwrap();
        // Validates.
        let gltf = gltf::Gltf::from_slice(&bytes).unwrap();
        let json = gltf.document.as_json();
        assert_eq!(json.extensions_used, ["KHR_materials_unlit"], "{name}");
        assert!(json.extensions_required.is_empty(), "{name}");
        assert_eq!(json.buffers.len(), 1, "{name}");
        // And is read back as what it was.
        let again =
            import(&output, &ImportOptions { needs_light: false, ..ImportOptions::default() }).unwrap();
        assert_eq!(again.surfaces.len(), scene.surfaces.len(), "{name}");
        for (surface, original) in again.surfaces.iter().zip(&scene.surfaces) {
            let (found, expected) = (integrals(&again, surface), integrals(&scene, original));
            for (found, expected) in found[..9].iter().zip(&expected[..9]) {
                assert!((found - expected).abs() < 1e-5, "{name}: {found} for {expected}");
            }
        }
    }
}
