//! The scenes of the repository.

use std::path::PathBuf;

use glam::DVec3;

use crate::import::{ImportOptions, import};
use crate::model::Scene;

fn scene(name: &str) -> Scene {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/scenes").join(name);
    import(&path, &ImportOptions::default()).unwrap()
}

/// Name and facets of every surface, and the number of corners over all.
fn facet_counts(scene: &Scene) -> Vec<(&str, usize)> {
    scene.surfaces.iter().map(|surface| (surface.name.as_str(), surface.facets.len())).collect()
}

#[test]
fn cornell_box_has_a_facet_per_side() {
    let scene = scene("cornell.glb");
    let counts = facet_counts(&scene).into_iter().map(|(_, facets)| facets).collect::<Vec<_>>();
    assert_eq!(counts, [1, 1, 1, 1, 1, 1, 1, 6, 6]);
    assert_eq!(scene.surfaces[7].name, "node \"short\", primitive 0");
    for facet in scene.surfaces.iter().flat_map(|surface| &surface.facets) {
        assert_eq!((facet.corners.len(), facet.triangles.len()), (4, 2));
    }
    // Six walls, the lamp, and the boxes: their bottoms lie in the floor's plane.
    assert_eq!(scene.plane_count, 6 + 1 + 5 + 5);
    assert_eq!((scene.degenerate_triangles, scene.warnings.len()), (0, 0));
}

#[test]
fn cornell_box_has_its_reflectances_and_exitance() {
    let scene = scene("cornell.glb");
    let close = |a: DVec3, b: DVec3| assert!((a - b).abs().max_element() < 1e-6 * b.max_element(), "{a} {b}");
    close(scene.surfaces[4].reflectance, DVec3::new(0.63, 0.065, 0.05));
    assert_eq!(scene.surfaces[6].reflectance, DVec3::ZERO);
    close(scene.surfaces[6].exitance, std::f64::consts::PI * DVec3::new(17.0, 12.0, 4.0));
    assert!(
        scene.surfaces.iter().all(|surface| surface.name.contains("lamp") || surface.exitance == DVec3::ZERO)
    );
}

#[test]
fn table_has_a_point_light_where_its_node_is() {
    let scene = scene("table.glb");
    assert_eq!(scene.lights.len(), 1);
    let light = &scene.lights[0];
    let world = scene.frame.to_world(light.kind.position().unwrap());
    assert!(world.distance(DVec3::new(3.0, 2.2, 2.5)) < 1e-6, "{world}");
    assert!(light.intensity.min_element() > 0.0);
    assert_eq!(light.name, "node \"light11\"");
    assert!(facet_counts(&scene).iter().all(|&(_, facets)| facets == 1 || facets == 6));
}

#[test]
fn doorway_has_boxes_of_six_facets() {
    let scene = scene("doorway.glb");
    let counts = facet_counts(&scene).into_iter().map(|(_, facets)| facets).collect::<Vec<_>>();
    assert_eq!(counts, [1, 1, 1, 1, 1, 1, 6, 6, 6, 1]);
}
