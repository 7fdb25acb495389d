//! The input's vertex attributes in the output.

use glam::DVec3;
use gltf::Semantic;
use gltf::material::AlphaMode;
use serde_json::json;

use super::*;
use bake::lit::LitLayer;
use fixtures::{Builder, light, square};

#[test]
fn attributes_are_interpolated_and_vertices_split_where_they_jump() {
    let mut builder = Builder::default();
    // Two triangles of a square that share no vertex: their texture coordinates jump across the diagonal.
    let positions: [[f32; 3]; 6] =
        [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 0., 0.], [1., 1., 0.], [0., 1., 0.]];
    let texture =
        positions.iter().enumerate().map(|(i, p)| [p[0] + (i / 3) as f32, p[1]]).collect::<Vec<_>>();
    let attributes = json!({
        "POSITION": builder.floats(&positions),
        "TEXCOORD_0": builder.floats(&texture),
        "TANGENT": builder.floats(&[[1., 0., 0., -1.], [0., 1., 0., -1.], [1., 0., 0., -1.]].repeat(2)),
        "COLOR_0": builder.floats(&[[0.5f32; 3]; 6]),
        "COLOR_1": builder.accessor(&[255; 24],
            json!({"componentType": 5121, "normalized": true, "count": 6, "type": "VEC4"})),
        "_WEAR": builder.floats(&positions.map(|p| [p[1] * 8.0])),
        "JOINTS_0": builder.accessor(&[0; 24], json!({"componentType": 5121, "count": 6, "type": "VEC4"})),
        "WEIGHTS_0": builder.floats(&[[1.0f32, 0., 0., 0.]; 6]),
    });
    let indices = builder.indices(&[0, 1, 2, 3, 4, 5]);
    let scene = builder.import(json!({
        "meshes": [{"primitives": [{"attributes": attributes, "indices": indices}]}],
        "nodes": [{"mesh": 0, "skin": 0}],
        "skins": [{"joints": [0]}],
        "scenes": [{"nodes": [0]}],
    }));
    assert_eq!(scene.surfaces[0].facets.len(), 1, "one facet of two source triangles");
    let lit = light(&scene, 1, |_| DVec3::ONE);
    assert_eq!(lit.vertices.len(), 9);
    let (exported, gltf) = round_trip(&scene, &lit);

    let primitive = first_primitive(&gltf, 0);
    assert_eq!(exported.vertices, 12, "three vertices lie on the diagonal");
    let rows = |semantic| attribute(&gltf, &primitive, &semantic);
    let positions = rows(Semantic::Positions);
    for (index, position) in positions.iter().enumerate() {
        let [u, v] = rows(Semantic::TexCoords(0))[index][..] else { panic!("two components") };
        let (x, y) = (position[0], position[1]);
        let jump = u - x;
        assert!((v - y).abs() < 1e-6);
        assert!(jump.abs() < 1e-6 && y <= x + 1e-6 || (jump - 1.0).abs() < 1e-6 && y >= x - 1e-6);
        let tangent = &rows(Semantic::Tangents)[index];
        assert!((point(tangent).length() - 1.0).abs() < 1e-6);
        assert_eq!(tangent[3], -1.0);
        assert_eq!(rows(Semantic::Colors(1))[index], [1.0; 4]);
        assert_eq!(rows(Semantic::Colors(0))[index], [0.25; 3], "irradiance 1 x exposure 0.5 x colour 0.5");
        assert_eq!(rows(Semantic::Extras("COLOR_0".into()))[index], [0.5; 3]);
        assert!((rows(Semantic::Extras("WEAR".into()))[index][0] - 8.0 * y).abs() < 1e-5);
    }
    for gone in [Semantic::Joints(0), Semantic::Weights(0)] {
        assert!(primitive.get(&gone).is_none());
    }
    assert!(gltf.nodes().next().unwrap().skin().is_none());
}

