use std::f64::consts::PI;

use glam::DVec3;
use serde_json::{Value, json};
use tempfile::TempDir;

use super::appearance::MAX_REFLECTANCE;
use super::*;
use fixtures::{Builder, test_scene};

/// A .gltf with one unit square under a node, changed before it is written.
fn opened(change: impl Fn(&mut Value)) -> Result<PlainScene, PlainError> {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("square.gltf");
    let (mut root, bytes) = square();
    std::fs::write(folder.path().join("its data.bin"), bytes).unwrap();
    change(&mut root);
    std::fs::write(&path, root.to_string()).unwrap();
    PlainScene::open(&path)
}

fn square() -> (Value, Vec<u8>) {
    let mut builder = Builder::default();
    let square = builder.square();
    let (mut root, bytes) = builder.finish(json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "name": "sheet", "mesh": 0, "scale": [2.0, 1.0, 1.0] }],
        "meshes": [{ "primitives": [square] }],
        "materials": [{
            "name": "paint",
            "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.25, 1.0, 1.0], "metallicFactor": 0.5 },
            "emissiveFactor": [1.0, 0.5, 0.0],
            "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 3.0 } },
        }],
    }));
    root["meshes"][0]["primitives"][0]["material"] = json!(0);
    root["buffers"][0]["uri"] = json!("its%20data.bin");
    (root, bytes)
}

