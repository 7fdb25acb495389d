//! Area lights of EXT_lights_area against formulas, the same lamps as emissive meshes, and the path tracer.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fs;

use assert_cmd::Command;
use bake::lit::{LitMesh, LitVertex};
use bake::{BakeSettings, LightChange, LightGroup, LightPart, NewLight, RowStrategy, relight};
use glam::{DMat4, DVec3};
use gltf::Glb;
use kernel::row::{Precision, Shape, Shooter};
use kernel::visibility::ReceiverGroups;
use scene::LightKind;
use serde_json::{Value, json};
use tests::baking::{baked, imported, vertices_of};
use tests::builder::{Material, SceneBuilder};
use tests::programs::binary;
use tests::shapes::{self, Polygon};
use worker::engine::{Scene, compute_row};

use crate::occlusion::receivers_on;

/// Reflectance at which reflected light does not count but radiosity still drives the mesh.
const NEARLY_BLACK: f64 = 1e-6;

/// Luminance of the lamps.
const LUMINANCE: f64 = 10.0;

/// Sides of a disk as a mesh.
const SIDES: u32 = 256;

fn lamp(shape: &str) -> Value {
    json!({ "name": "panel", "type": shape, "intensity": LUMINANCE, "size": 0.4, "rect": { "aspect": 2.0 } })
}

/// The same lamp as a polygon in the coordinates of its node, lit from below; of the disk's own area.
fn lamp_polygon(shape: &str) -> Polygon {
    if shape == "rect" {
        return [(-0.4, -0.2), (-0.4, 0.2), (0.4, 0.2), (0.4, -0.2)]
            .map(|(x, y)| DVec3::new(x, y, 0.0))
            .to_vec();
    }
    let turn = TAU / f64::from(SIDES);
    let radius = 0.2 * (turn / turn.sin()).sqrt();
    (0..SIDES)
        .rev()
        .map(|side| f64::from(side) * turn)
        .map(|angle| DVec3::new(angle.cos(), angle.sin(), 0.0) * radius)
        .collect()
}

/// Where the lamp hangs: turned in every axis, and scaled evenly.
fn hung() -> DMat4 {
    DMat4::from_translation(DVec3::new(0.45, 0.7, 0.55))
        * DMat4::from_rotation_x(-1.2)
        * DMat4::from_rotation_y(0.4)
        * DMat4::from_rotation_z(0.3)
        * DMat4::from_scale(DVec3::splat(0.75))
}

/// The unit cube as a room.
fn room(reflectance: f64) -> SceneBuilder {
    SceneBuilder::new().part("walls", &shapes::unit_room(), Material::grey(reflectance))
}

/// The walls' vertices in a fixed order.
fn walls(lit: &LitMesh) -> Vec<LitVertex> {
    let mut vertices = vertices_of(lit, 0);
    let key = |vertex: &LitVertex| (vertex.position.to_array(), vertex.normal.to_array());
    vertices.sort_by(|a, b| key(a).partial_cmp(&key(b)).expect("finite coordinates"));
    vertices
}

/// The largest difference of irradiance at a vertex of the walls, relative to the largest irradiance.
fn difference(one: &LitMesh, other: &LitMesh) -> f64 {
    let (one, other) = (walls(one), walls(other));
    assert_eq!(one.len(), other.len());
    let largest = other.iter().map(|vertex| vertex.irradiance.x).fold(0.0, f64::max);
    let pairs = one.iter().zip(&other).inspect(|(a, b)| assert_eq!(a.position, b.position));
    pairs.map(|(a, b)| (a.irradiance.x - b.irradiance.x).abs()).fold(0.0, f64::max) / largest
}

/// On one and the same mesh: nothing is refined.
fn unrefined(rows: RowStrategy) -> BakeSettings {
    BakeSettings {
        shooter_edge: 0.1,
        mesh_error: 10.0,
        threshold: 1e-9,
        rows,
        factor_rounding: 0.0,
        simplify: false,
        validation_samples: 0,
        ..BakeSettings::default()
    }
}