#[test]
fn the_colour_of_a_vertex_is_light_times_its_own_colour_with_its_alpha() {
    let mut builder = Builder::default();
    let mut square = builder.square();
    let colours = [[255u8, 0, 51, 255], [255, 0, 51, 0], [255, 0, 51, 255], [255, 0, 51, 0]];
    square["attributes"]["COLOR_0"] = builder
        .accessor(
            colours.as_flattened(),
            json!({"componentType": 5121, "normalized": true, "count": 4, "type": "VEC4"}),
        )
        .into();
    square["attributes"]["_COLOR_0"] = builder.floats(&[[9.0]; 4]).into();
    square["attributes"]["_IRRADIANCE_OLD"] = builder.floats(&[[9.0]; 4]).into();
    square["material"] = 0.into();
    let scene = in_one_node(
        builder,
        json!([square]),
        json!({
            "materials": [{"alphaMode": "MASK", "alphaCutoff": 0.25,
                "pbrMetallicRoughness": {"metallicFactor": 0.25, "baseColorFactor": [0.5, 0.5, 0.5, 0.75]}}],
        }),
    );
    let lit = light(&scene, 1, |_| DVec3::new(1.0, 1.0, 4.0));
    let (_, gltf) = round_trip(&scene, &lit);
    let primitive = first_primitive(&gltf, 0);
    let kept = attribute(&gltf, &primitive, &Semantic::Extras("COLOR_0".into()));
    let positions = attribute(&gltf, &primitive, &Semantic::Positions);
    assert!(primitive.get(&Semantic::Extras("IRRADIANCE_OLD".into())).is_none(), "of an earlier bake");
    for ((colour, kept), position) in
        attribute(&gltf, &primitive, &Semantic::Colors(0)).iter().zip(kept).zip(positions)
    {
        // Exposure .5, and three quarters of a quarter metal reflect diffusely.
        let alpha =
            if position[0] == position[1] { 1.0 } else { (1.0 - (position[0] - position[1]).abs()).max(0.0) };
        for (found, expected) in colour.iter().zip([0.375, 0.0, 0.3, alpha]) {
            assert!((found - expected).abs() < 1e-6, "{colour:?} at {position:?}");
        }
        assert_eq!(kept.len(), 3);
        for (found, expected) in kept.iter().zip([1.0, 0.0, 0.2]) {
            assert!((found - expected).abs() < 1e-6, "{kept:?} at {position:?}");
        }
    }
    let material = primitive.material();
    assert!(material.unlit() && material.alpha_cutoff() == Some(0.25));
    assert_eq!(material.pbr_metallic_roughness().base_color_factor(), [0.5, 0.5, 0.5, 0.75]);
    assert_eq!(material.pbr_metallic_roughness().metallic_factor(), 0.25, "the material is what it was");
}

#[test]
fn glass_is_shown_by_alpha_where_one_number_says_it() {
    let texture = json!({"baseColorTexture": {"index": 0}, "metallicFactor": 0.0});
    let factors = json!({"baseColorFactor": [0.5, 1.0, 0.75, 0.5], "metallicFactor": 0.0});
    // .6 x .75 of the light passes, and .4 of the colour is seen of the .55 that stay.
    for (mode, pbr, mode_shown, alpha, diffuse) in [
        ("OPAQUE", factors.clone(), AlphaMode::Blend, 0.55, 0.4 / 0.55),
        ("BLEND", factors.clone(), AlphaMode::Blend, 0.5 * 0.55, 0.4 / 0.55),
        ("MASK", factors, AlphaMode::Mask, 0.5, 1.0),
        ("OPAQUE", texture.clone(), AlphaMode::Opaque, 1.0, 1.0),
        ("BLEND", texture, AlphaMode::Blend, 1.0, 1.0),
    ] {
        let scene = square_of(json!({
            "images": [{"uri": "data:image/png;base64,AA=="}],
            "textures": [{"source": 0}],
            "materials": [{"alphaMode": mode, "pbrMetallicRoughness": pbr,
                "extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.6}}}],
        }));
        let (_, gltf) = round_trip(&scene, &light(&scene, 0, |_| DVec3::ONE));
        let primitive = first_primitive(&gltf, 0);
        let material = primitive.material();
        assert!(material.unlit() && material.alpha_mode() == mode_shown, "{mode}");
        let shown = material.pbr_metallic_roughness().base_color_factor()[3];
        assert!((shown - alpha).abs() < 1e-6, "{mode}: {shown}");
        let colour = attribute(&gltf, &primitive, &Semantic::Colors(0))[0][0];
        assert!((colour - 0.5 * diffuse).abs() < 1e-6, "{mode}: {colour}");
    }
}

#[test]
fn where_a_texture_says_what_is_metal_base_colour_is_shown_whole() {
    let scene = square_of(json!({
        "images": [{"uri": "data:image/png;base64,AA=="}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}}}],
    }));
    let (_, gltf) = round_trip(&scene, &light(&scene, 0, |_| DVec3::ONE));
    let colours = attribute(&gltf, &first_primitive(&gltf, 0), &Semantic::Colors(0));
    assert_eq!(colours, vec![[0.5; 3]; 4]);
}

