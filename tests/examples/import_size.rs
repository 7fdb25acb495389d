//! How long a large file takes to import, by kinds of content.
//!
//!     cargo measure import_size [MEGABYTES]
//!
//! Writes nothing: the files are made in memory. Meshes have normals and texture coordinates under 32-bit indices, pictures the noise
//! of a photograph.

use std::io::Cursor;
use std::time::Instant;

use glam::DVec3;
use image::codecs::jpeg::JpegEncoder;
use image::{ImageFormat, Rgb, RgbImage};
use scene::{ImportOptions, import_slice};
use serde_json::json;
use tests::builder::{Material, SceneBuilder, pack};
use tests::painting::Painting;

/// Cells along a side of one mesh: 51,200 vertices and 102,000 triangles.
const CELLS: u32 = 226;

/// Texels along a side of one picture.
const SIDE: u32 = 2048;

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
        measure(name, &file(megabytes, height, unwelded));
    }
    for format in [ImageFormat::Png, ImageFormat::Jpeg] {
        measure(&format!("pictures, {format:?}"), &pictures(megabytes, format));
    }
}

fn measure(name: &str, glb: &[u8]) {
    let (clock, before) = (Instant::now(), processor_seconds());
    let scene = import_slice(glb, &ImportOptions::default()).expect("the file is sound");
    let (seconds, spent) = (clock.elapsed().as_secs_f64(), processor_seconds() - before);
    let facets: usize = scene.surfaces.iter().map(|surface| surface.facets.len()).sum();
    let triangles: usize =
        scene.surfaces.iter().flat_map(|surface| &surface.facets).map(|facet| facet.triangles.len()).sum();
    println!(
        "{name}: {:.1} MB, {} surfaces, {triangles} triangles, {facets} facets: {seconds:.2} s, {spent:.2} s of processor time",
        glb.len() as f64 / 1e6,
        scene.surfaces.len()
    );
}

/// Time that all threads of this process have run.
fn processor_seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Squares side by side, each with a picture of its own, until the file is as large as asked.
fn pictures(megabytes: f64, format: ImageFormat) -> Vec<u8> {
    let mut state = 1u32;
    let mut noise = |most: u32| {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        ((state >> 16) % most) as u8
    };
    let picture = RgbImage::from_fn(SIDE, SIDE, |x, y| {
        let shade = |period: f32, value: u32| 110.0 + 90.0 * (value as f32 / period).sin();
        Rgb([
            shade(90.0, x) as u8 + noise(24),
            shade(130.0, y) as u8 + noise(24),
            shade(210.0, x + y) as u8 + noise(24),
        ])
    });
    let mut encoded = Cursor::new(vec![]);
    match format {
        ImageFormat::Jpeg => picture.write_with_encoder(JpegEncoder::new_with_quality(&mut encoded, 92)),
        _ => picture.write_to(&mut encoded, format),
    }
    .expect("memory can be written");
    let encoded = encoded.into_inner();
    let count = (megabytes * 1e6 / encoded.len() as f64).round().max(1.0) as usize;
    let square = |part: usize| {
        let x = 1.1 * part as f64;
        [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x + 1.0, 1.0, 0.0], [x, 1.0, 0.0]]
            .map(DVec3::from_array)
            .to_vec()
    };
    let parts = (0..count).fold(SceneBuilder::new(), |builder, part| {
        builder.part("picture", &[square(part)], Material::grey(0.8).emitting(1.0))
    });
    let painting = (0..count).fold(Painting::new(&parts), |painting, part| {
        painting.coordinates(part, |place| [place.x - 1.1 * part as f64, place.y]).encoded_texture(
            part,
            &encoded,
            format,
            |material, texture| material["pbrMetallicRoughness"]["baseColorTexture"] = texture,
        )
    });
    painting.glb()
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
