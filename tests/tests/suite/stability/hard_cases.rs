//! Scenes in which something usually breaks.

use std::f64::consts::FRAC_PI_3;

use bake::BakeSettings;
use glam::{DQuat, DVec3};
use serde_json::json;
use tests::baking::imported;
use tests::builder::{Material, SceneBuilder, pack};
use tests::shapes::{self, Polygon, box_facing_in, box_facing_out};

use super::checked::{
    CLOSED, Checked, Expectation, OPEN, ROW_SUM, UNREFINED, assert_same_bits, checked, checked_scene, coarse,
    unrefined,
};

/// Half of the light is reflected and everything emits 1: irradiance is 2 wherever there is light.
const GLOWING: f64 = 0.5;
const LEVEL: f64 = 1.0 / (1.0 - GLOWING);

/// 1 / (1 - rho) enlarges the error of row sums in f32.
const TOLERANCE: f64 = ROW_SUM / (1.0 - GLOWING);

/// A room 1 m wide in which everything glows, with these things in it.
fn furnace(things: &[(&str, Vec<Polygon>)]) -> SceneBuilder {
    let material = Material::grey(GLOWING).emitting(1.0);
    let room = SceneBuilder::new().part("room", &shapes::unit_room(), material);
    things.iter().fold(room, |builder, (name, polygons)| builder.part(name, polygons, material))
}

fn inside(point: DVec3, low: DVec3, high: DVec3) -> bool {
    point.cmpgt(low).all() && point.cmplt(high).all()
}

/// Three of its faces lie in walls of the room, three of its edges in edges, one corner in the room's corner. What it covers of
/// the walls lies in planes of its own faces and only sees what else it covers.
#[test]
fn box_in_the_corner_of_a_room() {
    let solid = box_facing_out(DVec3::ZERO, DVec3::splat(0.4));
    let covered = |p: DVec3| p.min_element() < 1e-6 && p.max_element() < 0.4;
    let result = checked(&furnace(&[("box", solid)]), &coarse(), Expectation { covered, ..CLOSED });
    result.assert_level(LEVEL, TOLERANCE, |p| !covered(p));
}

/// 2^-10 above the floor: form factors between the two are nearly 1 where they face each other, and change within a thousandth.
#[test]
fn box_nearly_touching_the_floor() {
    let solid = box_facing_out(DVec3::new(0.3, 0.3, 2.0_f64.powi(-10)), DVec3::new(0.6, 0.7, 0.5));
    checked(&furnace(&[("box", solid)]), &coarse(), CLOSED).assert_level(LEVEL, TOLERANCE, |_| true);
}

/// A millimetre in a metre, in the open and on the floor.
#[test]
fn cubes_a_thousandth_of_the_room() {
    let cube = |low: DVec3| box_facing_out(low, low + 1e-3);
    let things =
        [("floating", cube(DVec3::new(0.31, 0.42, 0.53))), ("standing", cube(DVec3::new(0.7, 0.6, 0.0)))];
    let result = checked(&furnace(&things), &coarse(), CLOSED);
    result.assert_level(LEVEL, TOLERANCE, |p| p.z > 1e-6 || (p - DVec3::new(0.7, 0.6, 0.0)).length() > 0.01);
}

/// A metre long, a tenth of a millimetre thick.
#[test]
fn needle_through_the_room() {
    let needle = box_facing_out(DVec3::new(0.05, 0.5, 0.5), DVec3::new(0.95, 0.5001, 0.5001));
    checked(&furnace(&[("needle", needle)]), &coarse(), CLOSED).assert_level(LEVEL, TOLERANCE, |_| true);
}

