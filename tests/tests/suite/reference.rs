//! References made here against those of an outside renderer, and the command that makes them.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use serde_json::Value;
use tests::builder::{Material, SceneBuilder, pack};
use tests::data;
use tests::programs::binary;
use tests::scene_command::SceneCommand;
use tests::shapes;
use verify::plain::PlainScene;
use verify::reference::{Agreement, Place, ReferenceSettings, locate, read, trace};

/// Some points of the given reference, each by as many paths as the command has by default: with fewer the rare bright paths of
/// the room behind the door make its errors too skewed to count in standard errors.
fn assert_agrees(name: &str) {
    let scene = PlainScene::open(&data(&format!("scenes/{name}.glb"))).unwrap();
    let given = read(&data(&format!("references/{name}.reference.csv"))).unwrap();
    let given: Vec<_> = given.into_iter().step_by(20).collect();
    let places: Vec<Place> = given.iter().map(|point| point.place).collect();
    let places: Vec<Place> = locate(&scene, &places).into_iter().map(Option::unwrap).collect();
    let settings = ReferenceSettings { threads: 2, ..ReferenceSettings::default() };
    let traced = trace(&scene, &places, &settings, &|| ()).unwrap();
    let agreement = Agreement::of(&traced, &given);
    assert!(agreement.within_3_sigma >= 0.99, "{agreement:?}");
    // Three standard errors of a mean over as many independent values as there are points: channels go together.
    assert!(agreement.mean_sigma.abs() <= 3.0 / (traced.len() as f64).sqrt(), "{agreement:?}");
    assert!((0.9..1.1).contains(&agreement.rms_sigma), "{agreement:?}");
    assert!((agreement.energy_ratio - 1.0).abs() <= 3.0 * agreement.energy_ratio_error, "{agreement:?}");
    assert!(agreement.energy_ratio_error < 0.003, "{agreement:?}");
}

#[test]
fn cornell_agrees_with_the_outside_renderer() {
    assert_agrees("cornell");
}

#[test]
fn table_agrees_with_the_outside_renderer() {
    assert_agrees("table");
}

#[test]
fn doorway_agrees_with_the_outside_renderer() {
    assert_agrees("doorway");
}

fn bench_of(glb: &[u8]) -> SceneCommand {
    SceneCommand::new("reference", glb)
}

fn furnace() -> SceneBuilder {
    SceneBuilder::new().part("walls", &shapes::unit_room(), Material::grey(0.5).emitting(1.0))
}

#[test]
fn command_writes_the_same_file_on_any_number_of_threads() {
    let bench = bench_of(&furnace().glb());
    let few = ["--points", "50", "--paths", "64"];
    for (name, more) in [("one.csv", "1"), ("three.csv", "3")] {
        bench.command(&bench.path(name), &[&few[..], &["--threads", more]].concat()).assert().success();
    }
    let text = fs::read_to_string(bench.path("one.csv")).unwrap();
    assert_eq!(text, fs::read_to_string(bench.path("three.csv")).unwrap());
    let given = fs::read_to_string(data("references/cornell.reference.csv")).unwrap();
    assert_eq!((text.lines().next(), text.lines().count()), (given.lines().next(), 51));
    let output =
        bench.command(&bench.path("seed.csv"), &[&few[..], &["--seed", "2"]].concat()).output().unwrap();
    assert_ne!(text, fs::read_to_string(bench.path("seed.csv")).unwrap());
    let figures: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&figures["points"], &figures["paths"]), (&50.into(), &64.into()));
    assert!((0.001..0.1).contains(&figures["relative_standard_error"].as_f64().unwrap()), "{figures}");
}

