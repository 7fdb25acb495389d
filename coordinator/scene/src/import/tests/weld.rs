//! Vertices that are nearly one.

use serde_json::json;

use crate::import::test_document::TestDocument;
use crate::import::{ImportOptions, import_slice};
use crate::model::Scene;

/// A square of two triangles with vertices of their own, 2 mm apart along the diagonal, and another node's square beside it
/// after a gap of 1 mm.
fn gappy() -> TestDocument {
    let mut document = TestDocument::with_triangles(
        &[
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 0.002, 0.0],
            [1.0, 1.002, 0.0],
            [0.0, 1.0, 0.0],
        ],
        &[0, 1, 2, 3, 4, 5],
    );
    document.root_node(json!({ "mesh": 0, "translation": [1.001, 0, 0] }));
    document
}

fn read(document: &TestDocument, weld: Option<f64>) -> Scene {
    import_slice(&document.glb(), &ImportOptions { weld, ..ImportOptions::default() }).unwrap()
}

#[test]
fn gaps_close_within_the_distance() {
    let document = gappy();
    let count = |weld: Option<f64>| {
        let scene = read(&document, weld);
        let mut points: Vec<_> = scene
            .surfaces
            .iter()
            .flat_map(|surface| &surface.facets)
            .flat_map(|facet| &facet.triangles)
            .flat_map(|triangle| triangle.positions)
            .map(|position| position.to_array().map(f64::to_bits))
            .collect();
        points.sort_unstable();
        points.dedup();
        let facets: usize = scene.surfaces.iter().map(|surface| surface.facets.len()).sum();
        (points.len(), facets)
    };
    assert_eq!(count(None), (12, 4));
    assert_eq!(count(Some(0.0005)), (12, 4));
    // Only the gap between the nodes, where it is 1 mm wide.
    assert_eq!(count(Some(0.0015)), (10, 4));
    assert_eq!(count(Some(0.003)), (6, 2));
}

#[test]
fn triangles_that_vanish_are_counted() {
    let mut document = gappy();
    let (positions, indices) = (
        document.vectors(&[[0.5, 0.5, 1.0], [0.5001, 0.5, 1.0], [0.5, 0.5001, 1.0]]),
        document.indices(&[0, 1, 2]),
    );
    document.node_with(json!({ "attributes": { "POSITION": positions }, "indices": indices, "material": 0 }));
    assert_eq!(read(&document, None).degenerate_triangles, 0);
    assert_eq!(read(&document, Some(0.003)).degenerate_triangles, 1);
}

#[test]
fn any_distance_gives_a_scene_or_an_error() {
    let document = gappy();
    for weld in [f64::MIN_POSITIVE, 1e-30, 1e-9, 1.0, 1e300, f64::MAX] {
        let _ =
            import_slice(&document.glb(), &ImportOptions { weld: Some(weld), ..ImportOptions::default() });
    }
}
