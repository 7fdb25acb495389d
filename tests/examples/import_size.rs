//! How long a large file takes to import, by kinds of content.
//!
//!     cargo run --release -p tests --example import_size [MEGABYTES]
//!
//! Writes nothing: the files are made in memory, each of vertices with normals and texture coordinates under 32-bit indices.

use std::time::Instant;

use coordinator::import::{ImportOptions, import_slice};
use serde_json::json;
use tests::builder::pack;

/// Cells along a side of one mesh: 51,200 vertices and 102,000 triangles.
const CELLS: u32 = 226;

/// How high a place of a sheet lies.
type Height = fn(f32, f32) -> f32;

fn main() {
    let megabytes: f64 = std::env::args().nth(1).map_or(100.0, |text| text.parse().expect("a number of MB"));
    let kinds: [(&str, Height, bool); 3] = [
        ("curved, shared vertices", |x, y| 0.1 * (40.0 * x).sin() * (30.0 * y).cos(), false),
        ("curved, three vertices to a triangle", |x, y| 0.1 * (40.0 * x).sin() * (30.0 * y).cos(), true),
        ("flat", |_, _| 0.0, false),
    ];
    for (name, height, unwelded) in kinds {
        let glb = file(megabytes, height, unwelded);
        let (clock, before) = (Instant::now(), processor_seconds());
        let scene = import_slice(&glb, &ImportOptions::default()).expect("the file is sound");
        let (seconds, spent) = (clock.elapsed().as_secs_f64(), processor_seconds() - before);
        let facets: usize = scene.surfaces.iter().map(|surface| surface.facets.len()).sum();
        let triangles: usize = scene
            .surfaces
            .iter()
            .flat_map(|surface| &surface.facets)
            .map(|facet| facet.triangles.len())
            .sum();
        println!(
            "{name}: {:.1} MB, {} surfaces, {triangles} triangles, {facets} facets: {seconds:.2} s, {spent:.2} s of processor time",
            glb.len() as f64 / 1e6,
            scene.surfaces.len()
        );
    }
}

/// Time that all threads of this process have run.
fn processor_seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Sheets side by side until the file is as large as asked.
fn file(megabytes: f64, height: Height, unwelded: bool) -> Vec<u8> {
    let mut binary: Vec<u8> = Vec::new();
    let (mut views, mut accessors, mut meshes, mut nodes) = (vec![], vec![], vec![], vec![]);
    while (binary.len() as f64) < megabytes * 1e6 {
        let (positions, normals, coordinates, indices) = sheet(nodes.len() as f32, height, unwelded);
        let vertices = positions.len();
        let mut add = |bytes: Vec<u8>, component: u32, shape: &str, count: usize| {
            views.push(json!({ "buffer": 0, "byteOffset": binary.len(), "byteLength": bytes.len() }));
            binary.extend_from_slice(&bytes);
            accessors.push(json!({
                "bufferView": views.len() - 1, "componentType": component, "type": shape, "count": count,
                "min": [0.0, 0.0, 0.0], "max": [0.0, 0.0, 0.0],
            }));
            accessors.len() - 1
        };
        let floats =
            |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
        let attributes = json!({
            "POSITION": add(floats(positions.as_flattened()), 5126, "VEC3", vertices),
            "NORMAL": add(floats(normals.as_flattened()), 5126, "VEC3", vertices),
            "TEXCOORD_0": add(floats(coordinates.as_flattened()), 5126, "VEC2", vertices),
        });
        let count = indices.len();
        let bytes = indices.into_iter().flat_map(u32::to_le_bytes).collect();
        let indices = add(bytes, 5125, "SCALAR", count);
        meshes
            .push(json!({ "primitives": [{ "attributes": attributes, "indices": indices, "material": 0 }] }));
        nodes.push(json!({ "mesh": meshes.len() - 1 }));
    }
    let roots: Vec<usize> = (0..nodes.len()).collect();
    let document = json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": roots }], "nodes": nodes, "meshes": meshes,
        "accessors": accessors, "bufferViews": views, "buffers": [{ "byteLength": binary.len() }],
        "materials": [{ "emissiveFactor": [1.0, 1.0, 1.0] }],
    });
    pack(&document, &binary)
}

type Sheet = (Vec<[f32; 3]>, Vec<[f32; 3]>, Vec<[f32; 2]>, Vec<u32>);

/// A unit square of cells, raised by `height`, with smooth normals where it is curved.
fn sheet(offset: f32, height: Height, unwelded: bool) -> Sheet {
    let side = CELLS + 1;
    let place = |index: u32| ((index % side) as f32 / CELLS as f32, (index / side) as f32 / CELLS as f32);
    let mut corners = Vec::new();
    for row in 0..CELLS {
        for column in 0..CELLS {
            let a = row * side + column;
            corners.extend([a, a + 1, a + side + 1, a, a + side + 1, a + side]);
        }
    }
    let vertices: Vec<u32> = if unwelded { corners.clone() } else { (0..side * side).collect() };
    let indices = if unwelded { (0..corners.len() as u32).collect() } else { corners };
    let places: Vec<(f32, f32)> = vertices.into_iter().map(place).collect();
    let positions = places.iter().map(|&(x, y)| [1.1 * offset + x, y, height(x, y)]).collect();
    let normals = places.iter().map(|&(x, y)| {
        let (dx, dy) = (height(x + 1e-3, y) - height(x - 1e-3, y), height(x, y + 1e-3) - height(x, y - 1e-3));
        let normal = [-500.0 * dx, -500.0 * dy, 1.0f32];
        let length = normal.iter().map(|value| value * value).sum::<f32>().sqrt();
        normal.map(|value| value / length)
    });
    (positions, normals.collect(), places.iter().map(|&(x, y)| [x, y]).collect(), indices)
}
