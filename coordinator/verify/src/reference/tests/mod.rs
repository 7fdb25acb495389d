//! The tracer against exact answers. Random numbers are fixed by seeds: what passes once passes always.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

use super::*;
use crate::plain::{PlainLight, PlainLightKind, PlainMaterial, PlainTriangle};

mod layers;
mod lights;
mod rays;

fn grey(reflectance: f64, exitance: f64) -> PlainMaterial {
    PlainMaterial {
        reflectance: DVec3::splat(reflectance),
        exitance: DVec3::splat(exitance),
        double_sided: false,
        opacity: 1.0,
    }
}

fn point_light(position: DVec3, intensity: DVec3) -> PlainLight {
    PlainLight { kind: PlainLightKind::Point { position }, intensity }
}

/// Adds a parallelogram, lit where its edges turn counter-clockwise.
fn add(scene: &mut PlainScene, material: PlainMaterial, corner: DVec3, edges: [DVec3; 2]) {
    let primitive = scene.materials.len();
    scene.materials.push(material);
    let [a, b] = edges;
    let triangles = [[corner, corner + a, corner + a + b], [corner, corner + a + b, corner + b]];
    scene.triangles.extend(triangles.map(|corners| PlainTriangle { corners, primitive, vertices: [0; 3] }));
}

/// A square of this side in z = height, centred, lit from above; from below with a negative side.
fn square(scene: &mut PlainScene, material: PlainMaterial, height: f64, side: f64) {
    let edges = [DVec3::X * side, DVec3::Y * side.abs()];
    add(scene, material, DVec3::new(-side / 2.0, -side.abs() / 2.0, height), edges);
}

/// The cube from (0, 0, 0) to (1, 1, 1), lit inside.
fn room(material: PlainMaterial) -> PlainScene {
    let mut scene = PlainScene::default();
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z];
    for [a, b] in [[x, y], [y, z], [z, x]] {
        add(&mut scene, material, DVec3::ZERO, [a, b]);
        add(&mut scene, material, DVec3::ONE, [-b, -a]);
    }
    scene
}

fn floor_place(x: f64, y: f64) -> Place {
    Place { position: DVec3::new(x, y, 0.0), normal: DVec3::Z, primitive: 0 }
}

fn traced(scene: &PlainScene, places: &[Place], paths: u32) -> Vec<ReferencePoint> {
    let settings = ReferenceSettings { paths, seed: 7, threads: 2 };
    trace(scene, places, &settings, &|| ()).unwrap()
}

/// Every point within 4.5 standard errors (one of 10,000 would not be, after Student with 31 degrees of freedom), their mean
/// within 3, and the errors themselves of the right size.
fn assert_agrees(points: &[ReferencePoint], expected: impl Fn(&Place) -> f64) {
    let z: Vec<f64> = points
        .iter()
        .map(|point| (point.radiosity.x - expected(&point.place)) / point.standard_error.x)
        .collect();
    let mean = z.iter().sum::<f64>() / z.len() as f64;
    assert!(z.iter().all(|z| z.abs() < 4.5), "{z:?}");
    assert!(mean.abs() * (z.len() as f64).sqrt() < 3.0, "mean {mean} of {}", z.len());
}

#[test]
fn room_of_constant_radiosity_has_that_everywhere() {
    for (reflectance, error) in [(0.5, 0.015), (0.9, 0.03)] {
        let scene = room(grey(reflectance, 1.0));
        let points = traced(&scene, &random(&scene, 50, 3).unwrap(), 512);
        assert_agrees(&points, |_| 1.0 / (1.0 - reflectance));
        assert!(relative_standard_error(&points) < error, "{}", relative_standard_error(&points));
    }
}

/// What a light gives the walls of a closed room absorb.
#[test]
fn flux_in_a_closed_room_is_emission_over_absorption() {
    let reflectance = 0.7;
    let mut scene = room(grey(reflectance, 0.0));
    scene.lights = vec![point_light(DVec3::new(0.5, 0.4, 0.3), DVec3::ONE)];
    let points = traced(&scene, &random(&scene, 1024, 5).unwrap(), 64);
    let mean = points.iter().map(|point| point.radiosity.x).sum::<f64>() / points.len() as f64;
    // Six walls of area 1 absorb (1 - rho) / rho of their radiosity.
    let expected = 4.0 * PI * reflectance / (1.0 - reflectance) / 6.0;
    // Of radiosities that differ by a factor of 3 from place to place, the mean of 1024 stratified ones.
    assert!((mean / expected - 1.0).abs() < 0.01, "{mean} {expected}");
}

