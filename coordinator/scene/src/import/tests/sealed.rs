//! Insides of closed bodies, which no light reaches.

use serde_json::{Value, json};

use crate::import::test_document::TestDocument;
use crate::model::{Scene, Side};

/// Corners of the unit cube moved by `x`, and its triangles, counter-clockwise seen from outside.
fn cube(x: f32) -> (Vec<[f32; 3]>, Vec<u32>) {
    let corners = (0..8u8).map(|i| [x + f32::from(i & 1), f32::from(i >> 1 & 1), f32::from(i >> 2)]);
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = sides.into_iter().flat_map(|[a, b, c, d]| [a, b, c, a, c, d]);
    (corners.collect(), triangles.collect())
}

fn turned(triangles: &[u32]) -> Vec<u32> {
    triangles.chunks_exact(3).flat_map(|corners| [corners[0], corners[2], corners[1]]).collect()
}

/// A double-sided mesh of these triangles under the sun.
fn double_sided(points: &[[f32; 3]], triangles: &[u32]) -> TestDocument {
    lit_by(json!({ "type": "directional" }), [0.0; 3], points, triangles)
}

fn lit_by(light: Value, place: [f64; 3], points: &[[f32; 3]], triangles: &[u32]) -> TestDocument {
    let mut document = TestDocument::with_triangles(points, triangles);
    document.root["materials"] = json!([{ "doubleSided": true }]);
    document.root["meshes"][0]["primitives"][0]["material"] = json!(0);
    document.light(light, json!({ "translation": place }));
    document
}

/// Fronts and backs that are sealed, and all facets.
fn sealed(scene: &Scene) -> [usize; 3] {
    let count = |side: Option<Side>| {
        let own = scene.surfaces.iter().filter(|surface| side.is_none_or(|side| surface.side == side));
        own.flat_map(|surface| &surface.facets).filter(|facet| side.is_none() || facet.is_sealed).count()
    };
    [count(Some(Side::Front)), count(Some(Side::Back)), count(None)]
}

#[test]
fn the_inside_of_a_closed_body_is_sealed() {
    let (points, triangles) = cube(0.0);
    let scene = double_sided(&points, &triangles).scene();
    assert_eq!(sealed(&scene), [0, 6, 12]);
    assert_eq!((scene.vertex_count, scene.sealed_vertex_count), (48, 24));
    assert!(scene.import_report.ignored.iter().any(|kind| kind.starts_with("12 backs")), "{scene:?}");
}

#[test]
fn nothing_is_sealed_that_light_may_reach() {
    let (points, triangles) = cube(0.0);
    let open = double_sided(&points, &triangles[3..]);
    // A room: its fronts are inside, its backs in the sun.
    let inside_out = double_sided(&points, &turned(&triangles));
    let lamp_inside = lit_by(json!({ "type": "point" }), [0.5; 3], &points, &triangles);
    let with = |material: Value| {
        let mut document = double_sided(&points, &triangles);
        document.root["materials"] = json!([material]);
        document
    };
    let glowing = with(json!({ "doubleSided": true, "emissiveFactor": [1, 1, 1] }));
    let glass = with(json!({
        "doubleSided": true, "alphaMode": "BLEND", "pbrMetallicRoughness": { "baseColorFactor": [1, 1, 1, 0.5] }
    }));
    let mut inconsistent = triangles.clone();
    inconsistent.swap(1, 2);
    let inconsistent = double_sided(&points, &inconsistent);
    let cases = [open, inside_out, lamp_inside, glowing, glass, inconsistent];
    for (index, document) in cases.into_iter().enumerate() {
        assert_eq!(sealed(&document.scene())[..2], [0, 0], "case {index}");
    }
}

#[test]
fn a_lamp_beside_a_body_leaves_its_inside_dark() {
    let (points, triangles) = cube(0.0);
    let document = lit_by(json!({ "type": "point" }), [1.5, 0.5, 0.5], &points, &triangles);
    assert_eq!(sealed(&document.scene()), [0, 6, 12]);
}

/// Each goes around its own inside, also where the two share edges, or one is in the other.
#[test]
fn bodies_that_touch_are_sealed_too() {
    let (mut points, mut triangles) = cube(0.0);
    let (more, others) = cube(1.0);
    points.extend(more);
    triangles.extend(others.iter().map(|corner| corner + 8));
    let [fronts, backs, _] = sealed(&double_sided(&points, &triangles).scene());
    // Of the two sides where they touch, one is hidden by the other.
    assert_eq!(fronts, 0);
    assert!(backs >= 10, "{backs}");

    let (mut points, mut triangles) = cube(0.0);
    points.extend(points.clone().iter().map(|point| point.map(|x| 0.25 + 0.5 * x)));
    triangles.extend(triangles.clone().iter().map(|corner| corner + 8));
    assert_eq!(sealed(&double_sided(&points, &triangles).scene())[1], 12);
}

/// A body that is closed only by another mesh's triangles is closed.
#[test]
fn a_body_of_two_primitives_is_closed() {
    let (points, triangles) = cube(0.0);
    let mut document = double_sided(&points, &triangles[..18]);
    let positions = document.vectors(&points);
    let indices = document.indices(&triangles[18..]);
    let rest = json!({ "attributes": { "POSITION": positions }, "indices": indices, "material": 0 });
    document.root["meshes"][0]["primitives"].as_array_mut().unwrap().push(rest);
    assert_eq!(sealed(&document.scene()), [0, 6, 12]);
}
