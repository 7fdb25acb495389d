//! Scenes lit otherwise against bakes of the changed scenes.

use std::fs;

use assert_cmd::Command;
use bake::lit::LitMesh;
use bake::{
    BakeSettings, Baked, KeptLight, LightChange, LightPart, NewLight, RelightError, RowStrategy, relight,
};
use glam::DVec3;
use scene::{ImportOptions, import};
use tests::baking::{baked, mean_irradiance};
use tests::data;
use tests::programs::binary;

use super::layers::{SKY, court, groups};

/// On one and the same mesh: nothing is refined, and no vertex dropped.
fn unrefined(rows: RowStrategy) -> BakeSettings {
    BakeSettings {
        shooter_edge: 0.25,
        mesh_error: 10.0,
        threshold: 1e-9,
        validation_samples: 64,
        rays_per_hemisphere: 256,
        keep_light: Some(u64::MAX),
        simplify: false,
        rows,
        ..BakeSettings::default()
    }
}

fn refined() -> BakeSettings {
    BakeSettings {
        mesh_error: 0.02,
        threshold: 1e-6,
        validation_samples: 256,
        ..unrefined(RowStrategy::Exact)
    }
}

fn change(light: &str, factor: [f64; 3]) -> LightChange {
    LightChange { light: light.into(), factor: factor.into() }
}

/// Half of the lamp, three times the panel, a redder sky.
fn other_light() -> NewLight {
    let changes = vec![change("lamp", [0.5; 3]), change("panel", [3.0; 3])];
    NewLight { changes, sky: Some(OTHER_SKY), ..NewLight::default() }
}

const OTHER_SKY: DVec3 = DVec3::new(1.0, 0.2, 0.0);

/// The largest difference of irradiance at a vertex, relative to the mean of all.
fn difference(one: &LitMesh, other: &LitMesh) -> f64 {
    assert_eq!(one.vertices.len(), other.vertices.len());
    let mean = other.vertices.iter().map(|v| v.irradiance.element_sum()).sum::<f64>();
    let pairs = one.vertices.iter().zip(&other.vertices);
    let largest = pairs.map(|(a, b)| (a.irradiance - b.irradiance).abs().max_element()).fold(0.0, f64::max);
    largest / (mean / 3.0 / other.vertices.len() as f64)
}

fn kept(baked: &Baked) -> &KeptLight {
    baked.kept.as_ref().expect("light that was to be kept")
}

#[test]
fn on_the_same_mesh_it_is_the_bake_of_the_changed_scene() {
    for rows in [RowStrategy::Exact, RowStrategy::Gather] {
        let scene = court(1.0, 1.0, 1.0, SKY);
        let before = baked(&scene, &unrefined(rows));
        let same = relight(&scene, kept(&before), &NewLight::default()).unwrap();
        assert!(difference(&same.lit, &before.lit) < 2e-6, "{rows:?}");
        let fresh = baked(&court(0.5, 3.0, 1.0, OTHER_SKY), &unrefined(rows));
        let relit = relight(&scene, kept(&before), &other_light()).unwrap();
        assert!(
            difference(&relit.lit, &fresh.lit) < 2e-6,
            "{rows:?}: {}",
            difference(&relit.lit, &fresh.lit)
        );
        assert!(difference(&relit.lit, &before.lit) > 0.1);
        // What the output shows of its lights.
        assert_eq!(relit.scene.sky, OTHER_SKY);
        assert_eq!(relit.report.warnings, Vec::<String>::new());
    }
}

#[test]
fn shadow_lines_of_the_error_asked_are_found_again() {
    let scene = import(&data("scenes/table.glb"), &ImportOptions::default()).unwrap();
    let settings = BakeSettings { keep_light: Some(u64::MAX), ..BakeSettings::for_error(0.05) };
    let before = baked(&scene, &settings);
    let same = relight(&scene, kept(&before), &NewLight::default()).unwrap();
    assert!(difference(&same.lit, &before.lit) < 1e-4);
}

#[test]
fn with_one_light_nothing_is_solved_for_and_all_is_scaled() {
    let scene = court(1.0, 0.0, 0.0, DVec3::ZERO);
    let before = baked(&scene, &refined());
    let light = NewLight { changes: vec![change("lamp", [2.0, 0.5, 0.0])], ..NewLight::default() };
    let relit = relight(&scene, kept(&before), &light).unwrap();
    for (relit, before) in relit.lit.vertices.iter().zip(&before.lit.vertices) {
        let expected = before.irradiance * DVec3::new(2.0, 0.5, 0.0);
        assert!((relit.irradiance - expected).abs().max_element() <= 1e-6 * expected.max_element());
    }
    assert!((relit.report.error.total - before.report.error.total).abs() < 0.01);
}

