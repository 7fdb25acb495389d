//! One scene, told in several ways: the light must be the same.

use glam::{DMat4, DVec3};
use tests::builder::{Material, SceneBuilder};
use tests::shapes::{self, Polygon, box_facing_in, box_facing_out};

use super::checked::{CLOSED, Checked, assert_same_bits, assert_same_means, checked, coarse};

/// Difference between the means of two meshes of one surface: the mesh error of these bakes is 2 %, of which a mean over many
/// patches shows less than half.
const MESH_ERROR: f64 = 0.01;

/// Difference between means where the mesh is the same and only coordinates are rounded otherwise: far below the thousandth that is
/// asked of scenes a million times their size away.
const ROUNDING: f64 = 1e-6;

/// Where the room ends; no two sides are alike.
const HIGH: DVec3 = DVec3::new(2.0, 1.25, 1.5);

/// The lamp under the ceiling, which it does not touch.
fn lamp() -> Vec<Polygon> {
    box_facing_out(DVec3::new(0.5, 0.25, 1.25), DVec3::new(1.0, 0.75, 1.375))
}

/// A pillar on the floor, not along the walls.
fn pillar() -> Vec<Polygon> {
    let floor: Vec<DVec3> =
        [[0.8, 0.6], [1.4, 0.5], [1.5, 0.9], [0.9, 1.0]].map(|[x, y]| DVec3::new(x, y, 0.0)).to_vec();
    shapes::turned(&shapes::prism_facing_in(&floor, 0.75))
}

/// A room of coloured walls, each a part of its own, with a pillar and a lamp.
fn room() -> SceneBuilder {
    let names = ["left", "right", "front", "back", "floor", "ceiling"];
    let walls = box_facing_in(DVec3::ZERO, HIGH).into_iter().zip(names).enumerate();
    let colour = |index: usize| {
        let reflectance = DVec3::new(0.2, 0.5, 0.8).map(|part| part * (0.6 + 0.07 * index as f64));
        Material { reflectance, ..Material::grey(0.0) }
    };
    let builder = walls.fold(SceneBuilder::new(), |builder, (index, (wall, name))| {
        builder.part(name, &[wall], colour(index))
    });
    builder.part("pillar", &pillar(), Material::grey(0.6)).part(
        "lamp",
        &lamp(),
        Material::grey(0.3).emitting(8.0),
    )
}

fn bake(builder: &SceneBuilder) -> Checked {
    checked(builder, &coarse(), CLOSED)
}

/// The frame divides by a power of two: scenes of which one is the other times such a number have the same bits, whether the node
/// is scaled or the mesh, and a point light's intensity goes with the square.
#[test]
fn scaling_by_powers_of_two() {
    let lit = |scale: f64| {
        let intensity = 3.0 * scale * scale;
        room()
            .point_light(DVec3::new(1.5, 0.3, 1.0), intensity)
            .all_placed(DMat4::from_scale(DVec3::splat(scale)))
    };
    let plain = bake(&lit(1.0));
    for exponent in [-13, 1, 20] {
        assert_same_bits(&plain, &bake(&lit(2.0_f64.powi(exponent))), 1.0);
    }
    let meshed = |polygons: fn(Vec<Polygon>) -> Vec<Polygon>| {
        let walls = polygons(box_facing_in(DVec3::ZERO, HIGH));
        SceneBuilder::new().part("room", &walls, Material::grey(0.5)).part(
            "lamp",
            &polygons(lamp()),
            Material::grey(0.3).emitting(8.0),
        )
    };
    assert_same_bits(&bake(&meshed(|polygons| polygons)), &bake(&meshed(sixteenfold)), 1.0);
}

fn sixteenfold(polygons: Vec<Polygon>) -> Vec<Polygon> {
    polygons.into_iter().map(|polygon| polygon.into_iter().map(|corner| corner * 16.0).collect()).collect()
}

/// Emission times a power of two is irradiance times that.
#[test]
fn brightness_by_powers_of_two() {
    let lit = |factor: f64| {
        SceneBuilder::new().part("room", &box_facing_in(DVec3::ZERO, HIGH), Material::grey(0.5)).part(
            "lamp",
            &lamp(),
            Material::grey(0.3).emitting(factor),
        )
    };
    let plain = bake(&lit(1.0));
    for factor in [2.0_f64.powi(-40), 2.0_f64.powi(40)] {
        assert_same_bits(&bake(&lit(factor)), &plain, factor);
    }
}

/// A ten-thousandth of a metre to the metre: no power of two, so that coordinates are rounded otherwise.
#[test]
fn small_scenes() {
    let plain = bake(&room());
    for scale in [1e-4, 3e4] {
        let other = bake(&room().all_placed(DMat4::from_scale(DVec3::splat(scale))));
        assert_same_means(&plain, &other, ROUNDING);
    }
}