#[test]
fn materials_and_triangles_are_those_of_the_file() {
    let scene = opened(|_| ()).unwrap();
    let [material] = scene.materials[..] else { panic!("{:?}", scene.materials) };
    assert_eq!(material.reflectance, DVec3::new(0.25, 0.125, 0.5));
    assert_eq!(material.exitance, DVec3::new(3.0 * PI, 1.5 * PI, 0.0));
    let areas: Vec<_> = scene.triangles.iter().map(PlainTriangle::area_vector).collect();
    assert_eq!(areas, [DVec3::Z, DVec3::Z]);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn what_is_mirrored_is_told_by_specular_too_and_unlit_materials_mirror_nothing() {
    let material = |extensions: &Value| {
        let scene = opened(|root| root["materials"][0]["extensions"] = extensions.clone()).unwrap();
        scene.materials[0]
    };
    let glossy = material(&json!({ "KHR_materials_pbrSpecularGlossiness": {
        "diffuseFactor": [0.5, 0.25, 0.75, 1.0], "specularFactor": [0.5, 0.25, 0.0],
    } }));
    assert_eq!(glossy.reflectance, DVec3::new(0.25, 0.125, 0.375));
    let bright =
        material(&json!({ "KHR_materials_pbrSpecularGlossiness": { "specularFactor": [2.0, 0.0, 0.0] } }));
    assert_eq!(bright.reflectance, DVec3::ZERO);
    let unlit = material(&json!({ "KHR_materials_unlit": {} }));
    assert_eq!(unlit.reflectance, DVec3::new(0.5, 0.25, 0.999));
    assert_eq!(unlit.exitance, DVec3::ZERO);
}

#[test]
fn transmission_leaves_the_reflection_and_all_of_the_glow() {
    let material = |metal: f64, factor: f64| {
        opened(|root| {
            let material = &mut root["materials"][0];
            material["pbrMetallicRoughness"]["metallicFactor"] = json!(metal);
            material["extensions"]["KHR_materials_transmission"] = json!({ "transmissionFactor": factor });
        })
        .unwrap()
        .materials[0]
    };
    // Base colours of .5, .25 and 1 let 7/12 of what is transmitted through.
    for (metal, factor, opacity) in [(0.0, 0.75, 9.0 / 16.0), (0.5, 0.75, 25.0 / 32.0), (0.0, 0.0, 1.0)] {
        let glass = material(metal, factor);
        assert!((glass.opacity - opacity).abs() < 1e-12, "{}", glass.opacity);
        let reflected = DVec3::new(0.5, 0.25, 1.0) * ((1.0 - metal) * (1.0 - factor));
        let most = DVec3::splat(MAX_REFLECTANCE);
        assert!((glass.reflectance * opacity).abs_diff_eq(reflected.min(most), 1e-12), "{glass:?}");
        assert!((glass.exitance * opacity).abs_diff_eq(DVec3::new(3.0 * PI, 1.5 * PI, 0.0), 1e-12));
    }
}

#[test]
fn mirrored_nodes_keep_their_front() {
    // A mirror across x turns the winding, not the side that faces +z.
    let scene = opened(|root| root["nodes"][0]["scale"] = json!([-2.0, 1.0, 1.0])).unwrap();
    let areas: Vec<_> = scene.triangles.iter().map(PlainTriangle::area_vector).collect();
    assert_eq!(areas, [DVec3::Z, DVec3::Z]);
}

/// Around the square, its corners are a fan; as a strip the second triangle turns the other way.
#[test]
fn strips_and_fans_are_triangles_too() {
    for (mode, second) in [(5, -DVec3::Z), (6, DVec3::Z)] {
        let scene = opened(|root| {
            let primitive = root["meshes"][0]["primitives"][0].as_object_mut().unwrap();
            primitive.insert("mode".into(), json!(mode));
            primitive.remove("indices");
        });
        let areas: Vec<_> = scene.unwrap().triangles.iter().map(PlainTriangle::area_vector).collect();
        assert_eq!(areas, [DVec3::Z, second]);
    }
}

#[test]
fn repeated_triangles_and_those_without_area_are_left_out() {
    let scene = opened(|root| {
        let primitive = root["meshes"][0]["primitives"][0].clone();
        root["meshes"][0]["primitives"] = json!([primitive, primitive]);
        root["nodes"][0]["scale"] = json!([1.0, 1.0, 1.0]);
    });
    // Each primitive has its own.
    assert_eq!(scene.unwrap().triangles.len(), 4);
    let flat = opened(|root| root["nodes"][0]["scale"] = json!([0.0, 1.0, 1.0])).unwrap_err().to_string();
    assert!(flat.contains("no triangles with an area"), "{flat}");
}

#[test]
fn what_is_not_modelled_is_said() {
    let scene = opened(|root| {
        root["materials"][0]["alphaMode"] = json!("BLEND");
        root["materials"][0]["pbrMetallicRoughness"] =
            json!({ "baseColorFactor": [1.5, 0.0, 0.0, 1.0], "metallicFactor": 0.0, "baseColorTexture": { "index": 0 } });
        root["images"] = json!([{ "uri": "picture.png" }]);
        root["textures"] = json!([{ "source": 0 }]);
        root["extensionsUsed"] = json!(["KHR_lights_punctual", "KHR_materials_clearcoat"]);
        root["extensions"]["KHR_lights_punctual"]["lights"] =
            json!([{ "type": "spot", "spot": {} }, { "type": "point", "intensity": 2.0, "color": [1.0, 0.5, 0.0] }]);
        root["nodes"][0]["extensions"]["KHR_lights_punctual"]["light"] = json!(0);
        root["nodes"][0]["children"] = json!([1]);
        root["nodes"] = json!([root["nodes"][0], {
            "translation": [1.0, 2.0, 3.0], "extensions": { "KHR_lights_punctual": { "light": 1 } }
        }]);
    })
    .unwrap();
    assert_eq!(
        scene.warnings,
        [
            "extensions ignored: KHR_materials_clearcoat",
            "material paint: a texture ignored, its image is missing",
            "material paint: reflectance clamped to 0.999",
        ]
    );
    assert_eq!(scene.materials[0].reflectance, DVec3::new(0.999, 0.0, 0.0));
    let kind = PlainLightKind::Point { position: DVec3::new(2.0, 2.0, 3.0) };
    assert_eq!(scene.lights[1], PlainLight { kind, intensity: DVec3::new(2.0, 1.0, 0.0) });
    let PlainLightKind::Spot { along, ramp, .. } = scene.lights[0].kind else { panic!("{:?}", scene.lights) };
    assert_eq!(along, DVec3::NEG_Z);
    // From the axis to an eighth of a turn, where the file has no cones.
    assert!((ramp[0] + ramp[1] - 1.0).abs() <= 1e-6 && (ramp[0] * 0.5_f64.sqrt() + ramp[1]).abs() <= 1e-6);
}

#[test]
fn area_lights_are_read_or_refused() {
    let lit_by = |light: Value| {
        opened(|root| {
            root["extensionsUsed"] = json!(["EXT_lights_area"]);
            root["extensionsRequired"] = json!(["EXT_lights_area"]);
            root["extensions"]["EXT_lights_area"]["lights"] = json!([light]);
            root["nodes"] = json!([root["nodes"][0], {
                "name": "panel", "scale": [0.5, 1.0, 2.0], "extensions": { "EXT_lights_area": { "light": 0 } }
            }]);
            root["scenes"][0]["nodes"] = json!([0, 1]);
        })
    };
    let scene =
        lit_by(json!({ "type": "rect", "size": 3.0, "rect": { "aspect": 0.5 }, "intensity": 5.0 })).unwrap();
    let half = [DVec3::X * 1.5, DVec3::Y * -3.0];
    let kind = PlainLightKind::Area { centre: DVec3::ZERO, half, is_round: false };
    assert_eq!(scene.lights, [PlainLight { kind, intensity: DVec3::splat(5.0) }]);
    assert_eq!(scene.warnings, Vec::<String>::new());
    for (light, why) in [
        (json!({ "type": "sphere" }), "its type is"),
        (json!({ "type": "rect", "size": 0 }), "its size is"),
        (json!({ "type": "disk", "color": [1, "red", 1] }), "is no number"),
        (json!({ "type": "disk", "intensity": -1 }), "must be finite and not negative"),
    ] {
        let problem = lit_by(light).unwrap_err().to_string();
        assert!(problem.contains("panel") && problem.contains(why), "{problem}");
    }
}

#[test]
fn wrong_files_are_refused_with_their_place() {
    type Change = dyn Fn(&mut Value);
    let cases: [(&Change, &str); 9] = [
        (
            &|root| root["buffers"][0]["uri"] = json!("other.bin"),
            "buffer 0: external file `other.bin` cannot be read",
        ),
        (&|root| root["buffers"][0]["uri"] = json!("../square.bin"), "leads outside the folder of the glTF"),
        (&|root| root["buffers"][0]["uri"] = json!("data:;base64,AAAA"), "buffer 0 has 3 of its 60 bytes"),
        (&|root| root["accessors"][0]["count"] = json!(1_u64 << 40), "POSITION of node sheet cannot be read"),
        (&|root| root["accessors"][0]["count"] = json!(2), "indices of node sheet cannot be read"),
        (&|root| root["accessors"][1]["count"] = json!(0), "indices of node sheet cannot be read"),
        (
            &|root| root["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(7),
            "meshes[0].primitives[0].attributes.POSITION refers to something that is not in the file",
        ),
        (&|root| root["extensionsRequired"] = json!(["EXT_unheard_of"]), "requires EXT_unheard_of"),
        (
            &|root| root["materials"][0]["emissiveFactor"] = json!([-1.0, 0.0, 0.0]),
            "emission of material paint must be finite and not negative",
        ),
    ];
    for (change, expected) in cases {
        let error = opened(change).unwrap_err().to_string();
        assert!(error.contains(expected), "{expected:?} is missing in {error}");
    }
    let file = tempfile::NamedTempFile::new().unwrap();
    for (bytes, expected) in [
        (&b"glTF"[..], "is truncated"),
        (b"glTF\x02\0\0\0\x01\0\0\0", "is not valid glTF"),
        (b"", "is not a glTF"),
        (b"{", "is truncated"),
    ] {
        std::fs::write(file.path(), bytes).unwrap();
        let error = PlainScene::open(file.path()).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    let missing = PlainScene::open(&test_scene("missing.glb")).unwrap_err().to_string();
    assert!(missing.contains("missing.glb: cannot be read"), "{missing}");
}

#[test]
fn compressed_scenes_are_the_plain_one() {
    let areas = |name: &str| {
        let scene = PlainScene::open(&test_scene(&format!("../fixtures/compressed/{name}.glb"))).unwrap();
        let area = |primitive: usize| {
            let triangles = scene.triangles.iter().filter(|triangle| triangle.primitive == primitive);
            triangles.map(PlainTriangle::area_vector).sum::<DVec3>()
        };
        (scene.triangles.len(), area(0), area(1))
    };
    let (count, sheet, lamp) = areas("plain");
    for name in ["quantized", "meshopt_plain", "meshopt_filtered", "draco_edgebreaker", "draco_sequential"] {
        let (found, first, second) = areas(name);
        assert_eq!(found, count, "{name}");
        assert!(
            (first - sheet).length() < 5e-3 && (second - lamp).length() < 5e-3,
            "{name}: {first} {second}"
        );
    }
}

/// Left half red and opaque, right half white with a quarter of alpha; texture coordinates go over the square once.
fn with_picture(change: impl Fn(&mut Value)) -> PlainScene {
    let mut builder = Builder::default();
    let mut square = builder.square();
    square["attributes"]["TEXCOORD_0"] =
        json!(builder.floats(&[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]));
    square["attributes"]["COLOR_0"] =
        json!(builder.floats(&[[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [0.5, 1.0, 0.0], [0.5, 1.0, 0.0]]));
    square["material"] = json!(0);
    let image = image::RgbaImage::from_raw(2, 1, vec![255, 0, 0, 255, 255, 255, 255, 64]).unwrap();
    let mut png = std::io::Cursor::new(vec![]);
    image.write_to(&mut png, image::ImageFormat::Png).unwrap();
    let view = builder.view(&png.into_inner());
    let (mut root, bytes) = builder.finish(json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "scale": [2.0, 1.0, 1.0] }],
        "meshes": [{ "primitives": [square] }],
        "images": [{ "bufferView": view, "mimeType": "image/png" }],
        "samplers": [{ "magFilter": 9728 }],
        "textures": [{ "source": 0, "sampler": 0 }],
        "materials": [{
            "pbrMetallicRoughness": { "baseColorFactor": [0.8, 0.5, 0.25, 1.0], "metallicFactor": 0.0, "baseColorTexture": { "index": 0 } },
        }],
    }));
    change(&mut root);
    root["buffers"][0]["uri"] = json!("data.bin");
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("data.bin"), bytes).unwrap();
    let path = folder.path().join("square.gltf");
    std::fs::write(&path, root.to_string()).unwrap();
    PlainScene::open(&path).unwrap()
}

