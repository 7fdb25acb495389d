//! The furnace: an enclosure in which every surface emits E = 1 and reflects rho has the radiosity B = E / (1 - rho) at every
//! point, whatever its shape. So is its irradiance, since B = E + rho H.

use bake::BakeSettings;
use glam::DVec3;
use tests::baking::{baked, imported, vertices_of};
use tests::builder::{Material, SceneBuilder};
use tests::cases::case;
use tests::shapes::{self, Polygon};

/// Largest deviation from the expected irradiance over all vertices, relative to it.
fn worst_deviation(
    parts: &[(&str, Vec<Polygon>)],
    reflectance: f64,
    expected: f64,
    settings: &BakeSettings,
) -> f64 {
    let material = Material::grey(reflectance).emitting(1.0);
    let builder = parts
        .iter()
        .fold(SceneBuilder::new(), |builder, (name, polygons)| builder.part(name, polygons, material));
    let scene = imported(&builder.glb());
    let lit = baked(&scene, settings).lit;
    let vertices: Vec<_> = (0..scene.surfaces.len()).flat_map(|surface| vertices_of(&lit, surface)).collect();
    assert!(vertices.len() >= 4);
    let deviation = |irradiance: DVec3| (irradiance / expected - 1.0).abs();
    vertices.iter().map(|vertex| deviation(vertex.irradiance).max_element()).fold(0.0, |worst, one| {
        assert!(one.is_finite(), "rho {reflectance}: an irradiance is not finite");
        worst.max(one)
    })
}

/// Case and reflectance.
const FURNACES: [(&str, f64); 4] = [("D01", 0.5), ("D02", 0.9), ("D03", 0.99), ("D04", 0.999)];

/// 0.5 % is asked for. With all digits of f32 row sums are good to 3e-8, which 1 / (1 - rho) enlarges. All of these enclosures are
/// within 2e-5.
const TOLERANCE: f64 = 1e-4;

/// The same with factors rounded as they usually are: by less where much light is reflected, so that it adds up to no more than a
/// part of what is asked for.
const ROUNDED_TOLERANCE: f64 = 1e-3;

/// Heats these parts in every furnace.
fn assert_furnaces(parts: &[(&str, Vec<Polygon>)]) {
    for (id, reflectance) in FURNACES {
        let usual = BakeSettings::default();
        let exact = BakeSettings { factor_rounding: 0.0, ..usual.clone() };
        for (settings, tolerance) in [(exact, TOLERANCE), (usual, ROUNDED_TOLERANCE)] {
            let worst = worst_deviation(parts, reflectance, case(id).values()[0], &settings);
            let rounding = settings.factor_rounding;
            assert!(worst <= tolerance, "{id}, rounded by {rounding:e}: off by {:.3} %", worst * 100.0);
        }
    }
}

#[test]
fn cube() {
    assert_furnaces(&[("cube", shapes::unit_room())]);
}

#[test]
fn tetrahedron() {
    assert_furnaces(&[("tetrahedron", shapes::tetrahedron_facing_in())]);
}

/// Its floor is concave: it must be cut in convex parts before its centre of gravity can be used.
#[test]
fn prism_over_an_l() {
    assert_furnaces(&[("prism", shapes::prism_facing_in(&shapes::l_shape(), 1.0))]);
}

/// Floor and ceiling nearly touch: form factors between them are close to 1 and concentrated.
#[test]
fn thin_slab() {
    let slab = shapes::box_facing_in(DVec3::ZERO, DVec3::new(1.0, 1.0, 2.0_f64.powi(-10)));
    assert_furnaces(&[("slab", slab)]);
}

/// With something between the walls, visibility must lose no light either.
#[test]
fn cube_around_a_floating_cube() {
    let inner = shapes::box_facing_out(DVec3::splat(0.25), DVec3::splat(0.75));
    assert_furnaces(&[("outer", shapes::unit_room()), ("inner", inner)]);
}
