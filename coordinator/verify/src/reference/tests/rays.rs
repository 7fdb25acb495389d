//! Radiance along rays.

use super::*;

fn radiance(scene: &PlainScene, rays: &[Ray], paths: u32) -> Vec<DVec3> {
    let settings = ReferenceSettings { paths, seed: 7, threads: 2 };
    trace_rays(scene, rays, DVec3::splat(9.0), &settings, &|| ()).unwrap()
}

fn ray(origin: DVec3, towards: DVec3) -> Ray {
    Ray { origin, direction: (towards - origin).normalize() }
}

/// From within, and through the backs of its walls from without.
#[test]
fn a_room_of_constant_radiosity_shows_that_over_pi() {
    let scene = room(grey(0.5, 1.0));
    let middle = DVec3::splat(0.5);
    let eyes = [middle, DVec3::new(0.3, 0.2, 0.9), DVec3::new(4.0, 0.6, 0.7), DVec3::new(-2e4, -3e4, 5e4)];
    let rays: Vec<Ray> = eyes.iter().map(|&eye| ray(eye, DVec3::new(0.45, 0.55, 0.05))).collect();
    for seen in radiance(&scene, &rays, 1 << 14) {
        assert!((seen.x / (2.0 / PI) - 1.0).abs() < 0.01, "{seen}");
    }
}

/// A half-transparent lamp before a black wall, and nothing at all beside it.
#[test]
fn a_half_transparent_lamp_shows_half_and_nothing_shows_the_background() {
    let mut scene = PlainScene::default();
    square(&mut scene, PlainMaterial { opacity: 0.5, ..grey(0.0, PI) }, 1.0, 1.0);
    square(&mut scene, grey(0.0, 0.0), 0.0, 1.0);
    let down = |x: f64| Ray { origin: DVec3::new(x, 0.1, 5.0), direction: -DVec3::Z };
    let seen = radiance(&scene, &[down(0.2), down(3.0)], 1 << 14);
    assert!((seen[0].x - 0.5).abs() < 0.02, "{}", seen[0]);
    assert_eq!(seen[1], DVec3::splat(9.0));
}

#[test]
fn a_ray_sees_what_the_point_that_it_meets_has() {
    let mut scene = room(grey(0.6, 0.0));
    scene.lights = vec![point_light(DVec3::new(0.5, 0.4, 0.3), DVec3::new(1.0, 2.0, 3.0))];
    let place = floor_place(0.2, 0.7);
    let point = &traced(&scene, &[place], 1 << 15)[0];
    let seen = radiance(&scene, &[ray(DVec3::new(0.8, 0.1, 0.9), place.position)], 1 << 15)[0];
    assert!((seen * PI / point.radiosity - 1.0).abs().max_element() < 0.01, "{seen} {point:?}");
}