#[test]
fn back_of_one_side_is_black_and_of_two_is_as_the_front() {
    for (double_sided, expected) in [(false, 0.0), (true, 10.0)] {
        let mut scene = PlainScene::default();
        square(&mut scene, grey(0.5, 0.0), 0.0, 4.0);
        // Turned away from the floor, and so large that it fills the floor's hemisphere.
        square(&mut scene, PlainMaterial { double_sided, ..grey(0.0, 20.0) }, 0.01, 400.0);
        let points = traced(&scene, &[floor_place(0.1, 0.2)], 256);
        let radiosity = points[0].radiosity.x;
        assert!((radiosity - expected).abs() <= 0.02, "{radiosity}");
    }
}

/// A wall of two sheets back to back in one plane, a lamp in the plane of the ceiling, a box that stands on the floor.
#[test]
fn surfaces_in_one_plane_do_not_hide_each_other() {
    let mut scene = room(grey(0.5, 1.0));
    let wall = [DVec3::Y * 0.5, DVec3::Z * 0.5];
    add(&mut scene, grey(0.5, 1.0), DVec3::X * 0.5, wall);
    add(&mut scene, grey(0.5, 1.0), DVec3::X * 0.5, [wall[1], wall[0]]);
    add(&mut scene, grey(0.5, 1.0), DVec3::new(0.2, 0.2, 0.0), [DVec3::Y * 0.2, DVec3::X * 0.2]);
    let places: Vec<Place> = random(&scene, 60, 3).unwrap();
    let hidden = |place: &Place| place.normal == -DVec3::Z && place.position.z == 0.0;
    let places: Vec<Place> = places.into_iter().filter(|place| !hidden(place)).collect();
    assert_agrees(&traced(&scene, &places, 256), |_| 2.0);
}

#[test]
fn emission_of_the_place_itself_counts() {
    let mut scene = PlainScene::default();
    square(&mut scene, grey(0.5, 3.0), 0.0, 1.0);
    let points = traced(&scene, &[floor_place(0.1, 0.1)], 32);
    assert_eq!((points[0].radiosity, points[0].standard_error), (DVec3::splat(3.0), DVec3::ZERO));
}

/// Scaled and moved far away, a scene has the same light: of points lights by the square of the scale.
#[test]
fn units_and_place_of_the_scene_do_not_matter() {
    let mut scene = room(grey(0.5, 1.0));
    scene.materials[0].reflectance = DVec3::splat(0.2);
    scene.lights = vec![point_light(DVec3::splat(0.4), DVec3::ONE)];
    let places = random(&scene, 20, 1).unwrap();
    let (scale, shift) = (1024.0, DVec3::new(1e4, -1e5, 0.0));
    let moved = |position: DVec3| position * scale + shift;
    let mut far = scene.clone();
    far.triangles.iter_mut().for_each(|triangle| triangle.corners = triangle.corners.map(moved));
    far.lights[0] = point_light(moved(DVec3::splat(0.4)), DVec3::splat(scale * scale));
    let far_places: Vec<Place> = places.iter().map(|p| Place { position: moved(p.position), ..*p }).collect();
    for (near, far) in traced(&scene, &places, 64).iter().zip(traced(&far, &far_places, 64)) {
        assert!(near.radiosity.abs_diff_eq(far.radiosity, 1e-6), "{} {}", near.radiosity, far.radiosity);
    }
}

#[test]
fn threads_do_not_change_a_bit_and_the_seed_does() {
    let scene = room(grey(0.5, 1.0));
    let places = random(&scene, 40, 1).unwrap();
    let with = |threads, seed| {
        trace(&scene, &places, &ReferenceSettings { paths: 64, seed, threads }, &|| ()).unwrap()
    };
    assert_eq!(with(1, 7), with(3, 7));
    assert_ne!(with(1, 7), with(1, 8));
}

#[test]
fn points_are_uniform_over_the_sides_that_reflect() {
    let mut scene = PlainScene::default();
    square(&mut scene, grey(0.5, 0.0), 0.0, 2.0);
    square(&mut scene, grey(0.0, 1.0), 1.0, 5.0);
    square(&mut scene, PlainMaterial { double_sided: true, ..grey(0.5, 0.0) }, 2.0, 1.0);
    let places = random(&scene, 6000, 1).unwrap();
    let count = |primitive, normal: DVec3| {
        places.iter().filter(|place| place.primitive == primitive && place.normal == normal).count() as f64
    };
    // Areas 4, 1 and 1; Sobol' points miss the share by less than independent ones.
    for (found, expected) in
        [(count(0, DVec3::Z), 4e3), (count(2, DVec3::Z), 1e3), (count(2, -DVec3::Z), 1e3)]
    {
        assert!((found - expected).abs() < 20.0, "{found} of {expected}");
    }
    let quarter =
        places.iter().filter(|p| p.primitive == 0 && p.position.x > 0.0 && p.position.y < 0.0).count();
    assert!(quarter.abs_diff(1000) < 40, "{quarter}");
    assert!(matches!(random(&room(grey(0.0, 1.0)), 1, 1), Err(ReferenceError::NoReflection)));
    let dark = trace(&room(grey(0.5, 0.0)), &[], &ReferenceSettings::default(), &|| ());
    assert!(matches!(dark, Err(ReferenceError::NoLight)));
}

