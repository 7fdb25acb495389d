use bake::BakeSettings;
use glam::{DMat4, DVec3};
use tests::baking::{baked, imported, mean_irradiance, vertices_of};
use tests::builder::{Material, SceneBuilder};
use tests::shapes::{box_facing_in, box_facing_out};

const LOW: DVec3 = DVec3::new(0.4, 0.3, 0.45);
const HIGH: DVec3 = DVec3::new(0.7, 0.6, 0.7);

/// A bright room around a closed box: its inside is surface 1, its outside surface 2.
fn room_with_box(thickness: f64) -> SceneBuilder {
    let grey = Material::grey(0.6);
    SceneBuilder::new()
        .part("room", &box_facing_in(DVec3::ZERO, DVec3::ONE), grey.emitting(10.0))
        .part("inside", &box_facing_in(LOW, HIGH), grey)
        .part("outside", &box_facing_out(LOW - thickness, HIGH + thickness), grey.emitting(10.0))
}

fn settings() -> BakeSettings {
    BakeSettings { shooter_edge: 0.3, mesh_error: 0.1, validation_samples: 0, ..BakeSettings::default() }
}

/// Walls of 10 cm, of a millimetre, of a hundredth of one, and sheets of no thickness; in metres, millimetres and kilometres.
#[test]
fn closed_boxes_are_dark_inside() {
    for scale in [1.0, 1e-3, 1e3] {
        for thickness in [0.1, 1e-3, 1e-5, 0.0] {
            let room = room_with_box(thickness).all_placed(DMat4::from_scale(DVec3::splat(scale)));
            let scene = imported(&room.glb());
            let result = baked(&scene, &settings());
            for vertex in vertices_of(&result.lit, 1) {
                let place = scene.frame.to_world(vertex.position) / scale;
                let light = vertex.irradiance;
                assert_eq!(light, DVec3::ZERO, "at {place}, walls of {thickness}, scale {scale}");
            }
            // A furnace: E = M / (1 - rho).
            let outside = mean_irradiance(&result.lit, 2).x;
            assert!((outside / 25.0 - 1.0).abs() < 0.03, "{outside}, walls of {thickness}, scale {scale}");
        }
    }
}

#[test]
fn triangles_are_as_short_as_asked() {
    for scale in [1.0, 1e-3] {
        let scene = imported(&room_with_box(0.1).all_placed(DMat4::from_scale(DVec3::splat(scale))).glb());
        let result = baked(&scene, &BakeSettings { max_edge: Some(0.2 * scale), ..settings() });
        for triangle in result.lit.surfaces.iter().flatten() {
            let [a, b, c] = triangle
                .vertices
                .map(|vertex| scene.frame.to_world(result.lit.vertices[vertex as usize].position));
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            assert!(longest <= 0.2 * scale * (1.0 + 1e-9), "{longest} at scale {scale}");
        }
    }
}

#[test]
fn scale_does_not_show() {
    let scales = [1.0, 1e-3, 1e3].map(|scale| {
        let room = room_with_box(1e-3).all_placed(DMat4::from_scale(DVec3::splat(scale)));
        let result = baked(&imported(&room.glb()), &settings());
        [0, 2].map(|surface| mean_irradiance(&result.lit, surface).x)
    });
    for scaled in &scales[1..] {
        for (found, expected) in scaled.iter().zip(&scales[0]) {
            assert!((found / expected - 1.0).abs() < 1e-3, "{found} for {expected}");
        }
    }
}