/// F of a point to a rectangle in a parallel plane, one corner of which is straight above it (Howell, A Catalog of Radiation Heat
/// Transfer Configuration Factors, B-3).
fn corner_factor(x: f64, y: f64) -> f64 {
    let part = |x: f64, y: f64| x / x.hypot(1.0) * (y / x.hypot(1.0)).atan();
    (part(x, y) + part(y, x)) / TAU
}

/// Every factor of the rows of lights that hang over a plate, straight down, is that of the formula.
#[test]
fn rows_are_those_of_parallel_rectangles_and_disks() {
    let height = 0.6;
    let plate: Polygon =
        [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)].map(|(x, z)| DVec3::new(x, 0.0, z)).to_vec();
    let place = DMat4::from_translation(DVec3::Y * height) * DMat4::from_rotation_x(-FRAC_PI_2);
    let receivers = receivers_on(&plate, 41);
    for shape in ["rect", "disk"] {
        let builder = SceneBuilder::new().part("plate", std::slice::from_ref(&plate), Material::grey(0.5));
        let scene = imported(&builder.light(lamp(shape), place).glb());
        let LightKind::Area(area) = scene.lights[0].kind else { panic!("{:?}", scene.lights) };
        let mut polygon = area.polygon();
        polygon.corners.iter_mut().for_each(|corner| *corner = scene.frame.to_world(*corner));
        let shooter = Shooter { key: 0, shape: Shape::Polygons(vec![polygon]) };
        let precision = Precision { factor_rounding: 0.0, ..Precision::DEFAULT };
        let groups = ReceiverGroups::new(receivers.clone());
        let (row, _) = compute_row(&Scene::new(&[]), &groups, 0, &shooter, &precision);
        for (receiver, found) in receivers.iter().zip(row) {
            let [x, z] = [receiver.position.x / height, receiver.position.z / height];
            let expected = if shape == "rect" {
                let [a, b] = [0.4 / height, 0.2 / height];
                corner_factor(a - x, b - z)
                    + corner_factor(a + x, b - z)
                    + corner_factor(a - x, b + z)
                    + corner_factor(a + x, b + z)
            } else {
                // Howell, B-13.
                let (off, radius) = (x * x + z * z, (0.2 / height) * (0.2 / height));
                let all = 1.0 + off + radius;
                (1.0 - (1.0 + off - radius) / (all * all - 4.0 * off * radius).sqrt()) / 2.0
            };
            assert!(
                (f64::from(found) - expected).abs() <= 5e-7 * 0.1,
                "{shape} {x} {z}: {found}, not {expected}"
            );
        }
    }
}

/// On the axis of a disk: E = pi L r^2 / (r^2 + h^2), in lux of the file.
#[test]
fn a_disk_over_a_point_gives_what_the_formula_says() {
    let place = DMat4::from_translation(DVec3::new(0.5, 0.5, 0.5)) * DMat4::from_rotation_x(-FRAC_PI_2);
    let scene = imported(&room(NEARLY_BLACK).light(lamp("disk"), place).glb());
    let settings = BakeSettings { mesh_error: 0.002, simplify: false, ..BakeSettings::default() };
    let lit = baked(&scene, &settings).lit;
    let expected = PI * LUMINANCE * 0.04 / (0.04 + 0.25);
    let below = walls(&lit)
        .into_iter()
        .filter(|vertex| scene.frame.to_world(vertex.position).distance(DVec3::new(0.5, 0.0, 0.5)) < 1e-6);
    let found: Vec<f64> = below.map(|vertex| vertex.irradiance.x).collect();
    let [found] = found[..] else { panic!("{found:?}") };
    assert!((found / expected - 1.0).abs() <= 0.003, "{found} lx, expected {expected}");
}

