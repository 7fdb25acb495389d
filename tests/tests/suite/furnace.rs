//! The furnace: an enclosure in which every surface emits E = 1 and reflects rho has the irradiance E / (1 - rho) at every
//! point, whatever its shape (cases D01 to D04).

use coordinator::bake::BakeSettings;
use glam::DVec3;
use tests::baking::{baked, imported, vertices_of};
use tests::builder::{Material, SceneBuilder};
use tests::shapes::{self, Polygon};

/// Largest deviation from E / (1 - rho) over all vertices, relative to it.
fn worst_deviation(parts: &[(&str, Vec<Polygon>)], reflectance: f64) -> f64 {
    let material = Material::grey(reflectance).emitting(1.0);
    let builder = parts
        .iter()
        .fold(SceneBuilder::new(), |builder, (name, polygons)| builder.part(name, polygons, material));
    let scene = imported(&builder.glb());
    let lit = baked(&scene, &BakeSettings::default()).lit;
    let vertices: Vec<_> = (0..scene.surfaces.len()).flat_map(|surface| vertices_of(&lit, surface)).collect();
    assert!(vertices.len() >= 4);
    let expected = 1.0 / (1.0 - reflectance);
    let deviation = |irradiance: DVec3| (irradiance / expected - 1.0).abs();
    vertices.iter().map(|vertex| deviation(vertex.irradiance).max_element()).fold(0.0, |worst, one| {
        assert!(one.is_finite(), "rho {reflectance}: an irradiance is not finite");
        worst.max(one)
    })
}

fn assert_furnace(parts: &[(&str, Vec<Polygon>)], reflectance: f64, tolerance: f64) {
    let worst = worst_deviation(parts, reflectance);
    assert!(worst <= tolerance, "rho {reflectance}: off by {:.3} %", worst * 100.0);
}

/// Rows are stored in f32: row sums are good to 3e-8, which 1 / (1 - rho) enlarges. All of these enclosures are within 2e-5.
const TOLERANCE: f64 = 1e-4;

#[test]
fn cube() {
    for reflectance in [0.5, 0.9, 0.99, 0.999] {
        assert_furnace(&[("cube", shapes::unit_room())], reflectance, TOLERANCE);
    }
}

#[test]
fn tetrahedron() {
    for reflectance in [0.5, 0.9, 0.99, 0.999] {
        assert_furnace(&[("tetrahedron", shapes::tetrahedron_facing_in())], reflectance, TOLERANCE);
    }
}

/// Its floor is concave: it must be cut in convex parts before its centre of gravity can be used.
#[test]
fn prism_over_an_l() {
    for reflectance in [0.5, 0.9, 0.99, 0.999] {
        assert_furnace(
            &[("prism", shapes::prism_facing_in(&shapes::l_shape(), 1.0))],
            reflectance,
            TOLERANCE,
        );
    }
}

/// Floor and ceiling nearly touch: form factors between them are close to 1 and concentrated.
#[test]
fn thin_slab() {
    let slab = shapes::box_facing_in(DVec3::ZERO, DVec3::new(1.0, 1.0, 2.0_f64.powi(-10)));
    for reflectance in [0.5, 0.9, 0.99, 0.999] {
        assert_furnace(&[("slab", slab.clone())], reflectance, TOLERANCE);
    }
}

/// With something between the walls, visibility must lose no light either.
#[test]
fn cube_around_a_floating_cube() {
    let inner = shapes::box_facing_out(DVec3::splat(0.25), DVec3::splat(0.75));
    for reflectance in [0.5, 0.9, 0.99, 0.999] {
        let parts = [("outer", shapes::unit_room()), ("inner", inner.clone())];
        assert_furnace(&parts, reflectance, TOLERANCE);
    }
}