/// A million times its size away from the origin.
#[test]
fn far_from_the_origin() {
    let plain = bake(&room());
    let far = DVec3::new(2e6, -1.5e6, 1e6);
    let other = bake(&room().all_placed(DMat4::from_translation(far)));
    assert_same_means(&plain, &other, ROUNDING);
}

/// Nothing is sampled here, so that the order shows in rounding alone.
#[test]
fn parts_and_triangles_in_another_order() {
    let plain = bake(&room());
    assert_same_means(&plain, &bake(&room().reversed()), ROUNDING);
}

/// Mirrored, which turns every winding round; turned by right angles; and turned so that no wall is along an axis, where another
/// bounding box gives the shooting patches another size.
#[test]
fn mirrored_and_rotated() {
    let plain = bake(&room());
    let mirrored = [DVec3::new(-1.0, 1.0, 1.0), DVec3::new(1.0, 1.0, -1.0), DVec3::splat(-1.0)];
    for scale in mirrored {
        let other = bake(&room().all_placed(DMat4::from_scale(scale)));
        assert_same_means(&plain, &other, ROUNDING);
    }
    let quarter = std::f64::consts::FRAC_PI_2;
    for turn in [
        DMat4::from_rotation_x(quarter),
        DMat4::from_rotation_y(quarter),
        DMat4::from_rotation_z(3.0 * quarter),
    ] {
        assert_same_means(&plain, &bake(&room().all_placed(turn)), ROUNDING);
    }
    let odd = DMat4::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    assert_same_means(&plain, &bake(&room().all_placed(odd)), MESH_ERROR);
}

/// The floor in four pieces that meet in a T, each a part of its own or all in one: facets of one plane are one surface, and the
/// light on it differs by the error of the mesh.
#[test]
fn polygons_in_pieces() {
    let at = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    let (across, along) = (at(0.7, HIGH.y), at(0.7, 0.5));
    let pieces = [
        vec![DVec3::ZERO, at(0.7, 0.0), across, at(0.0, HIGH.y)],
        vec![at(0.7, 0.0), at(2.0, 0.0), at(2.0, 0.5), along],
        vec![along, at(2.0, 0.5), at(1.3, HIGH.y), across],
        vec![at(2.0, 0.5), at(2.0, HIGH.y), at(1.3, HIGH.y)],
    ];
    let mut walls = box_facing_in(DVec3::ZERO, HIGH);
    let floor = walls.remove(4);
    let grey = Material::grey(0.6);
    let build = |floors: &[&[Polygon]]| {
        let walls = SceneBuilder::new().part("walls", &walls, grey);
        let with_floors = floors.iter().fold(walls, |builder, pieces| builder.part("floor", pieces, grey));
        with_floors.part("pillar", &pillar(), Material::grey(0.6)).part("lamp", &lamp(), grey.emitting(8.0))
    };
    let whole = bake(&build(&[&[floor]]));
    let apart: Vec<&[Polygon]> = pieces.chunks(1).collect();
    let on_floor = |result: &Checked| {
        let (area, flux) = result.area_and_flux(|p| p.z < 1e-6);
        flux.x / area
    };
    for floors in [vec![&pieces[..]], apart] {
        let split = bake(&build(&floors));
        let error = on_floor(&split) / on_floor(&whole) - 1.0;
        assert!(error.abs() <= MESH_ERROR, "off by {:.3} %", 100.0 * error);
        let error = split.mean().x / whole.mean().x - 1.0;
        assert!(error.abs() <= MESH_ERROR, "all in all off by {:.3} %", 100.0 * error);
    }
}

/// What one surface sends to another it gets back, by way of all others too, when emitter and receiver change places.
#[test]
fn emitter_and_receiver_change_places() {
    let swapped = |left: f64, right: f64| {
        let panel = |x: f64, low: DVec3, high: DVec3| box_facing_out(low + DVec3::X * x, high + DVec3::X * x);
        let small = panel(0.2, DVec3::new(0.0, 0.2, 0.3), DVec3::new(0.1, 0.5, 0.9));
        let large = panel(1.6, DVec3::new(0.0, 0.3, 0.2), DVec3::new(0.2, 1.0, 1.2));
        let builder = SceneBuilder::new()
            .part("room", &box_facing_in(DVec3::ZERO, HIGH), Material::grey(0.6))
            .part("pillar", &pillar(), Material::grey(0.3))
            .part("small", &small, Material::grey(0.2).emitting(left))
            .part("large", &large, Material::grey(0.7).emitting(right));
        bake(&builder)
    };
    let flux = |result: &Checked, surface: usize| {
        tests::baking::area_and_flux(&result.baked.lit, surface, |_| true).1.x
    };
    let (small_to_large, large_to_small) = (flux(&swapped(5.0, 0.0), 3), flux(&swapped(0.0, 5.0), 2));
    let error = small_to_large / large_to_small - 1.0;
    assert!(error.abs() <= 0.01, "{small_to_large} there, {large_to_small} back");
}
