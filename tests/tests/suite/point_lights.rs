//! Point lights in the middle of the unit cube, as a worker computes their rows, against the parts of their flux that the
//! faces get. `enclosures` has them in whole bakes.

use std::f64::consts::PI;

use glam::DVec3;
use kernel::row::{Precision, Shape, Shooter};
use kernel::visibility::ReceiverGroups;
use tests::cases::case;
use worker::engine::{Scene, compute_row};

use crate::occlusion::receivers_on;

const LIGHT: DVec3 = DVec3::splat(0.5);

/// The part of its flux that a light sends to a square, by midpoints. Their error goes with the square of the cells' size and
/// is taken out; what is left is that of the fourth power, 1e-8 here, and rounding of rows to f32.
fn part_on(square: &[DVec3], shape: Shape) -> f64 {
    let sampling = Precision {
        rays_per_hemisphere: 0,
        minimum_rays: 0,
        maximum_rays: 0,
        seed: 0,
        factor_rounding: 0.0,
        ..Precision::DEFAULT
    };
    let shooter = Shooter { key: 0, shape };
    let area = (square[1] - square[0]).cross(square[3] - square[0]).length();
    let [coarse, fine] = [64, 128].map(|cells| {
        let receivers = receivers_on(square, cells);
        let (row, _) =
            compute_row(&Scene::new(&[]), &ReceiverGroups::new(receivers.clone()), 0, &shooter, &sampling);
        let mean = row.iter().map(|factor| f64::from(*factor)).sum::<f64>() / row.len() as f64;
        // The intensity of a light of 1 W is 1 / (4 pi).
        mean * area / (4.0 * PI)
    });
    fine + (fine - coarse) / 3.0
}

fn square(origin: DVec3, u: DVec3, v: DVec3) -> Vec<DVec3> {
    vec![origin, origin + u, origin + u + v, origin + v]
}

fn assert_part(what: &str, found: f64, expected: f64) {
    let error = found / expected - 1.0;
    assert!(error.abs() <= f64::from(f32::EPSILON), "{what}: {found}, expected {expected}, off by {error:e}");
}

#[test]
fn isotropic() {
    let [face, quarter] = case("D15").values()[..] else { panic!("two values") };
    let (x, z) = (DVec3::X, DVec3::Z);
    let floor = |size: f64| square(DVec3::ZERO, z * size, x * size);
    assert_part("face", part_on(&floor(1.0), Shape::Point(LIGHT)), face);
    assert_part("quarter", part_on(&floor(0.5), Shape::Point(LIGHT)), quarter);
}

/// The case has its plane across z; the planes of the program are horizontal, across y.
#[test]
fn as_two_horizontal_elements() {
    let [ceiling, wall] = case("D16").values()[..] else { panic!("two values") };
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let light = || Shape::PlanarPoint(LIGHT);
    assert_part("ceiling", part_on(&square(y, x, z), light()), ceiling);
    assert_part("floor", part_on(&square(DVec3::ZERO, z, x), light()), ceiling);
    assert_part("wall", part_on(&square(DVec3::ZERO, y, z), light()), wall);
}
