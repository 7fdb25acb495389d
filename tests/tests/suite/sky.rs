//! A uniform sky, in whole bakes, against view factors.

use std::f64::consts::PI;

use bake::{BakeSettings, Baked};
use glam::DVec3;
use scene::Scene;
use scene::{ImportOptions, import_slice};
use tests::baking::{baked, mean_irradiance, vertices_of};
use tests::builder::{Material, SceneBuilder};
use tests::shapes::{self, Polygon};

/// Reflectance at which reflected light does not count but radiosity still drives the mesh.
const NEARLY_BLACK: f64 = 1e-6;

/// Radiance of the sky.
const RADIANCE: DVec3 = DVec3::new(1.0, 2.0, 4.0);

fn under_sky(builder: &SceneBuilder, settings: &BakeSettings) -> (Scene, Baked) {
    let options = ImportOptions { sky: RADIANCE, ..ImportOptions::default() };
    let scene = import_slice(&builder.glb(), &options).unwrap_or_else(|error| panic!("{error}"));
    let baked = baked(&scene, settings);
    (scene, baked)
}

/// A horizontal square about a place, lit from above.
fn plate(middle: DVec3, half: f64) -> Polygon {
    let corner = |x: f64, z: f64| middle + DVec3::new(x * half, 0.0, z * half);
    vec![corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)]
}

/// Form factor from a point to a wall that stands on the ground at this distance, this high, and so long to either side.
fn to_wall(distance: f64, height: f64, half: f64) -> f64 {
    let slant = distance.hypot(height);
    ((half / distance).atan() - distance / slant * (half / slant).atan()) / PI
}

/// pi L, whichever way a plate looks; what it reflects leaves the scene again.
#[test]
fn free_plates_get_pi_times_the_radiance() {
    let up = plate(DVec3::ZERO, 1.0);
    let down = up.iter().rev().copied().collect();
    let tilted = vec![DVec3::ZERO, DVec3::new(1.0, 0.5, 0.2), DVec3::new(0.0, 2.0, 1.0)];
    for plate in [up, down, tilted] {
        let builder = SceneBuilder::new().part("plate", &[plate], Material::grey(0.2));
        let (_, baked) = under_sky(&builder, &BakeSettings::default());
        for vertex in vertices_of(&baked.lit, 0) {
            let error = (vertex.irradiance / (PI * RADIANCE) - 1.0).abs().max_element();
            assert!(error <= 1e-4, "off by {error:e}");
        }
    }
    let alone = SceneBuilder::new().part("plate", &[plate(DVec3::ZERO, 1.0)], Material::grey(0.5));
    let (_, baked) = under_sky(&alone, &BakeSettings::default());
    let balance = &baked.report.balance;
    let expected = 4.0 * PI * RADIANCE;
    assert!((balance.emitted[2] / expected.z - 1.0).abs() <= 1e-4, "{balance:?}");
    assert!((balance.escaped[2] / balance.emitted[2] - 0.5).abs() <= 1e-4, "{balance:?}");
    assert!(balance.relative_imbalance().abs() <= 1e-6, "{balance:?}");
    assert!(baked.report.warnings.is_empty(), "{:?}", baked.report.warnings);
}

/// Beside a long wall the ground sees what the wall leaves of the sky.
#[test]
fn ground_beside_a_wall() {
    let (height, half) = (3.0, 500.0);
    let wall = vec![
        DVec3::new(0.0, 0.0, half),
        DVec3::new(0.0, 0.0, -half),
        DVec3::new(0.0, height, -half),
        DVec3::new(0.0, height, half),
    ];
    for distance in [0.5, 2.0, 10.0] {
        let builder = SceneBuilder::new()
            .part("ground", &[plate(DVec3::new(distance, 0.0, 0.0), 0.05)], Material::grey(NEARLY_BLACK))
            .part("wall", std::slice::from_ref(&wall), Material::grey(0.0).double_sided());
        let (_, baked) = under_sky(&builder, &BakeSettings::default());
        let found = mean_irradiance(&baked.lit, 0);
        // Over the little plate the factor is next to linear: its mean is that of the middle.
        let expected = PI * RADIANCE * (1.0 - to_wall(distance, height, half));
        let error = (found / expected - 1.0).abs().max_element();
        assert!(error <= 2e-4, "{distance}: {found}, not {expected}, off by {error:e}");
    }
}

/// A closed room is dark, and a courtyard sees what its walls leave open.
#[test]
fn courtyard_and_closed_room() {
    let yard: Vec<Polygon> =
        shapes::unit_room().into_iter().filter(|wall| wall.iter().any(|corner| corner.y != 1.0)).collect();
    let walls: Vec<Polygon> =
        yard.iter().filter(|wall| wall.iter().any(|corner| corner.y != 0.0)).cloned().collect();
    let builder = SceneBuilder::new()
        .part("floor", &[plate(DVec3::new(0.5, 0.0, 0.5), 0.005)], Material::grey(NEARLY_BLACK))
        .part("walls", &walls, Material::grey(0.0));
    let (_, baked) = under_sky(&builder, &BakeSettings::default());
    let expected = PI * RADIANCE * (1.0 - 4.0 * to_wall(0.5, 1.0, 0.5));
    let found = mean_irradiance(&baked.lit, 0);
    let error = (found / expected - 1.0).abs().max_element();
    assert!(error <= 2e-4, "{found}, not {expected}, off by {error:e}");

    let room = SceneBuilder::new().part("walls", &shapes::unit_room(), Material::grey(0.5));
    let (_, baked) = under_sky(&room, &BakeSettings::default());
    assert!(
        baked.lit.vertices.iter().all(|vertex| vertex.irradiance == DVec3::ZERO),
        "light comes through walls"
    );
    assert!(baked.report.warnings.is_empty(), "{:?}", baked.report.warnings);
}
