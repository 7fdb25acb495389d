//! Lamps, suns and the sky, against what is known of them.

use std::f64::consts::TAU;

use super::*;

/// Without anything to bounce light, a point light leaves nothing to chance.
#[test]
fn floor_under_a_point_light_is_exact() {
    let mut scene = PlainScene::default();
    square(&mut scene, grey(0.6, 0.0), 0.0, 4.0);
    let intensity = DVec3::new(3.0, 2.0, 1.0);
    let position = DVec3::new(0.5, 0.0, 2.0);
    scene.lights = vec![point_light(position, intensity)];
    for point in traced(&scene, &[floor_place(0.0, 0.0), floor_place(-1.5, 0.7)], 32) {
        let span = position - point.place.position;
        let expected = 0.6 * intensity * span.z / span.length().powi(3);
        // Rays start a millionth of the scene's extent off the surface.
        assert!(point.radiosity.abs_diff_eq(expected, 1e-5 * expected.x), "{} {expected}", point.radiosity);
        assert!(point.standard_error.max_element() < 1e-12);
    }
}

#[test]
fn point_lights_add_up() {
    let mut scene = PlainScene::default();
    square(&mut scene, grey(0.6, 0.0), 0.0, 4.0);
    let lights = [(0.5, 1.0), (-0.5, 2.7), (0.0, 0.0)];
    let position = |x| DVec3::new(x, 0.0, 2.0);
    scene.lights = lights.map(|(x, intensity)| point_light(position(x), DVec3::splat(intensity))).to_vec();
    let points = traced(&scene, &[floor_place(0.3, 0.1), floor_place(1.0, 1.0), floor_place(-1.0, 0.5)], 512);
    assert_agrees(&points, |place| {
        let from = |(x, intensity): (f64, f64)| {
            let span = position(x) - place.position;
            0.6 * intensity * span.z / span.length().powi(3)
        };
        lights.into_iter().map(from).sum()
    });
}

/// A spot light and two directional ones: without anything to bounce light, they leave nothing to chance.
#[test]
fn spot_and_directional_lights_add_up() {
    let mut scene = PlainScene::default();
    square(&mut scene, grey(0.6, 0.0), 0.0, 4.0);
    let (position, axis) = (DVec3::new(0.5, 0.2, 2.0), DVec3::new(0.1, -0.2, -1.0).normalize());
    let (inner, outer) = (0.95, 0.8);
    let ramp = [1.0 / (inner - outer), -outer / (inner - outer)];
    let directional = |along: DVec3, lux| PlainLight {
        kind: PlainLightKind::Directional { along: along.normalize() },
        intensity: DVec3::splat(lux),
    };
    scene.lights = vec![
        PlainLight {
            kind: PlainLightKind::Spot { position, along: axis, ramp },
            intensity: DVec3::splat(5.0),
        },
        directional(DVec3::new(1.0, 0.0, -1.0), 0.5),
        directional(DVec3::new(0.0, 0.0, 1.0), 0.5),
    ];
    let places = [(0.5, 0.0), (-0.4, 0.3), (0.9, -1.2), (-1.9, 1.9)].map(|(x, y)| floor_place(x, y));
    let expected = |place: &Place| {
        let span = place.position - position;
        let distance = span.length();
        let part = ((span.dot(axis) / distance - outer) / (inner - outer)).clamp(0.0, 1.0);
        let spot = 5.0 * part * part * -span.z / distance.powi(3);
        0.6 * (spot + 0.5 * 0.5_f64.sqrt())
    };
    // Inside, on the ramp, and outside.
    assert_eq!(expected(&places[3]), 0.3 * 0.5_f64.sqrt());
    for point in traced(&scene, &places, 32) {
        let expected = expected(&point.place);
        // Rays start a millionth of the scene's extent off the surface.
        let error = (point.radiosity.x - expected).abs();
        assert!(error <= 1e-4 * expected, "{}: {}, not {expected}", point.place.position, point.radiosity);
    }
}