#[test]
fn every_corner_has_a_vertex_of_its_own_where_that_is_asked_for() {
    let (scene, _) = square();
    let lit = light(&scene, 1, |world| world + DVec3::splat(9.0));
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("lit.glb");
    let settings = ExportSettings { domain: Domain::Corner, ..settings() };
    let exported = export(&scene, &lit, &settings, &path).unwrap();
    assert_eq!((exported.vertices, exported.triangles), (24, 8));
    let gltf = fixtures::opened(&path);
    let primitive = first_primitive(&gltf, 0);
    assert_eq!(indices(&gltf, &primitive), (0..24).collect::<Vec<u32>>());
    let positions = attribute(&gltf, &primitive, &Semantic::Positions);
    for (position, irradiance) in positions.iter().zip(attribute(&gltf, &primitive, &irradiance())) {
        assert!((point(&irradiance) - point(position) - DVec3::splat(9.0)).length() < 1e-5);
    }
}

#[test]
fn each_group_of_lights_has_an_attribute_of_its_own() {
    let (scene, mut lit) = square();
    let layer = |name: &str, part: f64| LitLayer {
        name: name.into(),
        lights: vec![format!("the light of {name}")],
        irradiance: lit.vertices.iter().map(|vertex| vertex.irradiance * part).collect(),
    };
    lit.layers = vec![layer("key light", 0.75), layer("fill-2", 0.25)];
    let (_, gltf) = round_trip(&scene, &lit);
    let primitive = first_primitive(&gltf, 0);
    for (name, part) in [("IRRADIANCE_KEY_LIGHT", 0.75), ("IRRADIANCE_FILL_2", 0.25)] {
        assert_eq!(attribute(&gltf, &primitive, &Semantic::Extras(name.into())), vec![[part; 3]; 4]);
    }
    let extras: serde_json::Value =
        serde_json::from_str(gltf.as_json().asset.extras.as_ref().unwrap().get()).unwrap();
    assert_eq!(
        extras["halflight"]["groups"],
        json!([
            {"name": "key light", "attribute": "_IRRADIANCE_KEY_LIGHT", "lights": ["the light of key light"]},
            {"name": "fill-2", "attribute": "_IRRADIANCE_FILL_2", "lights": ["the light of fill-2"]},
        ])
    );

    let directory = TempDir::new().unwrap();
    let path = directory.path().join("lit.glb");
    lit.layers[1].name = "KEY-light".into();
    let error = export(&scene, &lit, &settings(), &path).unwrap_err().to_string();
    assert!(
        error.contains("groups key light and KEY-light") && error.contains("_IRRADIANCE_KEY_LIGHT"),
        "{error}"
    );
    lit.layers[1] = LitLayer { name: "short".into(), ..LitLayer::default() };
    assert!(matches!(export(&scene, &lit, &settings(), &path), Err(ExportError::Mismatch(_))));
}

