//! Which of coplanar layers is lit.

use glam::DVec3;
use kernel::geometry::area_vector;
use proptest::prelude::*;
use serde_json::{Value, json};

use crate::facet::Facet;
use crate::import::test_document::TestDocument;
use crate::import::{ImportOptions, import_slice};
use crate::model::{Scene, Side, Surface};

/// The unit square at these places, one node each.
fn squares(places: &[Value]) -> TestDocument {
    let mut document = TestDocument::square();
    for (index, place) in places.iter().enumerate() {
        let node = if index == 0 { 0 } else { document.root_node(json!({ "mesh": 0 })) };
        document.root["nodes"][node].as_object_mut().unwrap().extend(place.as_object().unwrap().clone());
    }
    document
}

/// Area of a surface, in the file's units.
fn area(scene: &Scene, surface: &Surface) -> f64 {
    let own = surface.facets.iter().map(|facet| area_vector(&facet.polygon().corners).length());
    own.sum::<f64>() * scene.frame.scale * scene.frame.scale
}

fn areas(scene: &Scene) -> Vec<f64> {
    scene.surfaces.iter().map(|surface| (area(scene, surface) * 1e6).round() / 1e6).collect()
}

#[test]
fn the_first_of_two_layers_is_lit() {
    let scene = squares(&[json!({}), json!({ "translation": [0.25, 0.5, 0.0], "name": "upper" })]).scene();
    assert_eq!(areas(&scene), [1.0, 1.0 - 0.75 * 0.5]);
    assert_eq!(scene.warnings.len(), 1);
    assert!(scene.warnings[0].contains("upper") && scene.warnings[0].contains("3.750e-1"), "{scene:?}");
}

#[test]
fn layers_on_one_another_are_lit_once() {
    for shift in [0.0, 1e-7] {
        let places: Vec<Value> =
            (0..5).map(|n| json!({ "translation": [shift * f64::from(n), 0, 0] })).collect();
        let scene = squares(&places).scene();
        assert_eq!(areas(&scene), [1.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(scene.warnings.len(), 4, "{:?}", scene.warnings);
    }
}

#[test]
fn neighbours_and_backs_are_no_layers() {
    let beside = [json!({}), json!({ "translation": [1, 0, 0] }), json!({ "translation": [0.5, 1, 0] })];
    // About the x axis: facing the other way.
    let turned = [json!({}), json!({ "rotation": [1, 0, 0, 0], "translation": [0, 1, 0] })];
    for places in [beside.to_vec(), turned.to_vec()] {
        let scene = squares(&places).scene();
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        assert!(areas(&scene).iter().all(|area| *area == 1.0));
    }
}

#[test]
fn both_sides_of_one_of_two_sheets_are_lit() {
    for rotation in [json!([0, 0, 0, 1]), json!([1, 0, 0, 0])] {
        let mut document = squares(&[json!({}), json!({ "rotation": rotation, "translation": [0, 0.5, 0] })]);
        document.root["materials"][0]["doubleSided"] = json!(true);
        let scene = document.scene();
        let sides: Vec<Side> = scene.surfaces.iter().map(|surface| surface.side).collect();
        assert_eq!(sides, [Side::Front, Side::Back, Side::Front, Side::Back]);
        assert_eq!(areas(&scene), [1.0, 1.0, 0.5, 0.5]);
    }
}

/// Opaque ones before translucent ones, and lamps before others.
#[test]
fn some_layers_go_before_the_first() {
    let opaque = json!({ "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1.0] } });
    let glass =
        json!({ "alphaMode": "BLEND", "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 0.5] } });
    let lamp = json!({ "emissiveFactor": [1.0, 1.0, 1.0] });
    for (first, second) in [(&glass, &opaque), (&opaque, &lamp), (&glass, &lamp)] {
        let mut document = squares(&[json!({}), json!({ "translation": [0.5, 0, 0] })]);
        document.root["materials"] = json!([first, second]);
        let mut mesh = document.root["meshes"][0].clone();
        mesh["primitives"][0]["material"] = json!(1);
        let mesh = document.push("meshes", mesh);
        document.root["nodes"][1]["mesh"] = json!(mesh);
        let options = ImportOptions { needs_light: false, ..ImportOptions::default() };
        let scene = import_slice(&document.glb(), &options).unwrap();
        assert_eq!(areas(&scene), [0.5, 1.0], "{first} {second}");
    }
}

/// How far inside of a polygon a point lies.
fn depth(corners: &[DVec3], point: DVec3) -> f64 {
    let next = corners.iter().cycle().skip(1);
    let height = |(a, b): (&DVec3, &DVec3)| (*b - *a).cross(point - *a).z / a.distance(*b);
    corners.iter().zip(next).map(height).fold(f64::INFINITY, f64::min)
}

proptest! {
    /// Each point under a triangle is covered once, every other not at all.
    #[test]
    fn layers_cover_what_they_covered(
        corners in prop::collection::vec([0.0..1.0_f32, 0.0..1.0_f32, 0.05..0.7_f32, -0.6..0.6_f32, 0.05..0.7_f32], 1..12),
        points in prop::collection::vec([0.0..1.5, -0.5..1.5], 50),
    ) {
        let triangles: Vec<[[f32; 3]; 3]> =
            corners.iter().map(|[x, y, w, d, h]| [[*x, *y, 0.0], [x + w, y + d, 0.0], [*x, y + h, 0.0]]).collect();
        let positions = triangles.as_flattened();
        let indices: Vec<u32> = (0..positions.len() as u32).collect();
        let scene = TestDocument::with_triangles(positions, &indices).scene();
        let facets = || scene.surfaces.iter().flat_map(|surface| &surface.facets);
        let polygon = |facet: &Facet| facet.positions().map(|corner| scene.frame.to_world(corner)).collect::<Vec<_>>();
        for [x, y] in points {
            let point = DVec3::new(x, y, 0.0);
            let before: Vec<f64> = triangles.iter().map(|own| depth(&own.map(|c| DVec3::from_array(c.map(f64::from))), point)).collect();
            let after: Vec<f64> = facets().map(|facet| depth(&polygon(facet), point)).collect();
            // Not on an edge.
            if before.iter().chain(&after).all(|depth| depth.abs() > 1e-5) {
                let found = after.iter().filter(|depth| **depth > 0.0).count();
                let expected = usize::from(before.iter().any(|depth| *depth > 0.0));
                prop_assert_eq!(found, expected, "at {}", point);
            }
        }
    }
}

/// Hundreds of layers, each a little aside of the one before, are bounded and quick.
#[test]
fn many_layers() {
    let places: Vec<Value> = (0..300)
        .map(f64::from)
        .map(|n| json!({ "translation": [(n * 0.618).fract(), (n * 0.414).fract(), 0] }))
        .collect();
    let scene = squares(&places).scene();
    let all: f64 = areas(&scene).iter().sum();
    assert!((all - 4.0).abs() < 0.1, "{all}");
    assert!(scene.warnings.len() < 12);
    let facets: usize = scene.surfaces.iter().map(|surface| surface.facets.len()).sum();
    assert!(facets < 3000, "{facets}");
}
