//! The exporter as a whole: scenes made by hand in, files read back.

mod attributes;
mod document;
mod extensions;
mod files;
mod geometry;
mod ply;

use std::fs;

use fixtures::Builder;
use glam::DVec3;
use gltf::{Gltf, Semantic};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::*;

/// These primitives in one node of a document.
fn in_one_node(builder: Builder, primitives: Value, mut document: Value) -> Scene {
    document["meshes"] = json!([{ "primitives": primitives }]);
    document["nodes"] = json!([{ "mesh": 0 }]);
    document["scenes"] = json!([{ "nodes": [0] }]);
    builder.import(document)
}

/// A square of the first material of a document.
fn square_of(document: Value) -> Scene {
    let mut builder = Builder::default();
    let mut square = builder.square();
    square["material"] = 0.into();
    in_one_node(builder, json!([square]), document)
}

fn settings() -> ExportSettings {
    ExportSettings {
        exposure: Some(0.5),
        unit: "W/m^2".into(),
        extras: json!({"shots": 7}),
        ..ExportSettings::default()
    }
}

/// Exports to a file of a new directory and reads it back.
fn round_trip(scene: &Scene, lit: &LitMesh) -> (Exported, Gltf) {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("lit.glb");
    let exported = export(scene, lit, &settings(), &path).unwrap();
    assert_eq!(fs::read_dir(&directory).unwrap().count(), 1, "nothing but the output");
    (exported, fixtures::opened(&path))
}

/// The rows of an attribute of the output.
fn attribute(gltf: &Gltf, primitive: &gltf::Primitive<'_>, semantic: &Semantic) -> Vec<Vec<f32>> {
    let accessor = primitive.get(semantic).unwrap();
    let view = accessor.view().unwrap();
    let width = accessor.dimensions().multiplicity();
    let bytes = &gltf.blob.as_ref().unwrap()[view.offset()..][..accessor.count() * width * 4];
    let floats: Vec<f32> = bytes.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    floats.chunks_exact(width).map(<[f32]>::to_vec).collect()
}

fn point(row: &[f32]) -> DVec3 {
    DVec3::new(row[0].into(), row[1].into(), row[2].into())
}

fn indices(gltf: &Gltf, primitive: &gltf::Primitive<'_>) -> Vec<u32> {
    primitive.reader(|_| gltf.blob.as_deref()).read_indices().unwrap().into_u32().collect()
}

fn irradiance() -> Semantic {
    Semantic::Extras("IRRADIANCE".into())
}

fn first_primitive(gltf: &Gltf, node: usize) -> gltf::Primitive<'_> {
    gltf.nodes().nth(node).unwrap().mesh().unwrap().primitives().next().unwrap()
}
