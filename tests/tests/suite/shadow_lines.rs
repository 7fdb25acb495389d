//! The shadow of a table top under a point light, in a whole bake: its edge is an edge of the mesh, sharp wherever one looks.

use bake::lit::LitMesh;
use bake::{BakeSettings, RowStrategy};
use glam::DVec3;
use scene::{ImportOptions, import};
use tests::baking::{baked, imported};
use tests::builder::{Material, SceneBuilder};
use tests::{data, shapes};

/// Where the light stands, in metres, and what it sends out in W/sr.
const LIGHT: DVec3 = DVec3::new(3.0, 2.2, 2.5);
const INTENSITY: DVec3 = DVec3::new(60.0, 55.0, 45.0);

/// Corners of the shadow on the floor: of the upper side of the table top, [2.2, 3.8] x [1.8, 3.2] at a height of 0.78.
fn shadow() -> [DVec3; 2] {
    let scale = LIGHT.y / (LIGHT.y - 0.78);
    let at = |x: f64, z: f64| DVec3::new(3.0 + (x - 3.0) * scale, 0.0, 2.5 + (z - 2.5) * scale);
    [at(2.2, 1.8), at(3.8, 3.2)]
}

/// Irradiance of a surface at a point in the frame, interpolated over the triangle under it.
fn irradiance_at(lit: &LitMesh, surface: usize, point: DVec3) -> DVec3 {
    let weights = |triangle: &bake::lit::LitTriangle| {
        let [a, b, c] = triangle.vertices.map(|vertex| lit.vertices[vertex as usize].position);
        let normal = (b - a).cross(c - a);
        let part =
            |from: DVec3, to: DVec3| (to - from).cross(point - from).dot(normal) / normal.length_squared();
        [part(b, c), part(c, a), part(a, b)]
    };
    let least = |weights: &[f64; 3]| weights.iter().copied().fold(f64::INFINITY, f64::min);
    let all = lit.surfaces[surface].iter().map(|triangle| (triangle, weights(triangle)));
    let (triangle, weights) = all.max_by(|a, b| least(&a.1).total_cmp(&least(&b.1))).unwrap();
    let light = |corner: usize| lit.vertices[triangle.vertices[corner] as usize].irradiance * weights[corner];
    (0..3).map(light).sum()
}

#[test]
fn irradiance_jumps_within_a_hair() {
    let scene = import(&data("scenes/table.glb"), &ImportOptions::default()).unwrap();
    let asked = 0.05;
    // The output mesh may move values by a part of the error asked: this is about the mesh of the bake.
    let settings = BakeSettings { simplify: false, ..BakeSettings::for_error(asked) };
    let baked = baked(&scene, &settings);
    assert!(baked.report.error.total <= asked, "{:?}", baked.report.error);
    let [low, high] = shadow();
    let corners = [low, DVec3::new(high.x, 0.0, low.z), high, DVec3::new(low.x, 0.0, high.z)];
    let centre = (low + high) / 2.0;
    for side in 0..4 {
        let (from, to) = (corners[side], corners[(side + 1) % 4]);
        let middle = (from + to) / 2.0;
        let out = (middle - centre).normalize();
        for step in 1..20 {
            let place = from.lerp(to, f64::from(step) / 20.0);
            // A millimetre to either side.
            let at =
                |distance: f64| irradiance_at(&baked.lit, 0, scene.frame.to_frame(place + out * distance));
            let jump = at(1e-3) - at(-1e-3);
            let towards = LIGHT - place;
            let direct = INTENSITY * towards.y / towards.length().powi(3);
            // Interpolated: the error asked for is about the light of the whole room.
            let error = ((jump - direct) / direct).abs().max_element();
            assert!(error <= 0.1, "at {place}: a jump of {jump}, expected {direct}");
        }
    }
}

/// Slats under a lamp cast shadows side by side: their lines are for receivers, and divide no shooters.
#[test]
fn shooters_do_not_multiply_with_the_lines() {
    let slats = (0..16).flat_map(|i| {
        let x = f64::from(i) / 16.0;
        shapes::box_facing_out(DVec3::new(x, 0.02, 0.6), DVec3::new(x + 0.03, 0.98, 0.62))
    });
    let slats = slats.collect::<Vec<_>>();
    let room = SceneBuilder::new()
        .part("room", &shapes::unit_room(), Material::grey(0.6).emitting(0.1))
        .part("slats", &slats, Material::grey(0.4));
    let settings = BakeSettings {
        rows: RowStrategy::Exact,
        mesh_error: 0.2,
        shooter_edge: 0.3,
        rays_per_hemisphere: 256,
        ..BakeSettings::default()
    };
    let report = |builder: SceneBuilder| baked(&imported(&builder.glb()), &settings).report;
    let dark = report(room.clone());
    let lit = report(room.point_light(DVec3::new(0.4, 0.5, 0.9), 1.0));
    assert!(lit.vertices > 2 * dark.shooting_vertices, "{} vertices: no lines", lit.vertices);
    let (with, without) = (lit.shooting_vertices, dark.shooting_vertices);
    assert!(4 * with <= 5 * without, "{with} shooters, {without} without the lamp");
}
