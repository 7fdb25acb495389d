//! Light probes: against the field of a disk, the solution's own irradiance, and the files that they come in.

use std::f64::consts::{PI, TAU};
use std::fs;

use assert_cmd::Command;
use bake::{AskedPoints, BakeSettings, LightPart, RowStrategy};
use glam::DVec3;
use gltf::Gltf;
use kernel::replica::Receiver;
use probes::{Coefficients, Places, Plan, irradiance, plan};
use scene::{ImportOptions, Scene, import};
use serde_json::{Value, json};
use tests::baking::{baked_with_points, imported};
use tests::builder::{Material, SceneBuilder};
use tests::data;
use tests::numbers::Numbers;
use tests::programs::binary;
use tests::shapes;

fn asked(plan: &Plan) -> AskedPoints<'_> {
    AskedPoints { in_space: plan.receivers(), ..AskedPoints::default() }
}

fn at(scene: &Scene, points: &[DVec3]) -> Plan {
    plan(scene, &Places::Points(points.to_vec())).unwrap()
}

#[test]
fn the_field_of_a_disk() {
    let corners = 64;
    // As large as a disk of radius 1.
    let radius = (TAU / (f64::from(corners) * (TAU / f64::from(corners)).sin())).sqrt();
    let corner = |index| {
        let (sine, cosine) = (TAU * f64::from(index) / f64::from(corners)).sin_cos();
        DVec3::new(radius * cosine, radius * sine, 0.0)
    };
    let disk = (0..corners).map(corner).collect();
    let glb = SceneBuilder::new().part("disk", &[disk], Material::grey(0.0).emitting(PI)).glb();
    let scene = imported(&glb);
    let heights = [0.2, 0.7, 1.5];
    let plan = at(&scene, &heights.map(|height| DVec3::Z * height));
    let baked = baked_with_points(&scene, &BakeSettings::for_error(0.1), &asked(&plan), 1);
    let probes = plan.probes(&baked.at_points.in_space);
    assert_eq!(probes.inside, [false; 3]);
    for (found, height) in probes.layers[0].iter().zip(heights) {
        // Radiance 1 from all directions whose cosine to -z is above this one.
        let cosine = height / height.hypot(1.0);
        let mut expected = [0.0; 9];
        expected[0] = (PI).sqrt() * (1.0 - cosine);
        expected[2] = -(3.0 * PI / 4.0).sqrt() * (1.0 - cosine * cosine);
        expected[6] = (5.0 * PI / 4.0).sqrt() * (cosine - cosine.powi(3));
        let squares = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>();
        let error = squares(&mut found.iter().zip(expected).map(|(found, expected)| found.y - expected));
        let relative = (error / squares(&mut expected.into_iter())).sqrt();
        assert!(relative < 0.02, "{relative} at {height}: {found:?}, expected {expected:?}");
    }
}

/// Relative L2 of the irradiance by probes, against that of the same solution at a thousand normals.
fn error_of(scene: &Scene, settings: &BakeSettings, spacing: f64) -> f64 {
    let plan = plan(scene, &Places::Grid(spacing)).unwrap();
    let receivers = plan.receivers().to_vec();
    let places: Vec<DVec3> = receivers.iter().step_by(32).map(|receiver| receiver.position).collect();
    let mut numbers = Numbers::new(7);
    let mut normals: Vec<Receiver> = vec![];
    for index in 0..1000 {
        let normal = loop {
            let point = numbers.point(DVec3::NEG_ONE, DVec3::ONE);
            if (0.01..1.0).contains(&point.length_squared()) {
                break point.normalize();
            }
        };
        normals.push(Receiver { position: places[index % places.len()], normal, ..receivers[0] });
    }
    let all: Vec<Receiver> = receivers.iter().chain(&normals).copied().collect();
    let points = AskedPoints { in_space: &all, ..AskedPoints::default() };
    let light = baked_with_points(scene, settings, &points, 2).at_points.in_space;
    let probes = plan.probes(&[light[0][..receivers.len()].to_vec()]);
    let open = probes.inside.iter().zip(&probes.layers[0]).filter(|(inside, _)| !**inside);
    let open: Vec<&Coefficients> = open.map(|(_, coefficients)| coefficients).collect();
    assert_eq!(open.len(), places.len());
    let (mut errors, mut sum) = (0.0, 0.0);
    for (index, (receiver, exact)) in normals.iter().zip(&light[0][receivers.len()..]).enumerate() {
        let found = irradiance(open[index % open.len()], receiver.normal);
        errors += (found - *exact).length_squared();
        sum += exact.length_squared();
    }
    f64::sqrt(errors / sum)
}

#[test]
fn irradiance_at_any_normal() {
    let scene = import(&data("scenes/cornell.glb"), &ImportOptions::default()).unwrap();
    // Order 2 cannot hold more of one lamp's light. Rays have noise, at the normals that the probes are held against, too.
    for (only, rows, most) in [
        (LightPart::All, RowStrategy::Exact, 0.04),
        (LightPart::Indirect, RowStrategy::Exact, 0.01),
        (LightPart::Indirect, RowStrategy::Gather, 0.025),
    ] {
        let settings = BakeSettings { only, rows, ..BakeSettings::for_error(0.05) };
        let error = error_of(&scene, &settings, 1.0);
        assert!(error < most, "{error} of {only:?} with {rows:?}");
    }
}

