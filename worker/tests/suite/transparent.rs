//! Rows through transparent occluders ("filters" here), and rows of hemispheres over them.

use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::replica::{Receiver, ScenePolygons};
use kernel::row::{Hemisphere, Precision, Shape, Shooter};
use kernel::visibility::ReceiverGroups;
use worker::engine::{Scene, compute_hemisphere, compute_row};

const PRECISION: Precision = Precision { factor_rounding: 0.0, ..Precision::DEFAULT };

fn rectangle(plane: u32, x: [f64; 2], z: f64) -> ConvexPolygon {
    let corners = [(x[0], -1.0), (x[0], 1.0), (x[1], 1.0), (x[1], -1.0)];
    let corners = corners.map(|(x, y)| DVec3::new(x, y, z)).to_vec();
    ConvexPolygon { plane: PlaneId(plane), corners }
}

fn at_origin() -> Receiver {
    Receiver { position: DVec3::ZERO, normal: DVec3::Z, plane: PlaneId(0) }
}

fn factor(scene: ScenePolygons, shape: Shape) -> f64 {
    draw(scene, shape, 1)
}

/// The same by the rays that a shooter of this key has.
fn draw(scene: ScenePolygons, shape: Shape, key: u64) -> f64 {
    let groups = ReceiverGroups::new(vec![at_origin()]);
    f64::from(compute_row(&scene.into(), &groups, 0, &Shooter { key, shape }, &PRECISION).0[0])
}

/// Facing down.
fn lamp() -> ConvexPolygon {
    rectangle(1, [-1.0, 1.0], 2.0)
}

fn scene_of(polygons: &[(ConvexPolygon, f32)]) -> ScenePolygons {
    let (polygons, opacities) = polygons.iter().cloned().unzip();
    ScenePolygons { polygons, opacities }
}

#[test]
fn a_filter_before_all_of_a_lamp_takes_its_part_exactly() {
    let open = factor(ScenePolygons::default(), Shape::Polygons(vec![lamp()]));
    let filter = (rectangle(2, [-1.0, 1.0], 1.0), 0.25);
    let through = factor(scene_of(std::slice::from_ref(&filter)), Shape::Polygons(vec![lamp()]));
    assert!((through / open - 0.75).abs() < 1e-6, "{through} of {open}");
    let two =
        factor(scene_of(&[filter, (rectangle(3, [-1.0, 1.0], 1.5), 0.5)]), Shape::Polygons(vec![lamp()]));
    assert!((two / open - 0.375).abs() < 1e-6, "{two} of {open}");
}

/// The filter stands before one half of the lamp, and something opaque before the other: the ratio is that of the half that is left.
#[test]
fn only_what_is_seen_through_the_filter_is_dimmed() {
    let open = factor(ScenePolygons::default(), Shape::Polygons(vec![lamp()]));
    let filter = (rectangle(2, [-1.0, 0.0], 1.0), 0.5);
    let half = factor(scene_of(std::slice::from_ref(&filter)), Shape::Polygons(vec![lamp()]));
    assert!((half / open - 0.75).abs() < 0.02, "{half} of {open}");
    let wall = (rectangle(3, [0.0, 1.0], 1.2), 1.0);
    let behind = factor(scene_of(&[filter, wall]), Shape::Polygons(vec![lamp()]));
    assert!((behind / open - 0.25).abs() < 1e-3, "{behind} of {open}");
}

#[test]
fn lights_without_an_area_shine_through_filters() {
    let filtered = || scene_of(&[(rectangle(2, [-1.0, 1.0], 1.0), 0.25)]);
    let point = factor(filtered(), Shape::Point(DVec3::Z * 2.0));
    assert!((point - 0.75 * 0.25).abs() < 1e-7, "{point}");
    let sun = factor(filtered(), Shape::Directional(DVec3::NEG_Z));
    assert!((sun - 0.75).abs() < 1e-7, "{sun}");
}

#[test]
fn hemispheres_see_the_lamp_through_the_filter() {
    let all = scene_of(&[(lamp(), 1.0), (rectangle(2, [-1.0, 1.0], 1.0), 0.25)]);
    let exact = factor(ScenePolygons::default(), Shape::Polygons(vec![lamp()]));
    let hemisphere = Hemisphere { receiver: at_origin(), rays: 16_384 };
    let (row, statistics) = compute_hemisphere(&Scene::from(all), &hemisphere, 1, &PRECISION);
    let seen = f64::from(row.factor(0));
    assert!((seen / exact - 0.75).abs() < 0.01, "{seen} of {exact}");
    let sum: f64 = row.iter().map(|(_, factor)| f64::from(factor)).sum();
    let filter = f64::from(row.factor(1));
    assert!((sum - 1.0 - 0.75 * filter).abs() < 1e-3, "rays through the filter end twice: {sum}");
    assert!(statistics.rays > 16_384);
}

/// A ceiling of many tiles: without anything between exactly the factor of the whole; through a filter and past a wall by rays.
#[test]
fn many_polygons_are_one_shooter() {
    let tiles: Vec<ConvexPolygon> =
        (0..64).map(|i| rectangle(1, [i as f64 / 32.0 - 1.0, (i + 1) as f64 / 32.0 - 1.0], 2.0)).collect();
    let whole = |scene| factor(scene, Shape::Polygons(vec![lamp()]));
    let tiled = |scene| factor(scene, Shape::Polygons(tiles.clone()));
    let open = tiled(ScenePolygons::default());
    assert!((open / whole(ScenePolygons::default()) - 1.0).abs() < 1e-5);
    let wall = || scene_of(&[(rectangle(3, [0.1, 1.0], 1.2), 1.0)]);
    // One draw has an error of 1 %, and tells little.
    let (exact, draws) = (whole(wall()), 512);
    let error = |key| draw(wall(), Shape::Polygons(tiles.clone()), key) / exact - 1.0;
    let errors: Vec<f64> = (0..draws).map(error).collect();
    let mean_of = |value: fn(&f64) -> f64| errors.iter().map(value).sum::<f64>() / draws as f64;
    let (mean, mean_square) = (mean_of(|error| *error), mean_of(|error| error * error));
    assert!(mean.abs() < 0.002 && mean_square.sqrt() < 0.015, "{mean}, {}", mean_square.sqrt());
    let filter = tiled(scene_of(&[(rectangle(2, [-1.0, 1.0], 1.0), 0.25)]));
    assert!((filter / open - 0.75).abs() < 1e-6, "{filter} of {open}");
}
