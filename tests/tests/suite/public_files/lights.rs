use std::f64::consts::{FRAC_PI_6, PI, TAU};

use bake::BakeSettings;
use glam::DVec3;
use serde_json::{Value, json};
use tests::baking::{area_and_flux, baked, imported, mean_irradiance};
use tests::builder::{Material, SceneBuilder, pack};
use tests::shapes::{box_facing_in, box_facing_out};

/// A lamp on a bent arm: a spot light that hangs below turned and scaled nodes, and a bulb beside it. Where they stand and shine is the
/// nodes' matter, how bright they are is not, and each has its colour.
#[test]
fn lamp_at_the_end_of_an_arm() {
    let floor = vec![
        DVec3::new(-8.0, 0.0, -8.0),
        DVec3::new(-8.0, 0.0, 8.0),
        DVec3::new(8.0, 0.0, 8.0),
        DVec3::new(8.0, 0.0, -8.0),
    ];
    let (mut document, binary) = SceneBuilder::new().part("floor", &[floor], Material::grey(1e-6)).document();
    let nodes = document["nodes"].as_array_mut().unwrap();
    // The base stands at (1, 0, 1), twice as large; the arm leans by 30 degrees about z; the head turns back and looks down.
    let (sine, cosine) = (FRAC_PI_6 / 2.0).sin_cos();
    let half = 0.5_f64.sqrt();
    nodes.push(json!({ "translation": [1, 0, 1], "scale": [2, 2, 2], "children": [2] }));
    nodes.push(json!({ "rotation": [0, 0, sine, cosine], "children": [3] }));
    nodes.push(json!({ "translation": [0, 2, 0], "rotation": [0, 0, -sine, cosine], "children": [4, 5] }));
    nodes.push(
        json!({ "rotation": [-half, 0, 0, half], "extensions": { "KHR_lights_punctual": { "light": 0 } } }),
    );
    nodes.push(json!({ "extensions": { "KHR_lights_punctual": { "light": 1 } } }));
    document["scenes"] = json!([{ "nodes": [0, 1] }]);
    document["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    let cone = json!({ "innerConeAngle": 0.4, "outerConeAngle": 0.5 });
    document["extensions"] = json!({ "KHR_lights_punctual": { "lights": [
        { "type": "spot", "intensity": 60.0, "color": [1.0, 0.5, 0.0], "spot": cone },
        { "type": "point", "intensity": 8.0, "color": [0.0, 0.0, 1.0] },
    ] } });
    let scene = imported(&pack(&document, &binary));
    let settings = BakeSettings { mesh_error: 0.002, factor_rounding: 0.0, ..BakeSettings::default() };
    let lit = baked(&scene, &settings).lit;

    let head = DVec3::new(1.0 - 4.0 * FRAC_PI_6.sin(), 4.0 * FRAC_PI_6.cos(), 1.0);
    let mut brightest = (0.0, DVec3::ZERO);
    for vertex in &lit.vertices {
        let place = scene.frame.to_world(vertex.position);
        let span = place - head;
        let cosine = -span.normalize().y;
        // Vertices have the values that interpolate best, not those at their place.
        let blue = 8.0 * cosine / span.length_squared();
        assert!(
            (vertex.irradiance.z / blue - 1.0).abs() < 0.03,
            "{} for {blue} at {place}",
            vertex.irradiance
        );
        if cosine < 0.65_f64.cos() {
            assert!(vertex.irradiance.x < 1e-3 * 60.0 / head.y.powi(2), "{} at {place}", vertex.irradiance);
        }
        if vertex.irradiance.x > brightest.0 {
            brightest = (vertex.irradiance.x, place);
        }
    }
    assert!(brightest.1.distance(DVec3::new(head.x, 0.0, head.z)) < 0.5, "brightest at {}", brightest.1);
    let flux = area_and_flux(&lit, 0, |_| true).1 * scene.frame.scale.powi(2);
    let (inner, outer) = (0.4_f64.cos(), 0.5_f64.cos());
    let expected = 60.0 * TAU * (1.0 - inner + (inner - outer) / 3.0);
    assert!((flux.x / expected - 1.0).abs() < 0.005, "{flux} for {expected}");
    assert!((flux.y / flux.x - 0.5).abs() < 1e-6, "{flux}");
}

/// Five cubes of strengths 1, 2, 4, 8 and 16, each in a room of its own: the rooms are as bright as these numbers.
#[test]
fn emissive_strengths_are_in_proportion() {
    let strengths = [1.0, 2.0, 4.0, 8.0, 16.0];
    let mut builder = SceneBuilder::new();
    for index in 0..strengths.len() {
        let place = DVec3::X * 3.0 * index as f64;
        let room = box_facing_in(place - DVec3::ONE, place + DVec3::ONE);
        let cube = box_facing_out(place - DVec3::splat(0.2), place + DVec3::splat(0.2));
        builder = builder.part("room", &room, Material::grey(0.5)).part(
            "cube",
            &cube,
            Material::grey(0.1).emitting(1.0),
        );
    }
    let (mut document, binary) = builder.document();
    for (index, strength) in strengths.into_iter().enumerate() {
        let material = &mut document["materials"][2 * index + 1];
        material["emissiveFactor"] = json!([0.1, 0.5, 0.9]);
        material["extensions"] = match strength {
            // As in the test itself: the first has no strength at all.
            1.0 => Value::Null,
            _ => json!({ "KHR_materials_emissive_strength": { "emissiveStrength": strength } }),
        };
        if strength == 1.0 {
            material.as_object_mut().unwrap().remove("extensions");
        }
    }
    let scene = imported(&pack(&document, &binary));
    // Without refinement, which would give dim rooms fewer vertices: all have the same mesh.
    let settings = BakeSettings {
        mesh_error: 1e3,
        validation_samples: 0,
        factor_rounding: 0.0,
        ..BakeSettings::default()
    };
    let baked = baked(&scene, &settings);
    let first = mean_irradiance(&baked.lit, 0);
    let ratios = first / first.x;
    assert!((ratios - DVec3::new(1.0, 5.0, 9.0)).abs().max_element() < 1e-4, "{ratios}");
    let cube = 6.0 * 0.4 * 0.4 * PI * 0.1;
    let emitted = baked.report.balance.emitted[0];
    assert!((emitted / (31.0 * cube) - 1.0).abs() < 1e-6, "{emitted} for {}", 31.0 * cube);
    for (index, strength) in strengths.into_iter().enumerate() {
        let found = mean_irradiance(&baked.lit, 2 * index) / first;
        // The solution ends when a millionth of the light is missing, of all of it.
        assert!(
            (found / strength - 1.0).abs().max_element() < 1e-4,
            "{found} times as bright for {strength}"
        );
    }
}
