//! The scenes that this repository makes itself.

use std::fs;

use coordinator::plain::PlainScene;
use coordinator::score::check_reference;
use gltf::Gltf;
use tests::{data, scenes};

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

/// That of the house under `--sky 1.0,1.25,1.6`.
#[test]
fn references_were_made_of_these_scenes() {
    for name in ["house", "cornell-textured"] {
        let reference = data(&format!("references/{name}.reference.csv"));
        check_reference(&reference, &data(&format!("scenes/{name}.glb"))).unwrap();
    }
}
