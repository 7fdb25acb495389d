//! Large dim emitters, whose light is gathered with that which surfaces reflect.

use bake::{BakeSettings, Baked, KeptLight, LightChange, LightGroup, NewLight, RowStrategy, relight};
use glam::DVec3;
use scene::Scene;
use serde_json::{Value, json};
use tests::baking::{baked, baked_by, imported, mean_irradiance};
use tests::builder::{Material, SceneBuilder};
use tests::painting::Painting;
use tests::shapes;

const TOP: usize = 3;

/// The unit cube under a lamp that is all of its ceiling; its walls and floor show a picture that glows.
fn glowing_room() -> Scene {
    let faces = shapes::unit_room().into_iter().enumerate();
    let builder = faces.fold(SceneBuilder::new(), |builder, (index, face)| {
        let grey = Material::grey(0.5);
        let material = if index == TOP { grey.emitting(1.0) } else { grey };
        builder.part(&format!("face {index}"), &[face], material)
    });
    // Each patch has a colour of its own.
    let level = |i: u32| (40 + i * 37 % 80) as u8;
    let texels: Vec<[u8; 4]> = (0..64).map(|i| [level(i), level(3 * i), level(7 * i + 5), 255]).collect();
    let glowing = |material: &mut Value, texture: Value| {
        material["emissiveTexture"] = texture;
        material["emissiveFactor"] = json!([1, 1, 1]);
    };
    let along: [fn(DVec3) -> [f64; 2]; 3] = [|p| [p.y, p.z], |p| [p.x, p.z], |p| [p.x, p.y]];
    let painted = (0..6).filter(|face| *face != TOP).fold(Painting::new(&builder), |painting, face| {
        painting.coordinates(face, along[face / 2]).texture(face, &texels, glowing)
    });
    imported(&painted.glb())
}

fn settings(rows: RowStrategy) -> BakeSettings {
    BakeSettings { rows, shooter_edge: 0.05, ..BakeSettings::for_error(0.05) }
}

fn sum(light: impl IntoIterator<Item = DVec3>) -> DVec3 {
    light.into_iter().sum()
}

/// Largest difference of mean irradiances, relative, over the faces.
fn worst_face(a: &Baked, b: &Baked) -> f64 {
    let difference =
        |face| (mean_irradiance(&a.lit, face) / mean_irradiance(&b.lit, face) - 1.0).abs().max_element();
    (0..6).map(difference).fold(0.0, f64::max)
}

#[test]
fn a_glowing_room_is_as_bright_as_with_a_row_for_each_emitter() {
    let scene = glowing_room();
    let [exact, gathered] =
        [RowStrategy::Exact, RowStrategy::Gather].map(|rows| baked(&scene, &settings(rows)));
    // One source for each face, where a row for each patch of equal exitance is needed otherwise.
    assert!(exact.report.model.area_lights > 256, "{}", exact.report.model.area_lights);
    assert_eq!(gathered.report.model.area_lights, 6);
    let worst = worst_face(&exact, &gathered);
    assert!(worst <= 0.02, "off by {:.3} %", 100.0 * worst);
    let balance = &gathered.report.balance;
    assert!(balance.relative_imbalance().abs() <= 0.01, "{balance:?}");
}

#[test]
fn what_glows_has_light_of_its_own_in_groups_and_can_be_changed() {
    let scene = glowing_room();
    let group = |name: &str, lights: &[&str]| LightGroup {
        name: name.to_owned(),
        lights: lights.iter().map(|light| (*light).to_owned()).collect(),
    };
    let rest = ["face 0", "face 1", "face 3", "face 4", "face 5"];
    let settings = BakeSettings {
        groups: vec![group("floor", &["face 2"]), group("rest", &rest)],
        keep_light: Some(u64::MAX),
        ..settings(RowStrategy::Gather)
    };
    let before = baked(&scene, &settings);
    let irradiance = |baked: &bake::lit::LitMesh| sum(baked.vertices.iter().map(|vertex| vertex.irradiance));
    let whole = irradiance(&before.lit);
    let [of_floor, of_rest] =
        [0, 1].map(|layer: usize| sum(before.lit.layers[layer].irradiance.iter().copied()));
    let off = ((of_floor + of_rest) / whole - 1.0).abs().max_element();
    assert!(off <= 1e-3, "{of_floor} and {of_rest} of {whole}");
    assert!(of_floor.min_element() > 0.02 * whole.max_element(), "{of_floor} of {whole}");

    let kept = KeptLight::from_bytes(&before.kept.unwrap().to_bytes()).unwrap();
    let change = LightChange { light: "face 2".to_owned(), factor: DVec3::splat(3.0) };
    let light = NewLight { changes: vec![change], ..NewLight::default() };
    let after = relight(&scene, &kept, &light).unwrap_or_else(|error| panic!("{error}"));
    // Not all vertices are the same, but the mean hardly depends on them.
    let mean = |lit: &bake::lit::LitMesh, light: DVec3| light / lit.vertices.len() as f64;
    let expected = mean(&before.lit, whole + 2.0 * of_floor);
    let found = mean(&after.lit, irradiance(&after.lit));
    assert!((found / expected - 1.0).abs().max_element() <= 0.02, "{found}, not {expected}");
}

#[test]
fn glowing_rooms_have_the_same_bits_whatever_the_threads() {
    let scene = glowing_room();
    let bits = |threads| -> Vec<[u64; 3]> {
        let lit = baked_by(&scene, &settings(RowStrategy::Gather), threads).lit;
        lit.vertices.iter().map(|vertex| vertex.irradiance.to_array().map(f64::to_bits)).collect()
    };
    assert_eq!(bits(1), bits(3));
}