fn look(scene: &PlainScene, x: f64, y: f64) -> PlainMaterial {
    // The square is two triangles, below and above its diagonal, twice as wide as high.
    let triangle = &scene.triangles[usize::from(y > x / 2.0)];
    scene.material_at(triangle, DVec3::new(x, y, 0.0))
}

#[test]
fn textures_and_colours_are_those_of_the_point() {
    let scene = with_picture(|_| ());
    let near = |found: PlainMaterial, expected: DVec3| {
        assert!(found.reflectance.abs_diff_eq(expected, 1e-7), "{}, not {expected}", found.reflectance);
    };
    near(look(&scene, 0.5, 0.0), DVec3::new(0.8, 0.0, 0.0));
    near(look(&scene, 1.5, 0.0), DVec3::new(0.8, 0.5, 0.25));
    near(look(&scene, 1.5, 0.6), DVec3::new(0.8 * 0.7, 0.5, 0.25 * 0.4));
    near(look(&scene, 0.5, 0.6), DVec3::new(0.8 * 0.7, 0.0, 0.0));
    assert_eq!(look(&scene, 1.5, 0.6).opacity, 1.0);
    let mode = |mode: &str| with_picture(|root| root["materials"][0]["alphaMode"] = json!(mode));
    assert_eq!([0.5, 1.5].map(|x| look(&mode("MASK"), x, 0.1).opacity), [1.0, 0.0]);
    assert_eq!([0.5, 1.5].map(|x| look(&mode("BLEND"), x, 0.1).opacity), [1.0, 64.0 / 255.0]);
}

#[test]
fn a_texture_without_coordinates_is_its_first_texel() {
    let without = |transform: Value| {
        with_picture(|root| {
            root["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("TEXCOORD_0");
            root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] =
                json!({ "KHR_texture_transform": transform });
        })
    };
    for (transform, colour) in
        [(json!({}), [0.8, 0.0, 0.0]), (json!({ "offset": [0.6, 0.0] }), [0.8, 0.5, 0.25])]
    {
        let scene = without(transform);
        for x in [0.5, 1.5] {
            assert!(look(&scene, x, 0.0).reflectance.abs_diff_eq(DVec3::from_array(colour), 1e-7));
        }
        let [warning] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
        assert!(warning.contains("has no TEXCOORD_0"), "{warning}");
    }
}