/// The floor in 64 slivers of a millionth of a degree and up, all from one corner.
#[test]
fn floor_of_slivers() {
    let mut walls = shapes::unit_room();
    walls.remove(4);
    let at = |k: i32| DVec3::new(1.0, if k == 0 { 0.0 } else { 2.0_f64.powi(k - 64) }, 0.0);
    let slivers = (40..64).map(|k| vec![DVec3::ZERO, at(k), at(k + 1)]);
    let first = vec![DVec3::ZERO, at(0), at(40)];
    let rest = vec![DVec3::ZERO, at(64), DVec3::Y];
    walls.extend(slivers.chain([first, rest]));
    let builder = SceneBuilder::new().part("room", &walls, Material::grey(GLOWING).emitting(1.0));
    checked(&builder, &coarse(), CLOSED).assert_level(LEVEL, TOLERANCE, |_| true);
}

/// Two rooms in one box with a wall between them, and a lamp on the left.
fn two_rooms(wall: Vec<Polygon>, material: Material) -> SceneBuilder {
    let lamp = box_facing_out(DVec3::new(0.3, 0.4, 0.5), DVec3::new(0.5, 0.6, 0.6));
    SceneBuilder::new()
        .part("rooms", &box_facing_in(DVec3::ZERO, DVec3::new(2.0, 1.0, 1.0)), Material::grey(0.8))
        .part("lamp", &lamp, Material::grey(0.2).emitting(10.0))
        .part("wall", &wall, material)
}

fn assert_no_leak(builder: &SceneBuilder) {
    // Between the two sides of a wall there is a room, too, with no light in it.
    let covered = |p: DVec3| p.x > 1.0 - 1e-6 && p.x < 1.002;
    let result = checked(builder, &coarse(), Expectation { covered, ..CLOSED });
    let before = result.range(|p| p.x < 1.0 - 1e-6).1;
    let behind = result.range(|p| p.x > 1.0 + 1e-6).1;
    assert!(before > 1.0 && behind == 0.0, "{behind:e} behind, {before} before the wall");
}

/// A wall at x = 1, lit from the left.
fn sheet() -> Polygon {
    [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]].map(|[y, z]| DVec3::new(1.0, y, z)).to_vec()
}

/// One sheet with two sides, and one sheet for each side.
#[test]
fn wall_without_thickness() {
    assert_no_leak(&two_rooms(vec![sheet()], Material::grey(0.7).double_sided()));
    let both = [vec![sheet()], shapes::turned(&[sheet()])].concat();
    assert_no_leak(&two_rooms(both, Material::grey(0.7)));
}

/// A thousandth of the room, what still counts as one plane, and less than an f32 can tell apart at the scale of the room.
#[test]
fn thin_walls() {
    for exponent in [-10, -20, -22] {
        let (low, high) = (DVec3::X, DVec3::new(1.0 + 2.0_f64.powi(exponent), 1.0, 1.0));
        assert_no_leak(&two_rooms(box_facing_out(low, high), Material::grey(0.7)));
    }
}

/// The wall goes on through floor, ceiling and walls.
#[test]
fn wall_that_passes_through_the_room() {
    let (low, high) = (DVec3::new(1.0, -0.1, -0.2), DVec3::new(1.01, 1.15, 1.07));
    let builder = two_rooms(box_facing_out(low, high), Material::grey(0.7));
    let outside = |p: DVec3| !inside(p, DVec3::splat(-1e-6), DVec3::new(2.0, 1.0, 1.0) + 1e-6);
    let result = checked(&builder, &coarse(), Expectation { imbalance: 0.05, ..OPEN });
    let before = result.range(|p| p.x < 1.0 - 1e-6).1;
    let behind = result.range(|p| p.x > 1.0 + 1e-6).1;
    assert!(before > 1.0 && behind == 0.0, "{behind:e} behind, {before} before the wall");
    assert_eq!(result.range(outside).1, 0.0);
}