/// A lamp of either shape, turned and scaled by its node, lights a room as the same lamp of triangles, whatever the rows.
#[test]
fn lamps_are_those_of_emissive_meshes() {
    for shape in ["rect", "disk"] {
        let material = Material::grey(0.0).emitting(PI * LUMINANCE);
        let mesh = imported(
            &room(NEARLY_BLACK).part("panel", &[lamp_polygon(shape)], material).placed(hung()).glb(),
        );
        // Scaled in one axis: the largest scale counts for all.
        let odd = hung() * DMat4::from_scale(DVec3::new(0.5, 1.0, 0.1));
        let light = imported(&room(NEARLY_BLACK).light(lamp(shape), odd).glb());
        for rows in [RowStrategy::Exact, RowStrategy::Gather] {
            let [light, mesh] = [&light, &mesh].map(|scene| baked(scene, &unrefined(rows).with_rays(256.0)));
            let apart = difference(&light.lit, &mesh.lit);
            assert!(apart <= 1e-5, "{shape}, {rows:?}: {apart}");
            assert_eq!(light.report.model.area_lights, 1);
            let [one, other] = [&light, &mesh].map(|baked| baked.report.balance.emitted[0]);
            assert!((one / other - 1.0).abs() <= 1e-6, "{one} {other}");
        }
    }
}

/// In a closed room all flux arrives; in an open one what misses the surfaces escapes.
#[test]
fn flux_is_accounted_for() {
    let scene = imported(&room(0.5).light(lamp("rect"), hung()).glb());
    let report = baked(&scene, &BakeSettings::default()).report;
    let emitted = PI * LUMINANCE * 0.32 * 0.75 * 0.75;
    assert!((report.balance.emitted[0] / emitted - 1.0).abs() <= 1e-6, "{:?}", report.balance);
    assert!(report.balance.relative_imbalance().abs() <= 0.005, "{:?}", report.balance);
    // Two faces that see each other: of a free plate it is not known that light can leave the scene.
    let is_kept = |face: &Polygon| face.iter().all(|p| p.y == 0.0) || face.iter().all(|p| p.x == 0.0);
    let faces: Vec<Polygon> = shapes::unit_room().into_iter().filter(is_kept).collect();
    let open = SceneBuilder::new().part("faces", &faces, Material::grey(0.5)).light(lamp("disk"), hung());
    let settings = BakeSettings { shooter_edge: 0.07, ..BakeSettings::default() };
    let report = baked(&imported(&open.glb()), &settings).report;
    let emitted = PI * LUMINANCE * PI * 0.04 * 0.75 * 0.75;
    let balance = &report.balance;
    assert!((balance.emitted[0] / emitted - 1.0).abs() <= 1e-6, "{balance:?}");
    assert!(balance.relative_imbalance().abs() <= 0.005 && balance.escaped[0] > 0.3 * emitted, "{balance:?}");
}