/// A room of constant radiosity that was baked, against a reference of it: only the noise of the reference is left.
#[test]
fn bake_can_be_compared_with_what_the_command_writes() {
    let bench = bench_of(&furnace().glb());
    let [lit, csv] = ["lit.glb", "reference.csv"].map(|name| bench.path(name));
    bench.command(&csv, &["--points", "200", "--paths", "256"]).assert().success();
    let coordinator = || Command::new(binary("coordinator"));
    let mut solve = coordinator();
    solve.arg("solve").arg(&bench.scene).arg("-o").arg(&lit).args(["--mesh-error", "0.005"]);
    solve.assert().success();
    let mut compare = coordinator();
    compare.arg("compare").arg(&lit).arg("--reference").arg(&csv).arg("--scene").arg(&bench.scene);
    let score: Value = serde_json::from_slice(&compare.output().unwrap().stdout).unwrap();
    assert_eq!((&score["uncovered"], &score["not_finite"]), (&0.into(), &0.into()));
    assert!((score["energy_ratio"].as_f64().unwrap() - 1.0).abs() < 0.005, "{score}");
    assert!(score["relative_l2"].as_f64().unwrap() < 0.01, "{score}");
    assert!((0.001..0.1).contains(&score["reference_noise"].as_f64().unwrap()), "{score}");
}

#[test]
fn points_of_another_reference_can_be_traced() {
    let bench = bench_of(&furnace().glb());
    let first = bench.path("first.csv");
    bench.command(&first, &["--points", "100", "--paths", "128"]).assert().success();
    let at = first.display().to_string();
    let again = bench.path("again.csv");
    let output = bench.command(&again, &["--at", &at, "--paths", "128", "--seed", "9"]).output().unwrap();
    let figures: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(figures["agreement"]["within_3_sigma"].as_f64().unwrap() >= 0.98, "{figures}");
    let places =
        |path: &Path| -> Vec<Place> { read(path).unwrap().iter().map(|point| point.place).collect() };
    for (first, again) in places(&first).iter().zip(places(&again)) {
        assert!(first.position.abs_diff_eq(again.position, 1e-6) && first.primitive == again.primitive);
    }
    let cornell = data("references/cornell.reference.csv").display().to_string();
    bench.assert_refused(
        &bench.path("no.csv"),
        &["--at", &cornell],
        &["point 1 of", "use the scene of the reference"],
    );
    bench.assert_refused(&first, &["--at", &at], &["is the other reference itself", "choose another output"]);
    let scene = bench.scene.display().to_string();
    bench.assert_refused(&bench.path("no.csv"), &["--at", &scene], &["scene.glb"]);
}

#[test]
fn numbers_that_make_no_reference_are_refused() {
    let bench = bench_of(&furnace().glb());
    let output = bench.path("no.csv");
    bench.assert_refused(&output, &["--points", "0"], &["--points", "must be a whole number from 1"]);
    bench.assert_refused(&output, &["--paths", "0"], &["--paths", "0 is not in 1..=2097152"]);
    bench.assert_refused(&output, &["--paths", "many"], &["--paths", "invalid digit"]);
}

#[test]
fn output_that_cannot_be_written_is_refused_before_the_work() {
    let bench = bench_of(b"no scene at all");
    let nowhere = bench.path("nowhere/reference.csv");
    bench.assert_refused(&nowhere, &[], &["nowhere", "does not exist", "create it"]);
    bench.assert_refused(bench.folder.path(), &[], &["is a directory", "name a file"]);
    bench.assert_refused(&bench.scene, &[], &["is the scene itself", "choose another output"]);
}

#[test]
fn scenes_that_make_no_reference_are_refused() {
    let room = |material| bench_of(&SceneBuilder::new().part("walls", &shapes::unit_room(), material).glb());
    let refused =
        |bench: &SceneCommand, words: &[&str]| bench.assert_refused(&bench.path("no.csv"), &[], words);
    refused(
        &room(Material::grey(0.0).emitting(1.0)),
        &["scene.glb", "no surface that reflects", "base colour"],
    );
    refused(&room(Material::grey(0.5)), &["scene.glb", "no light", "emissiveFactor"]);
    refused(&bench_of(b"no scene at all"), &["scene.glb", "is not a glTF"]);
    let missing = SceneCommand { scene: PathBuf::from("missing.glb"), ..room(Material::grey(0.5)) };
    refused(&missing, &["missing.glb: cannot be read"]);
    let (mut document, binary) = furnace().document();
    document["accessors"][0]["count"] = 1_000_000.into();
    refused(&bench_of(&pack(&document, &binary)), &["POSITION of node walls", "cannot be read"]);
}
