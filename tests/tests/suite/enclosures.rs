//! A closed cube with light in it, against exact answers.

use bake::{BakeSettings, Baked};
use glam::DVec3;
use scene::Scene;
use tests::baking::{area_and_flux, baked, imported, mean_irradiance};
use tests::builder::{Material, SceneBuilder};
use tests::cases::case;
use tests::shapes;

/// Names of the cube's faces, in the order of [`shapes::unit_room`].
const FACES: [&str; 6] = ["left", "right", "bottom", "top", "front", "back"];
const LEFT: usize = 0;
const BOTTOM: usize = 2;
const TOP: usize = 3;

/// The unit cube, each face a part of its own.
fn cube(material: impl Fn(usize) -> Material) -> SceneBuilder {
    let faces = shapes::unit_room().into_iter().zip(FACES).enumerate();
    faces.fold(SceneBuilder::new(), |builder, (index, (face, name))| {
        builder.part(name, &[face], material(index))
    })
}

/// Largest error of the face averages of a cube whose bottom emits, relative to those of the continuous limit.
fn worst_face_average(settings: &BakeSettings) -> f64 {
    let expected = case("D20").values();
    let mut worst = 0.0_f64;
    for (reflectance, expected) in [0.5, 0.9].into_iter().zip(expected.chunks(3)) {
        let emitted = |face| f64::from(u8::from(face == BOTTOM));
        let scene = imported(&cube(|face| Material::grey(reflectance).emitting(emitted(face))).glb());
        let lit = baked(&scene, settings).lit;
        for (face, expected) in [(BOTTOM, expected[0]), (TOP, expected[1]), (LEFT, expected[2])] {
            let found = emitted(face) + reflectance * mean_irradiance(&lit, face).x;
            worst = worst.max((found / expected - 1.0).abs());
        }
    }
    worst
}

/// 0.3 % at default quality; and on even meshes, with edges from a quarter of the cube's to a sixteenth, less by half or more
/// at every step: first order in the edge at least.
#[test]
fn cube_with_one_emitting_face() {
    let usual = worst_face_average(&BakeSettings::default());
    assert!(usual <= 0.003, "off by {:.3} %", usual * 100.0);
    let even = |shooter_edge| BakeSettings {
        shooter_edge,
        mesh_error: 1e3,
        validation_samples: 0,
        ..BakeSettings::default()
    };
    let [coarse, middle, fine] = [0.25, 0.125, 0.0625].map(|edge| worst_face_average(&even(edge)));
    assert!(middle <= coarse / 2.0, "off by {middle:e} after {coarse:e}");
    assert!(fine <= middle / 2.0, "off by {fine:e} after {middle:e}");
}

/// The cube with a point light of 1 W.
fn cube_around_light(light: DVec3, reflectance: f64, settings: &BakeSettings) -> (Scene, Baked) {
    let intensity = 1.0 / (4.0 * std::f64::consts::PI);
    let scene = imported(&cube(|_| Material::grey(reflectance)).point_light(light, intensity).glb());
    let baked = baked(&scene, settings);
    (scene, baked)
}

/// Flux on a face, W.
fn flux(scene: &Scene, baked: &Baked, face: usize, counts: impl Fn(DVec3) -> bool) -> f64 {
    let in_file_units = |middle| counts(scene.frame.to_world(middle));
    area_and_flux(&baked.lit, face, in_file_units).1.x * scene.frame.scale * scene.frame.scale
}

/// Every face gets a sixth of all light, and every quarter of a face a quarter of that, with all interreflection: 1 W / (1 - rho)
/// falls on the walls in all.
#[test]
fn isotropic_light_in_the_middle() {
    let [face_part, quarter_part] = case("D15").values()[..] else { panic!("two values") };
    let (scene, baked) = cube_around_light(DVec3::splat(0.5), 0.5, &BakeSettings::default());
    for (face, name) in FACES.iter().enumerate() {
        let whole = flux(&scene, &baked, face, |_| true);
        assert!((whole / (2.0 * face_part) - 1.0).abs() <= 0.005, "{name}: {whole} W");
        let is_low = |middle: DVec3| middle.to_array().iter().filter(|value| **value < 0.5).count();
        // Of the three coordinates the one across the face is 0 or 1.
        let low = 2 + usize::from(face % 2 == 0);
        let quarter = flux(&scene, &baked, face, |middle| is_low(middle) == low);
        assert!(
            (quarter / (2.0 * quarter_part) - 1.0).abs() <= 0.005,
            "quarter of {}: {quarter} W",
            FACES[face]
        );
    }
}

/// Reflectance at which reflected light does not count but radiosity still drives the mesh.
const NEARLY_BLACK: f64 = 1e-6;

/// The part of an isotropic light that a face gets is its solid angle over 4 pi.
#[test]
fn isotropic_light_anywhere() {
    let light = DVec3::new(0.3, 0.2, 0.45);
    let (scene, baked) = cube_around_light(light, NEARLY_BLACK, &BakeSettings::default());
    for (face, name) in FACES.iter().enumerate() {
        let axis = face / 2;
        let distance = if face % 2 == 0 { light[axis] } else { 1.0 - light[axis] };
        let (u, v) = (light[(axis + 1) % 3], light[(axis + 2) % 3]);
        // Solid angle of a rectangle over one of its corners.
        let angle =
            |a: f64, b: f64| (a * b / (distance * (a * a + b * b + distance * distance).sqrt())).atan();
        let solid_angle = angle(u, v) + angle(1.0 - u, v) + angle(u, 1.0 - v) + angle(1.0 - u, 1.0 - v);
        let expected = solid_angle / (4.0 * std::f64::consts::PI);
        let found = flux(&scene, &baked, face, |_| true);
        assert!((found / expected - 1.0).abs() <= 0.005, "{name}: {found} W, expected {expected}");
    }
}

/// The same light as two horizontal Lambertian elements back to back.
#[test]
fn planar_light_in_the_middle() {
    let [ceiling, wall] = case("D16").values()[..] else { panic!("two values") };
    let settings = BakeSettings { planar_point_lights: true, ..BakeSettings::default() };
    let (scene, baked) = cube_around_light(DVec3::splat(0.5), NEARLY_BLACK, &settings);
    for (face, expected) in [(TOP, ceiling), (BOTTOM, ceiling), (LEFT, wall)] {
        let found = flux(&scene, &baked, face, |_| true);
        assert!((found / expected - 1.0).abs() <= 0.005, "{}: {found} W, expected {expected}", FACES[face]);
    }
}