/// On the axis of a disk and under the corner of a rectangle the irradiance has a closed form; a light from below gives nothing.
#[test]
fn area_lights_add_up() {
    let mut scene = PlainScene::default();
    square(&mut scene, grey(0.6, 0.0), 0.0, 4.0);
    let light = |centre, half, is_round, radiance| PlainLight {
        kind: PlainLightKind::Area { centre, half, is_round },
        intensity: DVec3::splat(radiance),
    };
    let (up, half) = (DVec3::Z * 0.5, [DVec3::X * -0.4, DVec3::Y * 0.4]);
    scene.lights = vec![
        light(up, half, true, 2.0),
        light(up + DVec3::new(0.5, 0.5, 0.5), [DVec3::X * -0.5, DVec3::Y * 0.5], false, 3.0),
        light(up, [half[1], half[0]], true, 7.0),
    ];
    let round = 2.0 * PI * 0.16 / (0.16 + 0.25);
    let cornered = 3.0 / 2.0_f64.sqrt() * 0.5_f64.sqrt().atan();
    assert_agrees(&traced(&scene, &[floor_place(0.0, 0.0)], 4096), |_| 0.6 * (round + cornered));
}

/// Beside a sheet that lets 40 % pass, and with a mask of holes.
#[test]
fn sky_and_sun_pass_what_is_not_opaque() {
    let sky = 2.0;
    for (opacity, reflectance) in [(1.0, 0.0), (0.6, 0.0), (0.0, 0.5)] {
        let mut scene = PlainScene { sky: DVec3::splat(sky), ..PlainScene::default() };
        square(&mut scene, grey(0.5, 0.0), 0.0, 0.1);
        // Nearly all of the hemisphere.
        square(&mut scene, PlainMaterial { opacity, ..grey(reflectance, 0.0) }, 0.01, -40.0);
        let along = DVec3::new(0.6, 0.0, -0.8);
        let intensity = DVec3::splat(10.0);
        scene.lights = vec![PlainLight { kind: PlainLightKind::Directional { along }, intensity }];
        let points = traced(&scene, &[floor_place(0.01, 0.02)], 4096);
        let expected = 0.5 * (1.0 - opacity) * (PI * sky + 8.0);
        let (radiosity, error) = (points[0].radiosity.x, points[0].standard_error.x);
        // Something of the sky is seen past the sheet's edge.
        let within = 4.5 * error + 1e-5;
        assert!((radiosity - expected).abs() <= within, "{opacity}: {radiosity}, not {expected}");
        // Of draws of 0 or pi L, one half reflected.
        assert!(error < 0.05, "{opacity}: {error}");
    }
}

#[test]
fn free_plate_under_the_sky_is_exact() {
    let mut scene = PlainScene { sky: DVec3::new(1.0, 2.0, 3.0), ..PlainScene::default() };
    square(&mut scene, grey(0.5, 0.0), 0.0, 4.0);
    for point in traced(&scene, &[floor_place(0.3, 0.1)], 32) {
        assert!(point.radiosity.abs_diff_eq(0.5 * PI * scene.sky, 1e-12), "{}", point.radiosity);
    }
}

/// Form factor of a point to a rectangle above it, from the corner over the point to (a, b), at distance 1.
fn corner_factor(a: f64, b: f64) -> f64 {
    let (ra, rb) = (a.hypot(1.0), b.hypot(1.0));
    (a / ra * (b / ra).atan() + b / rb * (a / rb).atan()) / TAU
}

/// From far away to nearly touching: neither way of sampling alone would do for all.
#[test]
fn floor_under_a_lamp_has_the_form_factor_times_exitance() {
    for height in [4.0, 1.0, 0.1, 0.002] {
        let mut scene = PlainScene::default();
        square(&mut scene, grey(0.5, 0.0), 0.0, 4.0);
        square(&mut scene, grey(0.0, 10.0), height, -2.0);
        let places: Vec<Place> = (0..8).map(|i| floor_place(f64::from(i) * 0.12, 0.05)).collect();
        let points = traced(&scene, &places, 512);
        assert_agrees(&points, |place| {
            let part = |x: f64, y: f64| corner_factor(x / height, y / height);
            let (x, y) = (place.position.x, place.position.y);
            5.0 * (part(1.0 - x, 1.0 - y)
                + part(1.0 + x, 1.0 - y)
                + part(1.0 - x, 1.0 + y)
                + part(1.0 + x, 1.0 + y))
        });
        assert!(relative_standard_error(&points) < 0.02, "{height}: {}", relative_standard_error(&points));
    }
}
