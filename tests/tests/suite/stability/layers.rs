//! Surfaces on one another, in one plane or next to it: they must not make light.

use bake::{BakeSettings, RowStrategy};
use glam::DVec3;
use proptest::prelude::*;
use scene::Scene;
use tests::baking::{baked, imported};
use tests::builder::{Material, SceneBuilder};
use tests::shapes::{Polygon, box_facing_in, box_facing_out};

/// Most imbalance, relative to the emitted flux.
const IMBALANCE: f64 = 0.01;

fn exact() -> BakeSettings {
    BakeSettings { rows: RowStrategy::Exact, ..BakeSettings::for_error(0.03) }
}

/// Coarse: a mesh that a test can afford.
fn gathered() -> BakeSettings {
    BakeSettings {
        rows: RowStrategy::Gather,
        shooter_edge: 0.2,
        mesh_error: 0.05,
        rays_per_hemisphere: 1024,
        validation_samples: 0,
        ..BakeSettings::default()
    }
}

/// A room with a lamp under its ceiling.
fn room() -> SceneBuilder {
    let lamp = box_facing_out(DVec3::new(1.3, 1.3, 2.6), DVec3::new(1.7, 1.7, 2.8));
    SceneBuilder::new()
        .part("room", &box_facing_in(DVec3::ZERO, DVec3::splat(3.0)), Material::grey(0.5))
        .part("lamp", &lamp, Material::grey(0.2).emitting(16.0))
}

fn sheet(x: f64, y: f64, z: f64, width: f64, depth: f64) -> Polygon {
    [[0.0, 0.0], [width, 0.0], [width, depth], [0.0, depth]]
        .map(|[u, v]| DVec3::new(x + u, y + v, z))
        .to_vec()
}

/// A stack of white sheets, each aside of the one before and above it by this.
fn stack(count: usize, aside: f64, above: f64) -> SceneBuilder {
    (0..count).fold(room(), |builder, index| {
        let n = index as f64;
        let sheet = sheet(0.5 + aside * n, 0.5, 1.0 + above * n, 2.0, 2.0);
        builder.part(&format!("sheet {index}"), &[sheet], Material::grey(0.8))
    })
}

fn assert_balanced(scene: &Scene, settings: &BakeSettings, most: f64) {
    let result = baked(scene, settings);
    let balance = result.report.balance;
    assert!(balance.relative_imbalance().abs() <= most, "{balance:?}");
    assert!(result.lit.vertices.iter().all(|vertex| vertex.irradiance.is_finite()));
}

#[test]
fn stacks_make_no_light() {
    for count in [2, 8] {
        for aside in [0.01, 1e-7, 0.0] {
            let scene = imported(&stack(count, aside, 0.0).glb());
            assert_balanced(&scene, &exact(), IMBALANCE);
            let told = |index: usize| {
                let name = format!("\"sheet {index}\"");
                scene.warnings.iter().any(|warning| warning.contains(&name))
            };
            assert!((1..count).all(told), "{:?}", scene.warnings);
        }
    }
}

/// A millionth of the room apart, and a ten-thousandth: no longer one plane.
#[test]
fn stacks_with_gaps_make_no_light() {
    for above in [3e-6, 1e-5, 1e-4] {
        assert_balanced(&imported(&stack(4, 0.0, above).glb()), &exact(), IMBALANCE);
    }
}

#[test]
fn stacks_make_no_light_with_hemisphere_rows() {
    for (aside, above) in [(0.01, 0.0), (0.0, 1e-5)] {
        // Rays are noisy.
        assert_balanced(&imported(&stack(6, aside, above).glb()), &gathered(), 2.0 * IMBALANCE);
    }
}

#[test]
fn nested_shells_and_slivers_make_no_light() {
    let shells = (0..3).fold(room(), |builder, index| {
        let wider = 1e-4 * f64::from(index);
        let shell = box_facing_out(DVec3::splat(1.0 - wider), DVec3::splat(2.0 + wider));
        builder.part(&format!("shell {index}"), &shell, Material::grey(0.9).double_sided())
    });
    let sliver = |k: i32| {
        let y = 0.5 + 1e-3 * f64::from(k);
        [[0.5, y], [2.5, y + 1e-6 * f64::from(k)], [2.5, y + 4e-4]]
            .map(|[x, y]| DVec3::new(x, y, 1.0))
            .to_vec()
    };
    let slivers: Vec<Polygon> = (0..40).map(sliver).collect();
    let slivers = room().part("slivers", &slivers, Material::grey(0.9).double_sided());
    for builder in [shells, slivers] {
        // A coarse mesh loses up to 1.7 % of the light between its vertices here.
        assert_balanced(&imported(&builder.glb()), &exact(), 2.0 * IMBALANCE);
    }
}

/// Sheets of any size, colour and sides in three planes.
fn sheets() -> impl Strategy<Value = SceneBuilder> {
    let sheet = (
        (0.1..1.8, 0.1..1.8, prop::sample::select(vec![0.5, 1.0, 1.5])),
        (0.05..1.0, 0.05..1.0),
        (0.1..0.95, any::<bool>(), any::<bool>(), any::<bool>()),
    );
    prop::collection::vec(sheet, 2..12).prop_map(|sheets| {
        sheets.into_iter().enumerate().fold(room(), |builder, (index, sheet)| {
            let ((x, y, z), (width, depth), (reflectance, is_turned, is_cut, double_sided)) = sheet;
            let mut polygon = self::sheet(x, y, z, width, depth);
            if is_turned {
                polygon.reverse();
            }
            polygon.truncate(if is_cut { 3 } else { 4 });
            let material = Material { double_sided, ..Material::grey(reflectance) };
            builder.part(&format!("sheet {index}"), &[polygon], material)
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_layers_make_no_light(builder in sheets()) {
        assert_balanced(&imported(&builder.glb()), &exact(), IMBALANCE);
    }
}