#[test]
fn places_are_found_on_their_primitive_only() {
    let mut scene = PlainScene::default();
    square(&mut scene, grey(0.5, 0.0), 0.0, 2.0);
    square(&mut scene, PlainMaterial { double_sided: true, ..grey(0.5, 0.0) }, 1.0, 2.0);
    let place = |x, z, normal, primitive| Place { position: DVec3::new(x, 0.3, z), normal, primitive };
    let up = DVec3::Z;
    let found = locate(
        &scene,
        &[
            place(0.1, 1e-5, up, 0),
            // Just over an edge.
            place(1.00001, 0.0, up, 0),
            place(0.1, 1.0, -up, 1),
            place(0.1, 0.0, up, 1),
            place(0.1, 0.0, -up, 0),
            place(1.1, 0.0, up, 0),
            place(0.1, 0.0, up, 2),
        ],
    );
    let expected = [
        Some(place(0.1, 0.0, up, 0)),
        Some(place(1.0, 0.0, up, 0)),
        Some(place(0.1, 1.0, -up, 1)),
        None,
        None,
        None,
        None,
    ];
    for (found, expected) in found.into_iter().zip(expected) {
        let near = |(found, expected): (Place, Place)| found.position.abs_diff_eq(expected.position, 1e-12);
        assert_eq!(
            found.map(|place| (place.normal, place.primitive)),
            expected.map(|p| (p.normal, p.primitive))
        );
        assert!(found.zip(expected).is_none_or(near), "{found:?} {expected:?}");
    }
}

#[test]
fn files_hold_what_was_traced() {
    let point = |position, radiosity| ReferencePoint {
        place: Place { position, normal: DVec3::new(0.6, -0.8, -0.0), primitive: 12 },
        radiosity,
        standard_error: DVec3::new(0.00123456789, 0.0, FRAC_PI_2 * 1e-20),
    };
    let points = [
        point(DVec3::new(1.0 / 3.0, -2e-17, 5.5), DVec3::new(0.123456789, 1234567.8, 0.0)),
        point(DVec3::new(100.0, 1.0, 0.1 + 0.2), DVec3::ONE),
    ];
    let text = to_csv(&points);
    let lines: Vec<&str> = text.lines().skip(1).collect();
    assert_eq!(lines[0], "0.33333,0,5.5,0.6,-0.8,0,12,0.123457,1234570,0,0.00123457,0,1.5708e-20");
    assert_eq!(lines[1], "100,1,0.3,0.6,-0.8,0,12,1,1,1,0.00123457,0,1.5708e-20");
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), &text).unwrap();
    let read = read(file.path()).unwrap();
    assert_eq!(to_csv(&read), text);
    assert_eq!((read.len(), read[0].place.primitive), (2, 12));
}

#[test]
fn agreement_counts_in_standard_errors() {
    let place = floor_place(0.0, 0.0);
    let point = |radiosity: f64, error: f64| ReferencePoint {
        place,
        radiosity: DVec3::splat(radiosity),
        standard_error: DVec3::splat(error),
    };
    let ours = [point(1.0, 0.3), point(2.0, 0.0), point(0.0, 0.0)];
    let theirs = [point(2.0, 0.4), point(1.8, 0.05), point(0.0, 0.0)];
    let agreement = Agreement::of(&ours, &theirs);
    let near = |value: f64, expected: f64| assert!((value - expected).abs() < 1e-12, "{value} {expected}");
    near(agreement.within_3_sigma, 2.0 / 3.0);
    near(agreement.mean_sigma, 2.0 / 3.0);
    near(agreement.rms_sigma, ((4.0 + 16.0) / 3.0f64).sqrt());
    near(agreement.energy_ratio, 3.0 / 3.8);
    near(agreement.energy_ratio_error, (0.3f64.powi(2) + 0.4f64.powi(2) + 0.05f64.powi(2)).sqrt() / 3.8);
}
