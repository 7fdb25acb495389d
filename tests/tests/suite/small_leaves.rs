//! Many small triangles, each for itself: their corners share a receiver where light is gathered.

use std::f64::consts::TAU;

use bake::{BakeSettings, Baked, LightGroup, NewLight, RowStrategy, relight};
use glam::{DMat4, DVec3};
use scene::Scene;
use serde_json::json;
use tests::baking::{baked, imported, mean_irradiance};
use tests::builder::{Material, SceneBuilder};
use tests::shapes::{self, Polygon};

/// Index of the surface that the crumbs are.
const CRUMBS: usize = 2;

/// More than a mesh may have whose receivers all cast rays.
const COUNT: usize = 10_000;

/// A part of the unit interval for each number, evenly spread.
fn part(number: usize, step: f64) -> f64 {
    (number as f64 * step).fract()
}

/// A unit room with a lamp, a bulb and a cloud of crumbs, each facing its own way.
fn scene() -> Scene {
    let lamp = [(0.4, 0.4), (0.6, 0.4), (0.6, 0.6), (0.4, 0.6)].map(|(x, z)| DVec3::new(x, 0.98, z));
    let crumb = |number: usize| -> Polygon {
        let place = DVec3::new(part(number, 0.754_877), part(number, 0.569_84), part(number, 0.618_034));
        let place = DVec3::splat(0.2) + place * DVec3::new(0.6, 0.4, 0.6);
        let (height, turn) = (2.0 * part(number, 0.324_718) - 1.0, TAU * part(number, 0.206_99));
        let flat = (1.0 - height * height).sqrt();
        let normal = DVec3::new(flat * turn.cos(), height, flat * turn.sin());
        let (along, across) = normal.any_orthonormal_pair();
        vec![place, place + 1e-3 * along, place + 1e-3 * across]
    };
    imported(
        &SceneBuilder::new()
            .part("walls", &shapes::unit_room(), Material::grey(0.6))
            .part("lamp", &[lamp.to_vec()], Material::grey(0.0).emitting(40.0))
            .part("crumbs", &(0..COUNT).map(crumb).collect::<Vec<_>>(), Material::grey(0.5))
            .light(
                json!({ "type": "point", "name": "bulb", "intensity": 1.0 }),
                DMat4::from_translation(DVec3::new(0.2, 0.8, 0.3)),
            )
            .glb(),
    )
}

fn settings() -> BakeSettings {
    let group = |name: &str, light: &str| LightGroup { name: name.into(), lights: vec![light.into()] };
    BakeSettings {
        rows: RowStrategy::Gather,
        groups: vec![group("one", "lamp"), group("other", "bulb")],
        keep_light: Some(u64::MAX),
        simplify: false,
        threshold: 1e-6,
        validation_samples: 512,
        ..BakeSettings::for_error(0.1)
    }
}

fn even_crumbs(baked: &Baked) -> usize {
    let is_even = |vertices: &[u32; 3]| {
        let [a, b, c] = vertices.map(|vertex| baked.lit.vertices[vertex as usize].irradiance);
        a == b && b == c
    };
    baked.lit.surfaces[CRUMBS].iter().filter(|triangle| is_even(&triangle.vertices)).count()
}

#[test]
fn crumbs_are_lit_as_a_whole_as_they_are_corner_by_corner() {
    let scene = scene();
    let shared = baked(&scene, &settings());
    assert_eq!(shared.lit.surfaces[CRUMBS].len(), COUNT);
    assert_eq!(even_crumbs(&shared), COUNT, "each has one receiver");
    // A limit of edges gives each vertex its own.
    let own = baked(&scene, &BakeSettings { max_edge: Some(1.0), ..settings() });
    assert!(even_crumbs(&own) < COUNT / 2);
    for surface in [0, CRUMBS] {
        let [one, other] = [&shared, &own].map(|baked| mean_irradiance(&baked.lit, surface).x);
        assert!((one / other - 1.0).abs() < 0.02, "{one} and {other} on surface {surface}");
    }
    let report = &shared.report;
    assert!(report.vertices > 3 * COUNT + 100, "the walls are refined: {}", report.vertices);
    assert!(report.error.total <= 0.1, "{:?}", report.error);
    assert!(report.balance.relative_imbalance().abs() < 0.02, "{:?}", report.balance);

    let whole = shared.lit.vertices.iter().map(|vertex| vertex.irradiance);
    let layers = shared.lit.layers[0].irradiance.iter().zip(&shared.lit.layers[1].irradiance);
    let largest = whole.clone().map(|light| light.x).fold(0.0, f64::max);
    for (whole, (one, other)) in whole.zip(layers) {
        let off = (*one + *other - whole).abs().max_element();
        assert!(off < 1e-5 * largest, "{one} and {other} are not {whole}");
    }
    let relit = relight(&scene, shared.kept.as_ref().unwrap(), &NewLight::default()).unwrap();
    assert_eq!(relit.lit.vertices.len(), shared.lit.vertices.len());
    for (relit, baked) in relit.lit.vertices.iter().zip(&shared.lit.vertices) {
        let off = (relit.irradiance - baked.irradiance).abs().max_element();
        assert!(off < 1e-4 * largest, "{} in place of {}", relit.irradiance, baked.irradiance);
    }
}