/// Boxes through one another, one of them at an odd angle: what of each is inside of another is dark, all else is level.
#[test]
fn interpenetrating_solids() {
    let (low, high) = (DVec3::new(0.25, 0.3, 0.2), DVec3::new(0.65, 0.6, 0.5));
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    let centre = DVec3::new(0.6, 0.6, 0.5);
    let half = DVec3::new(0.15, 0.2, 0.1);
    let turned = box_facing_out(-half, half)
        .into_iter()
        .map(|face| face.into_iter().map(|corner| centre + turn * corner).collect())
        .collect();
    let builder = furnace(&[("straight", box_facing_out(low, high)), ("turned", turned)]);
    let in_turned = move |p: DVec3| {
        let own = turn.inverse() * (p - centre);
        own.abs().cmplt(half - 1e-6).all()
    };
    let result = checked(&builder, &coarse(), OPEN);
    result.assert_level(LEVEL, TOLERANCE, |p| !in_turned(p) && !inside(p, low + 1e-6, high - 1e-6));
}

/// Three sheets that meet in one edge, which then has more than two faces; and two boxes that share an edge only.
#[test]
fn non_manifold_edges() {
    let fin = |angle: f64| {
        let (sine, cosine) = angle.sin_cos();
        let out = DVec3::new(0.3 * cosine, 0.3 * sine, 0.0);
        let (low, high) = (DVec3::new(0.5, 0.5, 0.2), DVec3::new(0.5, 0.5, 0.7));
        vec![low, low + out, high + out, high]
    };
    let sheets: Vec<Polygon> = [0.3, 2.1, 4.4].map(fin).to_vec();
    let glowing = Material::grey(GLOWING).emitting(1.0);
    let builder = furnace(&[]).part("fins", &sheets, glowing.double_sided());
    checked(&builder, &coarse(), CLOSED).assert_level(LEVEL, TOLERANCE, |_| true);
    let boxes = [
        box_facing_out(DVec3::splat(0.3), DVec3::splat(0.5)),
        box_facing_out(DVec3::new(0.5, 0.5, 0.3), DVec3::new(0.7, 0.7, 0.5)),
    ];
    checked(&furnace(&[("boxes", boxes.concat())]), &coarse(), CLOSED)
        .assert_level(LEVEL, TOLERANCE, |_| true);
}

/// Triangles without area, doubled triangles and corners written twice change no bit.
#[test]
fn what_import_drops_changes_nothing() {
    let lamp = box_facing_out(DVec3::splat(0.4), DVec3::splat(0.6));
    let build = |walls: &[Polygon]| {
        let room = SceneBuilder::new().part("room", walls, Material::grey(0.7));
        room.part("lamp", &lamp, Material::grey(0.0).emitting(5.0))
    };
    let walls = shapes::unit_room();
    let plain = checked(&build(&walls), &coarse(), CLOSED);
    let [a, b, c] = [0.25, 0.5, 0.75].map(|x| DVec3::new(x, 0.5 * x, 0.0));
    let additions = [
        vec![vec![a, b, c], vec![a, b, c, c]],
        vec![walls[3].clone(), walls[1].clone()],
        vec![vec![a, a, b], vec![c, c, c]],
    ];
    for more in additions {
        let other = checked(&build(&[walls.clone(), more].concat()), &coarse(), CLOSED);
        assert_same_bits(&plain, &other, 1.0);
    }
}

/// In a white room nearly all light comes from other walls, so that what the mesh loses at each reflection adds up: 3.6 % at these
/// settings. It falls with the mesh, by 2.6 for half the edge, and does not rise with the reflectance: the rows close.
#[test]
fn nearly_white_rooms() {
    for (reflectance, shooter_edge, most) in [(0.99, 0.25, 0.04), (0.99, 0.12, 0.016), (0.999, 0.12, 0.016)] {
        let lamp = box_facing_out(DVec3::new(0.2, 0.3, 0.6), DVec3::new(0.4, 0.5, 0.8));
        let builder = SceneBuilder::new()
            .part("room", &box_facing_in(DVec3::ZERO, DVec3::new(1.0, 1.5, 1.0)), Material::grey(reflectance))
            .part("lamp", &lamp, Material::grey(reflectance).emitting(1.0));
        let settings = BakeSettings { shooter_edge, ..coarse() };
        let result = checked(&builder, &settings, Expectation { imbalance: most, ..CLOSED });
        let (area, flux) = result.area_and_flux(|_| true);
        // All that the lamp's 0.24 m^2 emit is absorbed.
        let level = 0.24 / (1.0 - reflectance) / area;
        let error = flux.x / area / level - 1.0;
        assert!(error.abs() <= most, "rho {reflectance}: off by {:.3} %", 100.0 * error);
    }
}