#[test]
fn refined_triangles_across_source_triangles_follow_each_of_them() {
    let mut builder = Builder::default();
    let mut square = builder.square();
    // |x - y|, linear in each of the two source triangles.
    square["attributes"]["_WEAR"] = builder.floats(&[[0.0], [1.0], [0.0], [1.0]]).into();
    let mut scene = in_one_node(builder, json!([square]), json!({}));
    // Makes the fan's diagonal cross that of the source triangles.
    scene.surfaces[0].facets[0].corners.rotate_left(1);
    let lit = light(&scene, 2, |_| DVec3::ONE);
    let (exported, gltf) = round_trip(&scene, &lit);

    assert_eq!(exported.vertices, lit.vertices.len());
    let primitive = first_primitive(&gltf, 0);
    let positions = attribute(&gltf, &primitive, &Semantic::Positions);
    for (position, wear) in
        positions.iter().zip(attribute(&gltf, &primitive, &Semantic::Extras("WEAR".into())))
    {
        assert!((wear[0] - (position[0] - position[1]).abs()).abs() < 1e-6);
    }
}

#[test]
fn kept_materials_and_colours_are_those_of_the_input() {
    let mut builder = Builder::default();
    let mut square = builder.square();
    square["attributes"]["COLOR_0"] = builder.floats(&[[0.25, 0.5, 0.75]; 4]).into();
    square["material"] = 0.into();
    let scene = in_one_node(
        builder,
        json!([square]),
        json!({
            "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0.5}}],
        }),
    );
    let lit = light(&scene, 2, |_| DVec3::splat(3.0));
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("lit.glb");
    export(&scene, &lit, &ExportSettings { materials: Materials::Keep, ..settings() }, &path).unwrap();

    let gltf = fixtures::opened(&path);
    let primitive = first_primitive(&gltf, 0);
    assert_eq!((gltf.materials().count(), primitive.material().unlit()), (1, false));
    assert!(primitive.get(&Semantic::Extras("COLOR_0".into())).is_none());
    assert!(attribute(&gltf, &primitive, &Semantic::Colors(0)).iter().all(|row| *row == [0.25, 0.5, 0.75]));
    assert!(attribute(&gltf, &primitive, &irradiance()).iter().all(|row| *row == [3.0; 3]));
}

#[test]
fn covered_vertices_show_the_light_beside_them() {
    let (scene, mut lit) = square();
    lit.vertices[2].irradiance = DVec3::ZERO;
    lit.covered = vec![(2, DVec3::splat(0.5))];
    let (exported, gltf) = round_trip(&scene, &lit);
    let primitive = first_primitive(&gltf, 0);
    let light = attribute(&gltf, &primitive, &irradiance());
    let dark =
        light.iter().position(|row| point(row) == DVec3::ZERO).expect("_IRRADIANCE is what was computed");
    let shown = point(&attribute(&gltf, &primitive, &Semantic::Colors(0))[dark]);
    assert!((shown - DVec3::splat(0.5 * exported.exposure)).length() < 1e-5, "{shown}");
}

/// Without a metallic factor glTF's is 1: of an unlit material it means nothing.
#[test]
fn an_unlit_material_of_the_input_reflects_all_of_its_colour() {
    let scene = square_of(json!({
        "materials": [{"extensions": {"KHR_materials_unlit": {}},
            "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1]}}],
    }));
    let lit = light(&scene, 1, |_| DVec3::ONE);
    let (_, gltf) = round_trip(&scene, &lit);
    let primitive = first_primitive(&gltf, 0);
    for colour in attribute(&gltf, &primitive, &Semantic::Colors(0)) {
        assert!((colour[0] - 0.5).abs() < 1e-6, "exposure .5: {colour:?}");
    }
    assert_eq!(primitive.material().pbr_metallic_roughness().metallic_factor(), 0.0);
}