/// Groups sum to the whole, direct and indirect light too, and a light that is changed afterwards is that of another bake.
#[test]
fn lights_can_be_apart_and_changed() {
    let other =
        json!({ "name": "bulb", "type": "disk", "intensity": 3.0, "size": 0.2, "color": [1.0, 0.5, 0.25] });
    let place = DMat4::from_translation(DVec3::new(0.2, 0.9, 0.2)) * DMat4::from_rotation_x(-FRAC_PI_2);
    let scene = |factor: f64| {
        let mut panel = lamp("rect");
        panel["intensity"] = json!(factor * LUMINANCE);
        imported(&room(0.5).light(panel, hung()).light(other.clone(), place).glb())
    };
    for rows in [RowStrategy::Exact, RowStrategy::Gather] {
        let group = |name: &str| LightGroup { name: name.into(), lights: vec![name.into()] };
        let settings = BakeSettings {
            groups: vec![group("panel"), group("bulb")],
            keep_light: Some(u64::MAX),
            rays_per_hemisphere: 256,
            shooter_edge: 0.15,
            ..unrefined(rows)
        };
        let (before, after) = (baked(&scene(1.0), &settings), baked(&scene(3.0), &settings));
        for (index, vertex) in before.lit.vertices.iter().enumerate() {
            let sum: DVec3 = before.lit.layers.iter().map(|layer| layer.irradiance[index]).sum();
            assert!(sum.distance(vertex.irradiance) <= 1e-5 * vertex.irradiance.length(), "{rows:?}");
        }
        let changes = vec![LightChange { light: "panel".into(), factor: DVec3::splat(3.0) }];
        let new = NewLight { changes, ..NewLight::default() };
        let relit = relight(&scene(1.0), before.kept.as_ref().unwrap(), &new).unwrap();
        let apart = difference(&relit.lit, &after.lit);
        assert!(apart <= 1e-5, "{rows:?}: {apart}");
        let lights =
            &relit.scene.source.root.extensions.as_ref().unwrap().others["EXT_lights_area"]["lights"];
        assert_eq!((&lights[0]["intensity"], &lights[1]["intensity"]), (&json!(30.0), &json!(3.0)));
        let part = |only| baked(&scene(1.0), &BakeSettings { only, ..settings.clone() }).lit;
        let (direct, indirect) = (part(LightPart::Direct), part(LightPart::Indirect));
        for ((direct, indirect), all) in walls(&direct).iter().zip(walls(&indirect)).zip(walls(&before.lit)) {
            let sum = direct.irradiance + indirect.irradiance;
            assert!(sum.distance(all.irradiance) <= 0.01 * all.irradiance.length(), "{rows:?} {sum} {all:?}");
        }
    }
}

/// Two lamps over a box, one of them in the plane of the ceiling, by the command line: the bake against the path tracer, what is
/// said, and what is kept of the file.
#[test]
fn bakes_agree_with_the_path_tracer() {
    let folder = tempfile::tempdir().unwrap();
    let [scene, lit, csv] = ["scene.glb", "lit.glb", "reference.csv"].map(|name| folder.path().join(name));
    let boxed = shapes::box_facing_out(DVec3::new(0.3, 0.0, 0.3), DVec3::new(0.6, 0.4, 0.7));
    let ceiling = DMat4::from_translation(DVec3::new(0.7, 1.0, 0.6)) * DMat4::from_rotation_x(-FRAC_PI_2);
    let disk = json!({ "name": "bulb", "type": "disk", "intensity": 20.0, "size": 0.3 });
    let builder =
        room(0.5).part("box", &boxed, Material::grey(0.3)).light(lamp("rect"), hung()).light(disk, ceiling);
    fs::write(&scene, builder.glb()).unwrap();
    let run = |arguments: &[&str], files: &[&std::path::Path]| {
        let mut command = Command::new(binary("coordinator"));
        let output = command.args(arguments).args(files).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let said = run(&["solve", "--error", "0.01", "-o"], &[&lit, &scene]);
    for words in ["1 rectangular area light", "1 disk area light"] {
        assert!(said.contains(words), "{words} is missing in: {said}");
    }
    run(&["reference", "--points", "300", "--paths", "1024", "-o"], &[&csv, &scene]);
    let score = run(&["compare", "--reference"], &[&csv, std::path::Path::new("--scene"), &scene, &lit]);
    let score: Value = serde_json::from_str(&score).unwrap();
    assert_eq!((&score["uncovered"], &score["not_finite"]), (&0.into(), &0.into()));
    assert!((score["energy_ratio"].as_f64().unwrap() - 1.0).abs() < 0.006, "{score}");
    assert!(score["relative_l2"].as_f64().unwrap() < 0.015, "{score}");
    let json_of = |path| -> Value {
        serde_json::from_slice(&Glb::from_slice(&fs::read(path).unwrap()).unwrap().json).unwrap()
    };
    let (before, after) = (json_of(&scene), json_of(&lit));
    assert_eq!(before["extensions"], after["extensions"]);
    assert!(after["extensionsUsed"].as_array().unwrap().contains(&json!("EXT_lights_area")));
}