/// A millimetre that shines like a lamp of the room.
#[test]
fn tiny_bright_lamp() {
    let low = DVec3::new(0.31, 0.42, 0.73);
    let builder = SceneBuilder::new().part("room", &shapes::unit_room(), Material::grey(0.5)).part(
        "lamp",
        &box_facing_out(low, low + 1e-3),
        Material::grey(0.5).emitting(1e6),
    );
    let result = checked(&builder, &coarse(), CLOSED);
    let (_, flux) = result.area_and_flux(|_| true);
    // 6 faces of 1e-6 m^2; reflected once, twice, ...
    let error = flux.x / 12.0 - 1.0;
    assert!(error.abs() <= 0.02, "{flux}, off by {:.3} %", 100.0 * error);
}

/// Channels 1e12 apart are as many bakes in one: each is what it would be alone.
#[test]
fn channels_of_a_lamp_far_apart() {
    let lamp = |exitance: DVec3| {
        let material = Material { exitance, ..Material::grey(0.3) };
        let room = Material { reflectance: DVec3::new(0.9, 0.5, 0.7), ..Material::grey(0.0) };
        SceneBuilder::new().part("room", &shapes::unit_room(), room).part(
            "lamp",
            &box_facing_out(DVec3::splat(0.3), DVec3::splat(0.5)),
            material,
        )
    };
    let apart = DVec3::new(1.0, 1e-6, 1e-12);
    let even = checked(&lamp(DVec3::ONE), &unrefined(), UNREFINED);
    let uneven = checked(&lamp(apart), &unrefined(), UNREFINED);
    for (even, uneven) in even.baked.lit.vertices.iter().zip(&uneven.baked.lit.vertices) {
        // Emissive factors travel as f32.
        let error = (uneven.irradiance / (even.irradiance * apart) - 1.0).abs();
        assert!(error.max_element() <= 1e-6, "{} and {}", even.irradiance, uneven.irradiance);
    }
}

/// The weak room does not hear of the strong one: it is lit as if it were alone.
#[test]
fn closed_rooms_far_apart_in_brightness() {
    let room = |builder: SceneBuilder, name: &str, at: f64, exitance: f64| {
        let walls = box_facing_in(DVec3::X * at, DVec3::new(at + 1.0, 1.0, 1.0));
        let lamp = box_facing_out(DVec3::new(at + 0.2, 0.3, 0.4), DVec3::new(at + 0.5, 0.5, 0.6));
        builder.part(&format!("{name} walls"), &walls, Material::grey(0.9)).part(
            &format!("{name} lamp"),
            &lamp,
            Material::grey(0.5).emitting(exitance),
        )
    };
    let both = |weak: f64| {
        let strong = room(SceneBuilder::new(), "strong", 0.0, 1.0);
        checked(&room(strong, "weak", 1.5, weak), &unrefined(), UNREFINED)
    };
    let (even, uneven) = (both(1.0), both(1e-12));
    for (name, mean) in even.means() {
        let factor = if name.contains("weak") { 1e-12 } else { 1.0 };
        let error = (uneven.means()[&name] / (mean * factor) - 1.0).abs().max_element();
        assert!(error <= 1e-5, "{name}: off by {error:e}");
    }
}

