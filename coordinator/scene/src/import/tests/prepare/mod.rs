//! Documents that need to be made plain, and what comes out of import and export.

mod damage;
mod instances;
mod meshopt;
mod pose;
mod quantization;

use serde_json::{Value, json};

use crate::import::test_document::TestDocument;

/// Says that the document requires an extension.
fn require(document: &mut TestDocument, name: &str) {
    document.root["extensionsUsed"] = json!([name]);
    document.root["extensionsRequired"] = json!([name]);
}

/// The only primitive.
fn primitive(document: &mut TestDocument) -> &mut Value {
    &mut document.root["meshes"][0]["primitives"][0]
}

/// World positions of the first triangle of the first surface of every node, by node.
fn first_triangles(scene: &crate::Scene) -> Vec<(usize, [[f64; 3]; 3])> {
    let world = |position| scene.frame.to_world(position).to_array().map(|value| (value * 1e4).round() / 1e4);
    let first = |surface: &crate::Surface| surface.facets[0].triangles[0].positions.map(world);
    scene.surfaces.iter().map(|surface| (surface.node, first(surface))).collect()
}

/// A file of the compressed scenes.
fn fixture(name: &str) -> std::path::PathBuf {
    let folder = std::path::PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/compressed");
    folder.join(format!("{name}.glb"))
}
