//! Bakes with the rows of receivers against those with the rows of shooters, and against exact answers.

use bake::{BakeSettings, RowStrategy};
use glam::DVec3;
use tests::baking::{baked, baked_by, imported, mean_irradiance};
use tests::builder::{Material, SceneBuilder};
use tests::shapes::{self, Polygon};

fn settings(rows: RowStrategy) -> BakeSettings {
    BakeSettings { rows, mesh_error: 0.02, ..BakeSettings::default() }
}

/// A unit room with a lamp under its ceiling and a ball on its floor.
fn room_with_ball(levels: u32) -> SceneBuilder {
    let ball: Vec<Polygon> = shapes::icosphere(levels)
        .into_iter()
        .map(|corners| corners.map(|corner| corner * 0.2 + DVec3::new(0.55, 0.25, 0.4)).to_vec())
        .collect();
    let lamp =
        vec![[(0.4, 0.4), (0.6, 0.4), (0.6, 0.6), (0.4, 0.6)].map(|(x, z)| DVec3::new(x, 0.98, z)).to_vec()];
    SceneBuilder::new()
        .part("walls", &shapes::unit_room(), Material::grey(0.6))
        .part("lamp", &lamp, Material::grey(0.0).emitting(40.0))
        .part("ball", &ball, Material::grey(0.4))
}

/// In an enclosure of constant radiosity every vertex has E / (1 - rho), however coarse the mesh, as long as rays leave nothing out.
/// A vertex may lose one ray in a seam between polygons, and hardly one does.
#[test]
fn a_furnace_is_exact_for_any_number_of_rays() {
    let (exitance, reflectance) = (2.0, 0.7);
    let walls = Material::grey(reflectance).emitting(exitance);
    let scene = imported(&SceneBuilder::new().part("walls", &shapes::unit_room(), walls).glb());
    let coarse = BakeSettings { shooter_edge: 0.2, simplify: false, ..settings(RowStrategy::Gather) };
    for rays in [16.0, 1024.0] {
        let lit = baked(&scene, &coarse.clone().with_rays(rays)).lit;
        let expected = exitance / (1.0 - reflectance);
        let errors: Vec<f64> =
            lit.vertices.iter().map(|vertex| (vertex.irradiance.x / expected - 1.0).abs()).collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let largest = errors.iter().copied().fold(0.0, f64::max);
        assert!(mean < 5e-5, "mean error {mean} with {rays} rays");
        assert!(largest < 2e-4 + reflectance / rays, "largest error {largest} with {rays} rays");
    }
}

#[test]
fn both_kinds_of_rows_light_a_room_alike() {
    let scene = imported(&room_with_ball(2).glb());
    let [by_shooters, by_receivers] = [RowStrategy::Exact, RowStrategy::Gather]
        .map(|rows| baked(&scene, &BakeSettings { mesh_error: 0.03, ..settings(rows) }));
    for (index, surface) in scene.surfaces.iter().enumerate() {
        let [one, other] = [&by_shooters, &by_receivers].map(|baked| mean_irradiance(&baked.lit, index).x);
        // The part of the lamp is too small for more: its front is black.
        let tolerance = if surface.name.contains("lamp") { 0.05 } else { 0.01 };
        assert!((one / other - 1.0).abs() < tolerance, "{}: {one} and {other}", surface.name);
    }
    let report = by_receivers.report;
    assert!(report.balance.relative_imbalance().abs() < 0.01, "{:?}", report.balance);
    assert!(report.error.total > 0.0 && report.error.total < 0.05, "{:?}", report.error);
}

/// A hall with boxes on its floor and lamps a hand's breadth below its ceiling.
fn hall() -> SceneBuilder {
    let side = 15.0;
    let lamp = |index: usize| {
        let (x, z) = (2.0 + 4.0 * (index % 4) as f64, 2.0 + 4.0 * (index / 4) as f64);
        shapes::box_facing_out(DVec3::new(x - 0.5, 2.9, z - 0.15), DVec3::new(x + 0.5, 2.95, z + 0.15))
    };
    let chair = |index: usize| {
        let (x, z) = (1.2 + 1.4 * (index % 10) as f64, 1.2 + 1.4 * (index / 10) as f64);
        let boxes = [
            ([-0.2, 0.43, -0.2], [0.2, 0.46, 0.2]),
            ([-0.2, 0.46, 0.17], [0.2, 0.9, 0.2]),
            ([-0.2, 0.0, -0.2], [-0.16, 0.43, -0.16]),
            ([0.16, 0.0, -0.2], [0.2, 0.43, -0.16]),
            ([-0.2, 0.0, 0.16], [-0.16, 0.43, 0.2]),
            ([0.16, 0.0, 0.16], [0.2, 0.43, 0.2]),
        ];
        let at = DVec3::new(x, 0.0, z);
        boxes.into_iter().flat_map(move |(low, high)| {
            shapes::box_facing_out(at + DVec3::from_array(low), at + DVec3::from_array(high))
        })
    };
    let lamps: Vec<Polygon> = (0..16).flat_map(lamp).collect();
    let chairs: Vec<Polygon> = (0..100).flat_map(chair).collect();
    SceneBuilder::new()
        .part("walls", &shapes::box_facing_in(DVec3::ZERO, DVec3::new(side, 3.0, side)), Material::grey(0.7))
        .part("lamps", &lamps, Material::grey(0.5).emitting(20.0))
        .part("chairs", &chairs, Material::grey(0.3))
}

/// Above each lamp it is twenty times as bright as elsewhere, in a place that few points fall on and that is seen from nowhere else.
#[test]
fn light_in_many_small_places_gets_points_until_it_is_known() {
    let settings = BakeSettings { rows: RowStrategy::Gather, ..BakeSettings::for_error(0.1) };
    let report = baked(&imported(&hall().glb()), &settings).report;
    assert!(report.error.total <= 0.1, "{:?}", report.error);
}

/// By the three quarters' power of the number of rays, or half at least.
#[test]
fn more_rays_make_less_noise() {
    let scene = imported(&room_with_ball(2).glb());
    // The noise is that of gather points, however the mesh is.
    let coarse = BakeSettings { mesh_error: 0.1, validation_samples: 64, ..settings(RowStrategy::Gather) };
    let noise = |rays: f64| baked(&scene, &coarse.clone().with_rays(rays)).report.error.visibility;
    let (few, many) = (noise(128.0), noise(1024.0));
    assert!(many < 0.5 * few, "{many} after {few}");
}

#[test]
fn threads_change_no_bit() {
    let scene = imported(&room_with_ball(1).glb());
    let bits = |threads: usize| -> Vec<[u64; 3]> {
        let lit = baked_by(&scene, &settings(RowStrategy::Gather).with_rays(256.0), threads).lit;
        lit.vertices.iter().map(|vertex| vertex.irradiance.to_array().map(f64::to_bits)).collect()
    };
    assert_eq!(bits(1), bits(3));
}

/// A ball of 5,120 facets asks for the rows of receivers by itself.
#[test]
fn fine_scenes_are_baked_with_the_rows_of_receivers() {
    let scene = imported(&room_with_ball(4).glb());
    let coarse = imported(&room_with_ball(1).glb());
    let rows_of = |scene| {
        let settings = BakeSettings { validation_samples: 0, ..settings(RowStrategy::Automatic) };
        baked(scene, &settings).report.row_strategy
    };
    assert_eq!(rows_of(&scene), RowStrategy::Gather);
    assert_eq!(rows_of(&coarse), RowStrategy::Exact);
}
