//! The scenes that this repository makes itself.

use std::fs;

use bake::{BakeSettings, RowStrategy};
use glam::DVec3;
use gltf::Gltf;
use scene::{ImportOptions, ReadOptions};
use tests::measured::{Measured, measured, measured_as};
use tests::{data, scenes};
use verify::plain::PlainScene;
use verify::score::check_reference;

/// The sky that the house's reference was made with.
const SKY: DVec3 = DVec3::new(1.0, 1.25, 1.6);

/// The score must be within these limits: relative L2, 95th percentile, difference of the energy.
fn assert_score(Measured { score, report }: Measured, relative_l2: f64, p95: f64, energy: f64) {
    println!("{score:?}, {:?}", report.error);
    assert_eq!((score.uncovered, score.not_finite), (0, 0), "{score:?}");
    assert!(score.relative_l2 <= relative_l2, "{score:?}");
    assert!(score.p95 <= p95, "{score:?}");
    assert!((score.energy_ratio - 1.0).abs() <= energy, "{score:?}");
}

#[test]
fn a_textured_cornell_box_agrees_with_its_reference() {
    assert_score(measured("cornell-textured", &BakeSettings::for_error(0.03)), 0.025, 0.06, 0.005);
}

/// Lace, and a jar of half-transparent glass, pass on by rays what they do not let through.
#[test]
fn a_textured_cornell_box_keeps_its_light_where_it_is_gathered() {
    let settings = BakeSettings { rows: RowStrategy::Gather, ..BakeSettings::for_error(0.03) };
    let Measured { score, report } = measured("cornell-textured", &settings);
    assert!((score.energy_ratio - 1.0).abs() <= 0.005, "{score:?}");
    let imbalance = report.balance.relative_imbalance();
    assert!(imbalance.abs() <= 0.003, "{imbalance}");
}

/// Most of its error lies in the strips along the edges of the sun's shadows: few points of the reference fall on them.
#[test]
fn a_house_in_the_sun_agrees_with_its_reference() {
    let settings = BakeSettings { mesh_error: 0.05, ..BakeSettings::default() };
    let options = ImportOptions { sky: SKY, ..ImportOptions::default() };
    assert_score(measured_as("house", &options, &settings), 0.07, 0.13, 0.01);
}

/// The pattern that the sun makes behind lace is finer than the mesh, and the reference itself knows single points to 4 % of the mean.
#[test]
fn a_furnished_room_agrees_with_its_reference() {
    assert_score(measured("room", &BakeSettings::for_error(0.1)), 0.12, 0.55, 0.04);
}

#[test]
fn files_are_what_the_generator_makes() {
    for scene in scenes::all() {
        let file = fs::read(data(&format!("scenes/{}.glb", scene.name))).unwrap();
        assert!(
            file == scene.glb,
            "{} has changed: run `cargo run --release -p tests --example scenes`",
            scene.name
        );
    }
}

/// Triangles counted where they stand, pictures, lights and cameras.
#[test]
fn scenes_hold_what_they_are_for() {
    let expected = [("room", 70_000, 6, 4, 3), ("house", 2_000, 3, 1, 4), ("cornell-textured", 100, 5, 1, 2)];
    for ((name, triangles, pictures, lights, cameras), made) in expected.into_iter().zip(scenes::all()) {
        assert_eq!(name, made.name);
        let scene = PlainScene::open(&data(&format!("scenes/{name}.glb"))).unwrap();
        assert!(scene.triangles.len() >= triangles, "{name}: {} triangles", scene.triangles.len());
        assert_eq!(scene.lights.len(), lights, "{name}");
        assert!(scene.appearances.iter().flatten().count() > 0, "{name} has no textures");
        let document = Gltf::from_slice(&made.glb).unwrap();
        assert_eq!((document.images().len(), document.cameras().len()), (pictures, cameras), "{name}");
        assert!(document.nodes().all(|node| node.name().is_some()), "{name} has a node without a name");
    }
}

#[test]
fn references_were_made_of_these_scenes() {
    for name in ["room", "house", "cornell-textured"] {
        let reference = data(&format!("references/{name}.reference.csv"));
        check_reference(&reference, &data(&format!("scenes/{name}.glb")), &ReadOptions::default()).unwrap();
    }
}
