//! Layers in one plane: one of them is seen.

use super::*;

/// Layers at z = 0 over one another, lit from above.
fn layers(materials: &[PlainMaterial]) -> PlainScene {
    let mut scene = PlainScene::default();
    materials.iter().for_each(|material| square(&mut scene, *material, 0.0, 1.0));
    scene
}

/// Which layer points are on, where all are on one.
fn seen(materials: &[PlainMaterial]) -> Option<usize> {
    let scene = layers(materials);
    let places = random(&scene, 20, 1).unwrap();
    let primitive = places[0].primitive;
    places.iter().all(|place| place.primitive == primitive).then_some(primitive)
}

#[test]
fn points_are_on_the_layer_that_is_seen() {
    let (dark, bright, lamp) = (grey(0.2, 0.0), grey(0.8, 0.0), grey(0.5, 1.0));
    let glass = PlainMaterial { opacity: 0.5, ..lamp };
    assert_eq!(seen(&[dark, bright]), Some(0));
    assert_eq!(seen(&[bright, dark, dark]), Some(0));
    assert_eq!(seen(&[dark, lamp]), Some(1));
    assert_eq!(seen(&[glass, dark]), Some(1));
    assert_eq!(seen(&[glass, glass]), Some(0));
    let hidden = random(&layers(&[grey(0.0, 0.0), bright]), 20, 1);
    assert!(matches!(hidden, Err(ReferenceError::Hidden { places: 0, tries: 2000 })));
}

#[test]
fn both_sides_of_a_double_sided_layer_have_points() {
    let under = PlainMaterial { double_sided: true, ..grey(0.8, 0.0) };
    let places = random(&layers(&[grey(0.2, 0.0), under]), 200, 1).unwrap();
    // From below, the first is seen from its back and the second is seen.
    assert!(places.iter().all(|place| (place.normal.z > 0.0) == (place.primitive == 0)));
    assert!((0..2).all(|primitive| places.iter().any(|place| place.primitive == primitive)));
}

#[test]
fn layers_that_are_not_seen_change_no_light() {
    let mut scene = room(grey(0.5, 1.0));
    let edges = [DVec3::X, DVec3::Y];
    add(&mut scene, grey(0.9, 0.0), DVec3::ZERO, edges);
    add(&mut scene, grey(0.9, 4.0), DVec3::new(0.0, 0.0, 1e-8), edges);
    let points = traced(&scene, &random(&scene, 50, 3).unwrap(), 512);
    assert_agrees(&points, |_| 2.0);
}