#[test]
fn probes_are_the_same_whatever_the_workers() {
    let scene = import(&data("scenes/cornell.glb"), &ImportOptions::default()).unwrap();
    let plan = plan(&scene, &Places::Grid(2.5)).unwrap();
    for rows in [RowStrategy::Exact, RowStrategy::Gather] {
        let settings = BakeSettings { rows, ..BakeSettings::for_error(0.2) };
        let light = |threads| baked_with_points(&scene, &settings, &asked(&plan), threads).at_points.in_space;
        assert!(light(1) == light(3), "{rows:?}");
    }
}

/// A room of one unit with a wall in its middle, made of this.
fn walled(material: Material) -> Vec<u8> {
    let wall = shapes::box_facing_out(DVec3::new(0.4, 0.2, 0.2), DVec3::new(0.6, 0.8, 0.8));
    SceneBuilder::new()
        .part("walls", &shapes::unit_room(), Material::grey(0.5).emitting(1.0))
        .part("wall", &wall, material)
        .glb()
}

#[test]
fn probes_inside_of_walls_are_told() {
    for material in [Material::grey(0.5), Material::grey(0.5).double_sided()] {
        let scene = imported(&walled(material));
        let plan = plan(&scene, &Places::Grid(0.2)).unwrap();
        let baked = baked_with_points(&scene, &BakeSettings::for_error(0.2), &asked(&plan), 2);
        let probes = plan.probes(&baked.at_points.in_space);
        assert_eq!(probes.grid.unwrap().size, [5; 3]);
        let level = |probe: usize| probes.layers[0][probe][0].x;
        for (probe, position) in probes.positions.iter().enumerate() {
            let is_inside = (0.4..0.6).contains(&position.x)
                && (0.2..0.8).contains(&position.y)
                && (0.2..0.8).contains(&position.z);
            assert_eq!(probes.inside[probe], is_inside, "at {position}: {material:?}");
            // Those inside have the light of those around.
            assert!((0.5..2.0).contains(&(level(probe) / level(0))), "at {position}");
        }
    }
}

#[test]
fn probes_are_in_the_file_and_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.glb"), walled(Material::grey(0.5))).unwrap();
    fs::write(folder.path().join("points.txt"), "0.2 0.5 0.5\n\n0.5, 0.5, 0.5\n").unwrap();
    let solve = |more: &[&str]| {
        let mut command = Command::new(binary("coordinator"));
        command.current_dir(folder.path()).args(["solve", "scene.glb", "--error", "0.2"]).args(more);
        command.output().unwrap()
    };
    let read = |name: &str| -> Value {
        serde_json::from_slice(&fs::read(folder.path().join(name)).unwrap()).unwrap()
    };
    let extras = |name: &str| -> Value {
        let file = Gltf::open(folder.path().join(name)).unwrap();
        let extras: Value =
            serde_json::from_str(file.as_json().asset.extras.as_ref().unwrap().get()).unwrap();
        extras["halflight"]["probes"].clone()
    };
    let answer = solve(&["-o", "grid.glb", "--probes", "0.2", "--group", "all=walls"]);
    assert!(answer.status.success(), "{}", String::from_utf8_lossy(&answer.stderr));
    let grid = read("grid-probes.json");
    assert_eq!(grid, extras("grid.glb"));
    assert_eq!(grid["grid"]["size"], json!([5, 5, 5]));
    assert_eq!(grid["coefficients"][124].as_array().unwrap().len(), 27);
    assert_eq!((&grid["groups"][0]["name"], &grid["unit"]), (&"all".into(), &"W/m^2".into()));
    let first = |layer: &Value| layer["coefficients"][0][0].as_f64().unwrap();
    assert!((first(&grid) / first(&grid["groups"][0]) - 1.0).abs() < 1e-3);

    let answer = solve(&["-o", "points.ply", "--probe-points", "points.txt"]);
    assert!(answer.status.success(), "{}", String::from_utf8_lossy(&answer.stderr));
    let points = read("points-probes.json");
    assert_eq!((&points["inside"], points.get("grid")), (&json!([false, true]), None));

    let before = fs::read_dir(folder.path()).unwrap().count();
    fs::write(folder.path().join("points.txt"), "1 2\n").unwrap();
    for (arguments, words) in [
        (&["--probes", "0.001"][..], "give --probes"),
        (&["--probe-points", "points.txt"][..], "line 1: must be three numbers"),
    ] {
        let answer = solve(&[&["-o", "no.glb"], arguments].concat());
        let said = String::from_utf8(answer.stderr).unwrap();
        assert!(!answer.status.success() && said.contains(words), "{said}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), before, "files were left behind");
}