#[test]
fn parts_and_groups_are_those_of_the_bake() {
    let scene = court(1.0, 1.0, 1.0, SKY);
    for only in [LightPart::Direct, LightPart::Indirect] {
        let settings = BakeSettings { only, groups: groups(), ..refined() };
        let before = baked(&scene, &settings);
        let light = NewLight { only, groups: groups(), ..NewLight::default() };
        let relit = relight(&scene, kept(&before), &light).unwrap();
        assert!(difference(&relit.lit, &before.lit) < 1e-4);
        for (relit, before) in relit.lit.layers.iter().zip(&before.lit.layers) {
            assert_eq!((&relit.name, &relit.lights), (&before.name, &before.lights));
            let largest = before.irradiance.iter().map(|light| light.max_element()).fold(0.0, f64::max);
            for (one, other) in relit.irradiance.iter().zip(&before.irradiance) {
                assert!((*one - *other).abs().max_element() < 1e-4 * largest, "{one} in place of {other}");
            }
        }
    }
}

#[test]
fn on_a_mesh_for_other_light_it_agrees_within_the_stated_error() {
    let scene = court(1.0, 1.0, 1.0, SKY);
    let before = baked(&scene, &refined());
    let relit = relight(&scene, kept(&before), &other_light()).unwrap();
    let exact = BakeSettings { shooter_edge: 0.12, mesh_error: 0.005, ..refined() };
    let fresh = baked(&court(0.5, 3.0, 1.0, OTHER_SKY), &exact);
    let (stated, of_fresh) = (relit.report.error.total, fresh.report.error.total);
    assert!(stated > 0.0 && stated < 0.2, "{stated}");
    for surface in 0..scene.surfaces.len() {
        let [one, other] = [&relit.lit, &fresh.lit].map(|lit| mean_irradiance(lit, surface).element_sum());
        let off = (one - other).abs() / other;
        assert!(off < stated + of_fresh, "{off} off on {}: {stated}", scene.surfaces[surface].name);
    }
}

#[test]
fn what_makes_no_sense_is_refused() {
    let scene = court(1.0, 1.0, 1.0, DVec3::ZERO);
    let before = baked(&scene, &unrefined(RowStrategy::Exact));
    let refused = |light: NewLight| relight(&scene, kept(&before), &light).map(|_| ()).unwrap_err();
    let changed =
        |light: &str, factor| NewLight { changes: vec![change(light, factor)], ..NewLight::default() };
    let error = refused(changed("lantern", [1.0; 3]));
    assert!(
        matches!(&error, RelightError::UnknownLight { .. }) && error.to_string().contains("lamp"),
        "{error}"
    );
    for factor in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(refused(changed("lamp", [1.0, factor, 1.0])), RelightError::Factor(_)));
    }
    let sky = NewLight { sky: Some(SKY), ..NewLight::default() };
    assert!(matches!(refused(sky), RelightError::NoSky));
    let other = court(1.0, 2.0, 1.0, DVec3::ZERO);
    let error = relight(&other, kept(&before), &NewLight::default()).map(|_| ()).unwrap_err();
    assert!(matches!(error, RelightError::OtherScene));
}

#[test]
fn a_file_is_what_was_kept_or_refused() {
    let scene = court(1.0, 1.0, 0.0, DVec3::ZERO);
    let before = baked(&scene, &unrefined(RowStrategy::Exact));
    let bytes = kept(&before).to_bytes();
    let read = KeptLight::from_bytes(&bytes).unwrap();
    assert_eq!(read.to_bytes(), bytes);
    let light = NewLight { changes: vec![change("lamp", [0.5, 1.0, 2.0])], ..NewLight::default() };
    let [one, other] = [&read, kept(&before)].map(|kept| relight(&scene, kept, &light).unwrap());
    assert_eq!(difference(&one.lit, &other.lit), 0.0);
    assert_eq!(one.report.error, other.report.error);
    for length in (0..bytes.len()).step_by(97) {
        assert!(KeptLight::from_bytes(&bytes[..length]).is_err(), "{length} bytes were taken");
    }
    for place in (0..bytes.len()).step_by(89) {
        let mut damaged = bytes.clone();
        damaged[place] ^= 0x20;
        assert!(KeptLight::from_bytes(&damaged).is_err(), "a change at {place} was not seen");
    }
}

#[test]
fn the_command_line_lights_a_baked_file_otherwise() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let scene = data("scenes/cornell.glb").to_str().unwrap().to_owned();
    let run = |arguments: &[&str]| Command::new(binary("coordinator")).args(arguments).assert();
    let (lit, relit, light, report) =
        (file("lit.glb"), file("relit.glb"), file("light"), file("report.json"));
    run(&["solve", &scene, "-o", &lit, "--keep-light", &light, "--mesh-error", "0.03"]).success();
    run(&["relight", &scene, "--kept", &light, "-o", &relit]).success();
    let change = ["--light", "lamp=0.5,0.4,0.3", "--report", &report];
    run(&[&["relight", &scene, "--kept", &light, "-o", &relit], &change[..]].concat()).success();
    let figures: serde_json::Value = serde_json::from_slice(&fs::read(&report).unwrap()).unwrap();
    assert!(figures["relight"]["error"]["total"].as_f64().unwrap() > 0.0);
    let wrong = run(&["relight", &scene, "--kept", &lit, "-o", &relit]).failure();
    assert!(String::from_utf8_lossy(&wrong.get_output().stderr).contains("no file of kept light"));
    let wrong = run(&["relight", &scene, "--kept", &light, "-o", &relit, "--light", "sun=1"]).failure();
    assert!(String::from_utf8_lossy(&wrong.get_output().stderr).contains("its lights are"));
}
