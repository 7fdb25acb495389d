//! Extensions that nothing here knows.

use glam::DVec3;
use serde_json::{Value, json};

use super::*;
use fixtures::{Builder, light};

#[test]
fn unknown_extensions_survive_with_what_they_name() {
    let mut builder = Builder::default();
    builder.view(&[1; 12]);
    let table = builder.view(&[9; 20]);
    builder.view(&[2; 8]);
    let square = builder.square();
    let unused = builder.view(&[3; 16]);
    let extension = |value: Value| json!({ "ACME_all": value });
    let mut primitive = square.clone();
    primitive["extensions"] = extension(json!({"featureIds": [{"attribute": 0}]}));
    let root = json!({
        "extensionsUsed": ["ACME_all"],
        "extensions": extension(json!({"tables": [{"view": table, "ratio": 0.25}]})),
        "meshes": [{"primitives": [primitive], "extensions": extension(json!("mesh"))},
            {"primitives": [square]}],
        "samplers": [{"extensions": extension(json!("sampler"))}],
        "images": [{"uri": "data:image/png;base64,AA==", "extensions": extension(json!("image"))}],
        "textures": [{"source": 0, "sampler": 0, "extensions": extension(json!("texture"))}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1},
            "extensions": extension(json!("camera"))}],
        "nodes": [{"mesh": 1}, {"mesh": 0, "extensions": extension(json!({"name": "door"}))}],
        "scenes": [{"nodes": [0, 1], "extensions": extension(json!(true))}],
    });
    let scene = builder.import(root.clone());
    let lit = light(&scene, 0, |_| DVec3::ONE);
    let (_, gltf) = round_trip(&scene, &lit);

    let json = gltf.as_json().to_value().unwrap();
    for pointer in [
        "/extensions",
        "/extensionsUsed/0",
        "/meshes/0/extensions",
        "/meshes/0/primitives/0/extensions",
        "/samplers/0/extensions",
        "/images/0/extensions",
        "/textures/0/extensions",
        "/cameras/0/extensions",
        "/nodes/1/extensions",
        "/scenes/0/extensions",
    ] {
        assert_eq!(json.pointer(pointer).unwrap(), root.pointer(pointer).unwrap(), "{pointer}");
    }
    let bytes = |view: usize| {
        let view = gltf.views().nth(view).unwrap();
        gltf.blob.as_ref().unwrap()[view.offset()..][..view.length()].to_vec()
    };
    assert_eq!([bytes(0), bytes(table)], [vec![1; 12], vec![9; 20]], "views up to the one that is named");
    let all: Vec<_> = (0..gltf.views().count()).map(bytes).collect();
    assert!(!all.contains(&vec![2; 8]) && !all.contains(&vec![3; 16]), "not those after it: {unused}");
    // Each node shows the mesh that it did.
    let meshes: Vec<_> = gltf.nodes().map(|node| node.mesh().unwrap().index()).collect();
    assert_eq!(meshes, [1, 0]);
}

#[test]
fn an_unlit_material_keeps_its_other_extensions_in_its_extras() {
    let mut builder = Builder::default();
    let (mut coated, mut glossy) = (builder.square(), builder.square());
    coated["material"] = 1.into();
    glossy["material"] = 2.into();
    let coat =
        json!({"KHR_materials_clearcoat": {"clearcoatFactor": 0.75}, "KHR_materials_ior": {"ior": 1.25}});
    let gloss = json!({"KHR_materials_pbrSpecularGlossiness": {
        "diffuseFactor": [0.5, 0.25, 0.125, 1.0], "diffuseTexture": {"index": 0, "texCoord": 1},
        "specularFactor": [0.5, 0.5, 0.5], "glossinessFactor": 0.75}});
    let scene = in_one_node(
        builder,
        json!([coated, glossy]),
        json!({
            "extensionsUsed": ["KHR_materials_clearcoat", "KHR_materials_ior", "KHR_materials_pbrSpecularGlossiness"],
            "images": [{"uri": "data:image/png;base64,AA=="}],
            "textures": [{"source": 0}],
            "materials": [
                {"name": "spare"},
                {"name": "coated", "extensions": coat, "extras": {"shelf": 3}},
                {"name": "glossy", "extensions": gloss, "extras": "a note"},
            ],
        }),
    );
    let lit = light(&scene, 0, |_| DVec3::ONE);
    let (_, gltf) = round_trip(&scene, &lit);
    let json = gltf.as_json().to_value().unwrap();
    let names: Vec<_> = gltf.materials().map(|material| material.name().unwrap().to_owned()).collect();
    assert_eq!(names, ["spare", "coated", "glossy"], "lit materials take the places of their originals");
    assert_eq!(json["extensionsUsed"], json!(["KHR_materials_unlit"]));
    for (material, source) in [(1, json!({"shelf": 3})), (2, json!({"source": "a note"}))] {
        let extensions = if material == 1 { &coat } else { &gloss };
        let mut extras = source;
        extras["halflight"] = json!({ "extensions": extensions });
        assert_eq!(json["materials"][material]["extras"], extras);
    }
    let pbr = &json["materials"][2]["pbrMetallicRoughness"];
    assert_eq!(pbr["baseColorFactor"], json!([0.5, 0.25, 0.125, 1.0]));
    assert_eq!((&pbr["baseColorTexture"]["texCoord"], &pbr["metallicFactor"]), (&json!(1), &json!(0.0)));
}