/// Two unit squares 1 m apart, facing each other, and nothing else: 0.19982 of what leaves one meets the other. No row is scaled
/// up, so the floor sees no more than the lamp.
#[test]
fn open_scene() {
    let square =
        |z: f64| [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| DVec3::new(x, y, z)).to_vec();
    let builder = SceneBuilder::new().part("floor", &[square(0.0)], Material::grey(0.0)).part(
        "lamp",
        &shapes::turned(&[square(1.0)]),
        Material::grey(0.0).emitting(1.0),
    );
    let fine = BakeSettings { mesh_error: 0.0075, ..coarse() };
    let result = checked(&builder, &fine, Expectation { imbalance: 0.01, ..OPEN });
    let (_, flux) = result.area_and_flux(|p| p.z < 0.5);
    let error = flux.x / 0.199_824_9 - 1.0;
    assert!(error.abs() <= 0.005, "{flux}, off by {:.3} %", 100.0 * error);
    assert!(
        (result.baked.report.row_sums.largest - 0.2395).abs() < 0.01,
        "{:?}",
        result.baked.report.row_sums
    );
    let escaped = result.baked.report.balance.escaped[0];
    assert!((escaped / 0.800_175_1 - 1.0).abs() <= 0.005, "{escaped} escaped");
}

/// A prism of six sides with the normals of a cylinder, the most that smoothing bends: a vertex of each crease looks past its faces, and
/// for transport stands above them both.
#[test]
fn smoothed_over_creases() {
    let ring: Vec<DVec3> = (0..6)
        .map(|corner| {
            let (y, x) = (FRAC_PI_3 * f64::from(corner)).sin_cos();
            DVec3::new(0.45 + 0.2 * x, 0.45 + 0.2 * y, 0.3)
        })
        .collect();
    let raised = |corner: usize| ring[corner % 6] + DVec3::Z * 0.3;
    let side = |corner: usize| vec![ring[corner], ring[(corner + 1) % 6], raised(corner + 1), raised(corner)];
    let caps = [ring.iter().rev().copied().collect(), (0..6).map(raised).collect()];
    let solid: Vec<Polygon> = (0..6).map(side).chain(caps).collect();
    let (mut document, mut binary) = furnace(&[("prism", solid)]).document();
    let accessor = document["accessors"][1].clone();
    let count = accessor["count"].as_u64().unwrap() as usize;
    let start = document["bufferViews"][1]["byteOffset"].as_u64().unwrap() as usize;
    let coordinate = |index: usize| {
        let bytes = &binary[start + 4 * index..][..4];
        f32::from_le_bytes(bytes.try_into().unwrap())
    };
    let normal = |vertex: usize| {
        let [x, y] = [0, 1].map(|axis| coordinate(3 * vertex + axis) - 0.45);
        [x / x.hypot(y), y / x.hypot(y), 0.0]
    };
    let normals: Vec<u8> = (0..count).flat_map(normal).flat_map(f32::to_le_bytes).collect();
    let views = document["bufferViews"].as_array_mut().unwrap();
    views.push(json!({ "buffer": 0, "byteOffset": binary.len(), "byteLength": normals.len() }));
    binary.extend(normals);
    let accessors = document["accessors"].as_array_mut().unwrap();
    accessors.push(json!({ "bufferView": 2, "componentType": 5126, "count": count, "type": "VEC3" }));
    document["meshes"][1]["primitives"][0]["attributes"]["NORMAL"] = json!(2);
    document["buffers"][0]["byteLength"] = json!(binary.len());
    let scene = imported(&pack(&document, &binary));
    let sides = scene.surfaces[1].facets.iter().filter(|facet| facet.normal.z.abs() < 0.5);
    let bent = sides.flat_map(|facet| facet.corners.iter().map(|corner| corner.normal.dot(facet.normal)));
    assert!(bent.clone().count() >= 24 && bent.clone().all(|cosine| cosine < 0.87));
    let baked = checked_scene(&scene, &coarse(), CLOSED);
    Checked { scene, baked }.assert_level(LEVEL, TOLERANCE, |_| true);
}
