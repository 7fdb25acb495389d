//! What is kept of the input document, what is added, what goes.

use glam::DVec3;
use gltf::Semantic;
use gltf::json::extras::RawValue;
use serde_json::{Value, json};

use super::*;
use fixtures::{Builder, light, open};

const TRANSFORM: &str = "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions/KHR_texture_transform";

/// The JSON of an output.
fn json_of(gltf: &Gltf) -> Value {
    gltf.as_json().to_value().unwrap()
}

#[test]
fn what_is_not_lit_is_kept_and_what_is_replaced_goes() {
    let mut builder = Builder::default();
    let replaced = [7u8; 4000];
    builder.view(&replaced);
    let square = builder.square();
    let line_positions = builder.floats(&[[0.0, 0.0, 9.0], [1.0, 0.0, 9.0]]);
    let line =
        json!({"attributes": {"POSITION": line_positions}, "mode": 1, "material": 0, "extras": {"ink": 1}});
    let times = builder.floats(&[[0.0], [1.5]]);
    let moves = builder.floats(&[[0.0, 0.0, 0.0], [0.0, 2.5, 0.0]]);
    let weights = builder.floats(&[[0.0], [1.0]]);
    let image = builder.view(b"not really a PNG");
    let with = |primitive: &Value, fields: Value| {
        let mut primitive = primitive.as_object().unwrap().clone();
        primitive.extend(fields.as_object().unwrap().clone());
        primitive
    };
    let scene = builder.import(json!({
        "extensionsUsed": ["KHR_texture_transform", "KHR_materials_clearcoat", "KHR_lights_punctual"],
        "meshes": [{"name": "body", "weights": [0.5], "extras": {"part": 3}, "primitives": [
            with(&line, json!({"targets": [{"POSITION": line_positions}]})),
            with(&square, json!({"material": 0, "targets": [{"POSITION": square["attributes"]["POSITION"]}]})),
        ]}],
        "materials": [
            {"name": "paint", "pbrMetallicRoughness": {"baseColorTexture": {
                "index": 0, "texCoord": 1, "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}}},
            {"name": "unused"},
        ],
        "textures": [{"source": 0}],
        "images": [{"bufferView": image, "mimeType": "image/png"}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}],
        "nodes": [{"name": "body", "mesh": 0, "weights": [0.5], "extras": {"id": "b"}}, {"name": "eye", "camera": 0}],
        "scenes": [{"name": "main", "nodes": [0, 1]}],
        "animations": [
            {"name": "smile", "samplers": [{"input": times, "output": weights}],
             "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]},
            {"name": "rise", "samplers": [{"input": times, "output": moves}],
             "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]},
        ],
    }));
    let lit = light(&scene, 0, |_| DVec3::ONE);
    let (_, gltf) = round_trip(&scene, &lit);

    let json = json_of(&gltf);
    for (pointer, expected) in [
        ("/scenes/0/name", json!("main")),
        ("/nodes/0/extras", json!({"id": "b"})),
        ("/nodes/0/weights", Value::Null),
        ("/nodes/1/camera", json!(0)),
        ("/meshes/0/name", json!("body")),
        ("/meshes/0/extras", json!({"part": 3})),
        ("/meshes/0/weights", Value::Null),
        ("/meshes/0/primitives/0/mode", json!(1)),
        ("/meshes/0/primitives/0/extras", json!({"ink": 1})),
        ("/meshes/0/primitives/0/targets", Value::Null),
        ("/meshes/0/primitives/1/targets", Value::Null),
        ("/materials/0/name", json!("paint")),
        ("/materials/1/name", json!("unused")),
        ("/animations/0/name", json!("rise")),
        ("/animations/1", Value::Null),
        (TRANSFORM, json!({"offset": [0.0, 0.0], "rotation": 0.0, "scale": [2.0, 2.0], "texCoord": 1})),
        ("/extensionsUsed", json!(["KHR_materials_unlit", "KHR_texture_transform"])),
    ] {
        assert_eq!(json.pointer(pointer).unwrap_or(&Value::Null), &expected, "{pointer}");
    }
    let mesh = gltf.meshes().next().unwrap();
    let [line, square]: [_; 2] = mesh.primitives().collect::<Vec<_>>().try_into().unwrap();
    assert!(!line.material().unlit() && square.material().unlit());
    assert_eq!([line.material().name(), square.material().name()], [Some("paint"); 2]);
    assert_eq!(attribute(&gltf, &line, &Semantic::Positions), [[0.0, 0.0, 9.0], [1.0, 0.0, 9.0]]);
    let animation = gltf.animations().next().unwrap();
    let moves = animation.channels().next().unwrap().sampler().output().view().unwrap();
    let blob = gltf.blob.as_ref().unwrap();
    assert_eq!(blob[moves.offset() + 16..][..4], 2.5f32.to_le_bytes());
    let gltf::image::Source::View { view, .. } = gltf.images().next().unwrap().source() else { panic!() };
    assert_eq!(&blob[view.offset()..][..view.length()], b"not really a PNG");
    assert!(!blob.windows(16).any(|bytes| bytes == &replaced[..16]), "what nothing refers to is gone");
}

#[test]
fn emissive_materials_stay_as_they_are() {
    let scene = open("cornell.glb");
    let lit = light(&scene, 1, |world| world);
    let (_, gltf) = round_trip(&scene, &lit);
    assert_eq!(gltf.nodes().map(|node| node.name().unwrap()).collect::<Vec<_>>(), {
        let names = ["floor", "ceiling", "back", "front", "left", "right", "lamp", "short", "tall"];
        names.to_vec()
    });
    for material in gltf.materials() {
        let lamp = material.name() == Some("lamp");
        assert_eq!(material.unlit(), !lamp);
        assert_eq!(material.emissive_strength(), lamp.then_some(17.0));
    }
}

#[test]
fn what_glows_less_than_it_reflects_becomes_unlit() {
    let scene = square_of(json!({
        "extensionsUsed": ["KHR_materials_emissive_strength"],
        "materials": [{"emissiveFactor": [0.5, 0.5, 0.5],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 2.0}},
            "pbrMetallicRoughness": {"metallicFactor": 0, "baseColorFactor": [0.5, 0.5, 0.5, 1]}}],
    }));
    let emitted = scene.surfaces[0].exitance.x / scene.surfaces[0].reflectance.x;
    for (irradiance, unlit) in [(0.99 * emitted, false), (1.01 * emitted, true)] {
        let (_, gltf) = round_trip(&scene, &light(&scene, 0, |_| DVec3::splat(irradiance)));
        let material = gltf.materials().next().unwrap();
        assert_eq!(material.unlit(), unlit);
        assert_eq!(material.emissive_factor(), [0.5; 3], "for those who compute with it");
        assert_eq!(material.emissive_strength(), (!unlit).then_some(2.0));
    }
}

#[test]
fn a_dark_emissive_strength_and_a_missing_material_do_not_prevent_unlit() {
    let mut builder = Builder::default();
    let (mut strong, plain) = (builder.square(), builder.square());
    strong["material"] = 0.into();
    let scene = in_one_node(
        builder,
        json!([strong, plain]),
        json!({
            "extensionsUsed": ["KHR_materials_emissive_strength"],
            "materials": [{"extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 5.0}}}],
        }),
    );
    let lit = light(&scene, 0, |_| DVec3::ONE);
    let (_, gltf) = round_trip(&scene, &lit);
    let materials: Vec<_> =
        gltf.meshes().next().unwrap().primitives().map(|p| p.material().index()).collect();
    assert_eq!(materials, [Some(0), Some(1)]);
    assert!(gltf.materials().all(|material| material.unlit() && material.emissive_strength().is_none()));
    assert_eq!(json_of(&gltf)["extensionsUsed"], json!(["KHR_materials_unlit"]));
}

#[test]
fn exposure_and_settings_are_in_the_asset_beside_its_own_extras() {
    let mut builder = Builder::default();
    let square = builder.square();
    let mut scene = in_one_node(
        builder,
        json!([square]),
        json!({
            "asset": {"copyright": "the town", "generator": "a modeller", "extras": {"room": 4}},
        }),
    );
    let lit = light(&scene, 0, |_| DVec3::ONE);
    let (_, gltf) = round_trip(&scene, &lit);
    let asset = &json_of(&gltf)["asset"];
    let own = json!({"exposure": 0.5, "unit": "W/m^2", "shots": 7});
    assert_eq!(asset["extras"], json!({"room": 4, "halflight": own}));
    assert_eq!(asset["copyright"], "the town");
    assert!(asset["generator"].as_str().unwrap().starts_with("Halflight 0."));

    scene.source.root.asset.extras = Some(RawValue::from_string("\"a note\"".into()).unwrap());
    let (_, gltf) = round_trip(&scene, &lit);
    assert_eq!(json_of(&gltf)["asset"]["extras"], json!({"source": "a note", "halflight": own}));
}

#[test]
fn the_chosen_exposure_leaves_a_twentieth_of_the_reflecting_area_too_bright() {
    let mut builder = Builder::default();
    let (mut bright, mut lamp) = (builder.square(), builder.square());
    bright["material"] = 0.into();
    lamp["material"] = 1.into();
    let scene = builder.import(json!({
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0.0}}, {"emissiveFactor": [1, 1, 1]}],
        "meshes": [{"primitives": [bright]}, {"primitives": [lamp]}],
        "nodes": [{"mesh": 0}, {"mesh": 1}],
        "scenes": [{"nodes": [0, 1]}],
    }));
    let directory = TempDir::new().unwrap();
    let chosen = |irradiance: fn(DVec3) -> DVec3| {
        let mut lit = light(&scene, 6, irradiance);
        // The lamp reflects nothing: its irradiance does not count.
        let lamp = lit.surfaces[1].iter().flat_map(|t| t.vertices).collect::<Vec<_>>();
        lamp.iter().for_each(|&v| lit.vertices[v as usize].irradiance = DVec3::splat(1e6));
        let settings = ExportSettings { exposure: None, ..settings() };
        export(&scene, &lit, &settings, &directory.path().join("lit.glb")).unwrap().exposure
    };
    // Of the largest channel, 2 x, the 95th percentile over the square is 1.9.
    assert!((chosen(|world| DVec3::new(world.x, 2.0 * world.x, 0.0)) - 1.0 / 1.9).abs() < 0.01);
    // Bright in a corner of less than a twentieth only: its brightest vertex counts.
    assert_eq!(chosen(|world| if world.x + world.y > 1.9 { DVec3::splat(4.0) } else { DVec3::ZERO }), 0.25);
    assert_eq!(chosen(|_| DVec3::ZERO), 1.0);
}
