//! Which facets share a plane.

use glam::DVec3;
use serde_json::json;

use crate::import::test_document::TestDocument;
use crate::model::Scene;

/// The square once more, elsewhere.
fn two_squares(second: serde_json::Value) -> Scene {
    let mut document = TestDocument::square();
    let node = document.root_node(json!({ "mesh": 0 }));
    document.root["nodes"][node].as_object_mut().unwrap().extend(second.as_object().unwrap().clone());
    document.scene()
}

#[test]
fn coplanar_facets_of_different_nodes_share_their_plane() {
    assert_eq!(two_squares(json!({ "translation": [5, 7, 0] })).plane_count, 1);
    // Facing the other way, and overlapping.
    assert_eq!(two_squares(json!({ "rotation": [1, 0, 0, 0] })).plane_count, 1);
    // Much smaller.
    assert_eq!(two_squares(json!({ "scale": [0.001, 0.001, 1] })).plane_count, 1);
    // By less than a millionth of the scene.
    assert_eq!(two_squares(json!({ "translation": [0.5, 0, 5e-7] })).plane_count, 1);
}

#[test]
fn parallel_and_tilted_facets_have_planes_of_their_own() {
    assert_eq!(two_squares(json!({ "translation": [0, 0, 1e-5] })).plane_count, 2);
    assert_eq!(two_squares(json!({ "translation": [0, 0, 1] })).plane_count, 2);
    let half = 5e-4f64;
    assert_eq!(two_squares(json!({ "rotation": [half.sin(), 0, 0, half.cos()] })).plane_count, 2);
    // Small and tilted: all its corners are near the other's plane, but it faces elsewhere.
    let tilt = json!({ "rotation": [0.1, 0, 0, 0.99f64.sqrt()], "scale": [1e-7, 1e-7, 1e-7] });
    assert_eq!(two_squares(tilt).plane_count, 2);
}

#[test]
fn tilted_floor_of_many_tiles_is_one_plane() {
    let mut document = TestDocument::square();
    for i in 1..50 {
        document.root_node(json!({ "mesh": 0, "translation": [1.5 * f64::from(i), 0, 0] }));
    }
    let children: Vec<usize> = (0..50).collect();
    let parent =
        document.push("nodes", json!({ "children": children, "rotation": [0.1, 0.2, 0.3, 0.86f64.sqrt()] }));
    document.root["scenes"][0]["nodes"] = json!([parent]);
    let scene = document.scene();
    assert_eq!((scene.surfaces.len(), scene.plane_count), (50, 1));
}

#[test]
fn plane_ids_are_below_their_number_and_mean_one_plane() {
    let mut document = TestDocument::square();
    for i in 0..40 {
        let (x, y) = (f64::from(i % 7), f64::from(i % 5));
        document.root_node(json!({ "mesh": 0, "translation": [x, y, x * y], "rotation": [0.6, 0, 0, 0.8] }));
    }
    let scene = document.scene();
    let facets: Vec<_> = scene.surfaces.iter().flat_map(|surface| &surface.facets).collect();
    assert!((0..scene.plane_count).all(|id| facets.iter().any(|facet| facet.plane.0 == id)));
    for (i, a) in facets.iter().enumerate() {
        for b in &facets[..i] {
            let distance =
                b.corners.iter().map(|corner| (corner.position - a.corners[0].position).dot(a.normal).abs());
            let coplanar = distance.fold(0.0, f64::max) < 1e-3 && a.normal.cross(b.normal) == DVec3::ZERO;
            assert_eq!(a.plane == b.plane, coplanar);
        }
    }
}
