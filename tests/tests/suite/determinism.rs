//! The same file comes out, bit for bit, whoever computes the rows and however often.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use glam::{DMat4, DVec3};
use serde_json::{Value, json};
use tests::builder::{Material, SceneBuilder};
use tests::data;
use tests::programs::{WorkerProcess, binary};
use tests::shapes;

/// The lit file that the `coordinator` binary makes of a scene, and its report.
fn solve(scene: &Path, folder: &Path, arguments: &[&str]) -> (Vec<u8>, Value) {
    let (output, report) = (folder.join("lit.glb"), folder.join("report.json"));
    Command::new(binary("coordinator"))
        .arg("solve")
        .arg(scene)
        .arg("-o")
        .arg(&output)
        .arg("--report")
        .arg(&report)
        .args(arguments)
        .assert()
        .success();
    let bytes = fs::read(&output).unwrap();
    fs::remove_file(&output).unwrap();
    (bytes, serde_json::from_slice(&fs::read(&report).unwrap()).unwrap())
}

/// Bakes a scene in all ways that there are, with these settings; gives one of the reports.
fn assert_deterministic(scene: &Path, knobs: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let solve = |arguments: &[&str]| solve(scene, folder.path(), &[knobs, arguments].concat());
    let (expected, report) = solve(&["--threads", "2"]);
    assert!(solve(&["--threads", "1"]).0 == expected, "one thread differs from two");
    let workers = [1, 1, 1, 2].map(WorkerProcess::start);
    let addresses = workers.each_ref().map(|worker| worker.address.as_str()).join(",");
    let (remote, remote_report) = solve(&["--workers", &addresses]);
    assert!(remote == expected, "remote workers differ from embedded ones");
    let periodic = ["--workers", &addresses, "--schedule", "periodic", "--period-ms", "5"];
    assert!(solve(&periodic).0 == expected, "sending jobs by a timer makes a difference");
    let jobs: Vec<u64> = remote_report["workers"]
        .as_array()
        .unwrap()
        .iter()
        .map(|worker| worker["jobs"].as_u64().unwrap())
        .collect();
    assert!(jobs.len() == 4 && jobs.iter().all(|jobs| *jobs > 0), "jobs of the workers: {jobs:?}");
    report
}

/// Later rounds' rows count as much as the first's.
fn assert_refined(report: &Value) {
    assert!(report["bake"]["refinement_rounds"].as_u64().unwrap() > 0, "{}", report["bake"]);
}

#[test]
fn area_light() {
    assert_refined(&assert_deterministic(&data("scenes/cornell.glb"), &["--error", "0.05"]));
}

#[test]
fn point_light() {
    assert_refined(&assert_deterministic(&data("scenes/table.glb"), &["--error", "0.05"]));
}

/// Whether rows are kept or made again makes no difference, and what is said of the bake is what the scene needed.
#[test]
fn row_cache() {
    let folder = tempfile::tempdir().unwrap();
    let with = |cache: &[&str]| {
        let knobs = ["--mesh-error", "0.05", "--shooter-edge", "0.16", "--threads", "2"];
        solve(&data("scenes/doorway.glb"), folder.path(), &[&knobs, cache].concat())
    };
    let (expected, report) = with(&[]);
    assert_eq!(report["bake"]["rows_again"], 0, "the default keeps all rows");
    let all = report["bake"]["row_bytes"].as_u64().unwrap();
    assert!((2 << 20..=3 << 20).contains(&all), "{all} bytes of rows");
    // None of the rows, and a third to a half of them.
    for mebibytes in [0, 1] {
        let (same, report_with_less) = with(&["--row-cache", &mebibytes.to_string()]);
        assert!(same == expected, "a row cache of {mebibytes} MiB makes a difference");
        let bake = &report_with_less["bake"];
        assert!(bake["rows_again"].as_u64().unwrap() > bake["rows"].as_u64().unwrap(), "{bake}");
        let kept = bake["row_bytes"].as_u64().unwrap();
        assert!(kept <= mebibytes << 20 && kept >= (mebibytes << 20) * 9 / 10, "{kept} bytes are kept");
        for figure in ["rows", "model", "factors", "rays", "error", "balance", "row_sums", "warnings"] {
            assert_eq!(bake[figure], report["bake"][figure], "{figure}");
        }
    }
}

/// Under a grille the shafts are so crowded that rays decide visibility: their seeds must not depend on who casts them.
#[test]
fn sampled_visibility() {
    let slats = (0..16).flat_map(|i| {
        let x = f64::from(i) / 16.0;
        shapes::box_facing_out(DVec3::new(x, 0.02, 0.6), DVec3::new(x + 0.02, 0.98, 0.61))
    });
    let glb = SceneBuilder::new()
        .part("room", &shapes::unit_room(), Material::grey(0.6).emitting(0.1))
        .part("grille", &slats.collect::<Vec<_>>(), Material::grey(0.4))
        .point_light(DVec3::new(0.4, 0.5, 0.9), 1.0)
        .glb();
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("grille.glb");
    fs::write(&scene, glb).unwrap();
    let knobs = ["--mesh-error", "0.2", "--shooter-edge", "0.3", "--rays", "256", "--exact-occluders", "8"];
    let report = assert_deterministic(&scene, &knobs);
    assert!(report["bake"]["model"]["pairs_sampled"].as_u64().unwrap() > 1000, "{}", report["bake"]);
}

/// Their shapes travel to the workers as those of other lights.
#[test]
fn spot_light_sun_and_sky() {
    let mut yard = shapes::unit_room();
    yard.retain(|wall| wall.iter().any(|corner| corner.y < 1.0));
    let shining = |x: f64| DMat4::from_translation(DVec3::new(x, 0.9, 0.5)) * DMat4::from_rotation_x(-1.3);
    let glb = SceneBuilder::new()
        .part("yard", &yard, Material::grey(0.6))
        .part("block", &shapes::box_facing_out(DVec3::splat(0.3), DVec3::splat(0.6)), Material::grey(0.4))
        .light(json!({ "type": "spot", "intensity": 2.0, "spot": { "outerConeAngle": 0.6 } }), shining(0.2))
        .light(json!({ "type": "directional", "intensity": 3.0 }), shining(0.0))
        .glb();
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("yard.glb");
    fs::write(&scene, glb).unwrap();
    // Enough jobs for each of the workers.
    let knobs = ["--mesh-error", "0.05", "--shooter-edge", "0.25", "--sky", "1,1.2,1.5"];
    let model = &assert_deterministic(&scene, &knobs)["bake"]["model"];
    assert_eq!((&model["spot_lights"], &model["directional_lights"]), (&1.into(), &1.into()), "{model}");
    assert!(model["sky"].as_u64().unwrap() > 0, "{model}");
    // By rays the sky is one shooter.
    let model = &assert_deterministic(&scene, &[&knobs[..], &["--rows", "gather"]].concat())["bake"]["model"];
    assert_eq!(model["sky"], 1, "{model}");
}
