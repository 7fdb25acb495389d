//! Files that cannot be baked, and files that can in spite of a fault.

use std::fs;

use serde_json::{Value, json};
use tests::builder::{Material, SceneBuilder, pack};
use tests::shapes;

use super::{Bench, good_scene};

/// The room after a change to its JSON.
fn changed(change: impl Fn(&mut Value)) -> Bench {
    let (mut document, binary) = good_scene().document();
    change(&mut document);
    Bench::new("changed.glb", &pack(&document, &binary))
}

/// The room with another number as the first coordinate.
fn first_coordinate(value: f32) -> Bench {
    let (document, mut binary) = good_scene().document();
    binary[..4].copy_from_slice(&value.to_le_bytes());
    Bench::new("changed.glb", &pack(&document, &binary))
}

#[test]
fn not_a_gltf() {
    Bench::new("picture.glb", b"\x89PNG\r\n\x1a\n and so on").assert_input_refused(&["not a glTF", "export"]);
    Bench::new("notes.gltf", b"{ \"asset\": ").assert_input_refused(&["export"]);
    Bench::new("empty.glb", b"").assert_input_refused(&["export"]);
}

#[test]
fn truncated() {
    let glb = good_scene().glb();
    for length in [13, 40, glb.len() / 2, glb.len() - 1] {
        Bench::new("part.glb", &glb[..length]).assert_input_refused(&["truncated", "again"]);
    }
}

#[test]
fn missing() {
    let bench = Bench::good();
    let elsewhere = bench.folder.path().join("elsewhere.glb");
    let name = elsewhere.display().to_string();
    let bench = Bench { input: elsewhere, ..bench };
    let answer = bench.run(&bench.output(), &[]);
    assert!(!answer.success);
    answer.assert_said(&[&name, "cannot be read", "check the path"]);
    assert!(!bench.output().exists());
}

#[test]
fn cyclic_nodes() {
    let cyclic = changed(|document| {
        document["nodes"][0]["children"] = json!([1]);
        let nodes = document["nodes"].as_array_mut().unwrap();
        nodes.push(json!({ "name": "loop", "children": [0] }));
    });
    cyclic.assert_input_refused(&["node \"walls\"", "cycle", "repair the hierarchy"]);
}

#[test]
fn accessor_out_of_bounds() {
    let beyond = changed(|document| document["accessors"][0]["count"] = json!(1_000_000));
    beyond.assert_input_refused(&["node \"walls\"", "accessor 0", "outside its buffer", "export it again"]);
}

#[test]
fn positions_that_are_not_finite() {
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        first_coordinate(value).assert_input_refused(&["node \"walls\"", "not finite", "repair the mesh"]);
    }
}

#[test]
fn no_triangles() {
    let lines = changed(|document| document["meshes"][0]["primitives"][0]["mode"] = json!(1));
    lines.assert_input_refused(&["no triangles", "add a mesh"]);
}

#[test]
fn no_light() {
    let dark = SceneBuilder::new().part("walls", &shapes::unit_room(), Material::grey(0.5));
    Bench::new("dark.glb", &dark.glb()).assert_input_refused(&[
        "no light",
        "emissiveFactor",
        "KHR_lights_punctual",
    ]);
}

#[test]
fn damaged_compression() {
    let damaged = changed(|document| {
        document["extensionsUsed"] = json!(["EXT_meshopt_compression"]);
        document["extensionsRequired"] = json!(["EXT_meshopt_compression"]);
        document["bufferViews"][0]["extensions"]["EXT_meshopt_compression"] =
            json!({ "buffer": 0, "byteLength": 16, "byteStride": 12, "count": 4, "mode": "ATTRIBUTES" });
    });
    damaged.assert_input_refused(&["buffer view 0", "meshoptimizer", "cannot be decoded", "export it again"]);
}

#[test]
fn external_file_missing() {
    let (mut document, _) = good_scene().document();
    document["buffers"][0]["uri"] = json!("geometry.bin");
    let bench = Bench::new("apart.gltf", document.to_string().as_bytes());
    bench.assert_input_refused(&["geometry.bin", "cannot be read", "put it next to the glTF"]);
}

#[test]
fn output_that_cannot_be_written() {
    let bench = Bench::good();
    let folder = bench.folder.path();
    bench.assert_refused(&folder.join("nowhere/lit.glb"), &[], &["nowhere", "does not exist", "create it"]);
    bench.assert_refused(&folder.join("lit.obj"), &[], &["lit.obj", "must end in .glb, .gltf or .ply"]);
    let report = folder.join("nowhere/report.json").display().to_string();
    bench.assert_refused(&bench.output(), &["--report", &report], &[&report, "cannot be written"]);
    // A folder where the file should be.
    let other = tempfile::tempdir().unwrap();
    let taken = other.path().join("taken.glb");
    fs::create_dir(&taken).unwrap();
    bench.assert_refused(&taken, &[], &["taken.glb", "is a directory", "name a file"]);
}

/// What was there before stays as it was.
#[test]
fn refusal_leaves_an_older_output_alone() {
    let bench = Bench::new("picture.glb", b"no scene");
    let other = tempfile::tempdir().unwrap();
    let older = other.path().join("lit.glb");
    fs::write(&older, b"older").unwrap();
    bench.assert_refused(&older, &[], &["not a glTF"]);
    assert_eq!(fs::read(&older).unwrap(), b"older");
}

#[test]
fn reflectance_of_one_is_clamped_with_a_warning() {
    let glowing = Material::grey(1.0).emitting(1.0);
    let panel = shapes::turned(&shapes::triangle_grid(1));
    // Open to the sky: light that nothing absorbs could not settle in a closed room.
    let bench = Bench::new("white.glb", &SceneBuilder::new().part("panel", &panel, glowing).glb());
    let answer = bench.run(&bench.output(), &[]);
    assert!(answer.success, "{}", answer.stderr);
    answer.assert_said(&["warning: ", "panel", "reflectance"]);
    assert!(bench.output().exists());
}

#[test]
fn triangles_without_area_are_dropped_and_counted() {
    let [a, b, c] = [0.1, 0.2, 0.4].map(glam::DVec3::splat);
    let mut polygons = shapes::unit_room();
    polygons.extend([vec![a, b, c], vec![a, a, b]]);
    let scene = SceneBuilder::new().part("walls", &polygons, Material::grey(0.5).emitting(1.0));
    let bench = Bench::new("slivers.glb", &scene.glb());
    let answer = bench.run(&bench.output(), &[]);
    assert!(answer.success, "{}", answer.stderr);
    answer.assert_said(&[]);
    assert!(answer.stdout.contains("2 triangles without area"), "{}", answer.stdout);
}
