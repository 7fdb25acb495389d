//! Textures, vertex colours and alpha, from files to means over surfaces.

use std::f64::consts::PI;
use std::io::Cursor;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::DVec3;
use image::{ImageFormat, RgbaImage};
use serde_json::{Value, json};

use crate::import::test_document::{SQUARE, TestDocument};
use crate::import::{ImportOptions, import, import_slice};
use crate::model::{Scene, Surface};

mod glass;
mod images;

const BLACK: [u8; 4] = [0, 0, 0, 255];
const WHITE: [u8; 4] = [255, 255, 255, 255];

/// An image of these texels, row by row.
fn encoded(width: u32, texels: &[[u8; 4]], format: ImageFormat) -> Vec<u8> {
    let image = RgbaImage::from_raw(width, texels.len() as u32 / width, texels.concat()).unwrap();
    let mut bytes = Cursor::new(vec![]);
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// The unit square with a material of its own beside the lamp; u goes along x, v against y.
struct Textured {
    document: TestDocument,
    attributes: Value,
}

impl Textured {
    fn new() -> Self {
        let mut document = TestDocument::square();
        document.root["textures"] = json!([]);
        document.root["images"] = json!([]);
        document.root["samplers"] = json!([{ "magFilter": 9728 }]);
        let coordinates = document.floats("VEC2", &SQUARE.map(|[x, y, _]| [x, 1.0 - y]));
        Self { document, attributes: json!({ "POSITION": 0, "TEXCOORD_0": coordinates }) }
    }

    /// Adds a texture whose image lies in the buffer, and refers to it.
    fn texture(&mut self, width: u32, texels: &[[u8; 4]]) -> Value {
        let bytes = encoded(width, texels, ImageFormat::Png);
        let view = self.view(&bytes);
        self.texture_of(json!({ "bufferView": view, "mimeType": "image/png", "name": "picture" }))
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        let view = json!({ "buffer": 0, "byteOffset": self.document.bin.len(), "byteLength": bytes.len() });
        self.document.bin.extend_from_slice(bytes);
        self.document.bin.resize(self.document.bin.len().next_multiple_of(4), 0);
        self.document.push("bufferViews", view)
    }

    fn texture_of(&mut self, image: Value) -> Value {
        let source = self.document.push("images", image);
        json!({ "index": self.document.push("textures", json!({ "source": source, "sampler": 0 })) })
    }

    fn colours(&mut self, colours: &[[f32; 4]]) {
        self.attributes["COLOR_0"] = self.document.floats("VEC4", colours).into();
    }

    /// With this material.
    fn document(mut self, mut material: Value) -> TestDocument {
        material["name"] = "cloth".into();
        if material.get("pbrMetallicRoughness").is_some_and(|pbr| pbr.get("metallicFactor").is_none()) {
            material["pbrMetallicRoughness"]["metallicFactor"] = 0.0.into();
        }
        let material = self.document.push("materials", material);
        let primitive = json!({ "attributes": self.attributes, "indices": 1, "material": material });
        self.document.node_with(primitive);
        self.document
    }

    fn scene(self, material: Value) -> Scene {
        self.document(material).scene()
    }
}

#[track_caller]
fn assert_near(found: DVec3, expected: DVec3) {
    assert!((found - expected).abs().max_element() < 1e-7, "{found} is not {expected}");
}

/// Part of the unit square in the plane z = 0, as the scene's frame has it.
fn part(scene: &Scene, low: [f64; 2], high: [f64; 2]) -> Vec<DVec3> {
    let corners = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]];
    corners.map(|[x, y]| scene.frame.to_frame(DVec3::new(x, y, 0.0))).to_vec()
}

fn cloth(scene: &Scene) -> &Surface {
    &scene.surfaces[1]
}

#[test]
fn base_colour_textures_multiply_their_factor() {
    let mut textured = Textured::new();
    let texture = textured.texture(2, &[BLACK, WHITE, BLACK, [188, 188, 188, 255]]);
    let scene = textured.scene(json!({
        "pbrMetallicRoughness": { "baseColorTexture": texture, "baseColorFactor": [0.5, 0.25, 0.125, 1.0] },
    }));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let grey = document::texture::srgb_to_linear(188.0 / 255.0);
    let factor = DVec3::new(0.5, 0.25, 0.125);
    assert_near(cloth(&scene).reflectance, factor * (1.0 + grey) / 4.0);
    let over = |low, high| cloth(&scene).mean_reflectance(0, &part(&scene, low, high));
    assert_near(over([0.0, 0.0], [0.5, 1.0]), DVec3::ZERO);
    assert_near(over([0.5, 0.5], [1.0, 1.0]), factor);
    assert_near(over([0.5, 0.0], [1.0, 0.5]), factor * grey);
    assert_eq!(cloth(&scene).facets.len(), 1);
    assert!(scene.surfaces[0].appearance.is_none());
}

#[test]
fn images_of_one_colour_leave_the_surface_uniform() {
    let mut textured = Textured::new();
    let texture = textured.texture(2, &[[255, 188, 0, 255]; 4]);
    let scene = textured.scene(json!({
        "pbrMetallicRoughness": { "baseColorTexture": texture, "baseColorFactor": [0.5, 1.0, 1.0, 1.0] },
    }));
    assert!(cloth(&scene).appearance.is_none());
    assert_near(
        cloth(&scene).reflectance,
        DVec3::new(0.5, document::texture::srgb_to_linear(188.0 / 255.0), 0.0),
    );
}

#[test]
fn metal_is_taken_away_texel_by_texel() {
    for set in [0, 1] {
        let mut textured = Textured::new();
        if set == 1 {
            textured.attributes["TEXCOORD_1"] = textured.attributes["TEXCOORD_0"].clone();
        }
        let base = textured.texture(2, &[WHITE, BLACK]);
        let mut metal = textured.texture(2, &[[9, 9, 255, 9], [9, 9, 0, 9]]);
        metal["texCoord"] = set.into();
        let scene = textured.scene(json!({
            "pbrMetallicRoughness": { "baseColorTexture": base, "metallicRoughnessTexture": metal, "metallicFactor": 0.5 },
        }));
        // What is white is half metal. Of images that may lie differently only the means are known to each other.
        let expected = if set == 0 { 0.5 * 0.5 } else { 0.5 * 0.75 };
        assert_near(cloth(&scene).reflectance, DVec3::splat(expected));
        let left = cloth(&scene).mean_reflectance(0, &part(&scene, [0.0, 0.0], [0.5, 1.0]));
        assert_near(left, DVec3::splat(0.5));
    }
}

#[test]
fn emissive_textures_multiply_factor_and_strength() {
    let mut textured = Textured::new();
    let texture = textured.texture(2, &[BLACK, WHITE]);
    let scene = textured.scene(json!({
        "emissiveTexture": texture, "emissiveFactor": [1.0, 0.5, 0.0],
        "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1.0] },
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 4.0 } },
    }));
    let full = PI * DVec3::new(4.0, 2.0, 0.0);
    assert_near(cloth(&scene).exitance, full / 2.0);
    assert_near(cloth(&scene).mean_exitance(0, &part(&scene, [0.5, 0.0], [1.0, 1.0])), full);
    assert_near(cloth(&scene).reflectance, DVec3::splat(0.5));
    assert_eq!(scene.import_report.modelled, ["1 emissive texture", "2 emissive surfaces"]);
}

#[test]
fn vertex_colours_are_colours_of_the_surface() {
    let mut textured = Textured::new();
    textured.colours(&[[0.5, 1.0, 0.25, 1.0]; 4]);
    let material = json!({ "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1.0] } });
    let scene = textured.scene(material.clone());
    assert_eq!(cloth(&scene).reflectance, DVec3::new(0.25, 0.5, 0.125));
    assert!(cloth(&scene).appearance.is_none());
    assert_eq!(scene.import_report.modelled[0], "1 primitive with vertex colours");

    let mut textured = Textured::new();
    textured.colours(&SQUARE.map(|[x, _, _]| [x, 1.0, 1.0, 1.0]));
    let scene = textured.scene(material);
    assert_near(cloth(&scene).reflectance, DVec3::new(0.25, 0.5, 0.5));
    let right = cloth(&scene).mean_reflectance(0, &part(&scene, [0.5, 0.0], [1.0, 1.0]));
    assert_near(right, DVec3::new(0.375, 0.5, 0.5));
}

#[test]
fn light_of_an_earlier_bake_is_no_colour() {
    let mut textured = Textured::new();
    textured.colours(&[[0.5, 0.0, 0.0, 1.0]; 4]);
    textured.attributes["_IRRADIANCE"] = 0.into();
    let scene =
        textured.scene(json!({ "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1.0] } }));
    assert_eq!(cloth(&scene).reflectance, DVec3::splat(0.5));
    assert!(scene.warnings[0].contains("light of an earlier bake"), "{:?}", scene.warnings);
}

#[test]
fn alpha_masks_and_blending_take_a_part_of_the_light() {
    let look = |mode: &str, alpha: [u8; 2], factor: f64| {
        let mut textured = Textured::new();
        let texture = textured.texture(2, &[[255, 255, 255, alpha[0]], [255, 255, 255, alpha[1]]]);
        let scene = textured.scene(json!({
            "alphaMode": mode, "emissiveFactor": [1.0, 1.0, 1.0],
            "pbrMetallicRoughness": { "baseColorTexture": texture, "baseColorFactor": [0.5, 0.5, 0.5, factor] },
        }));
        let surface = cloth(&scene).clone();
        let left = surface.mean_opacity(0, &part(&scene, [0.0, 0.0], [0.5, 1.0]));
        (surface.opacity, left, surface.reflectance.x, surface.exitance.x / PI)
    };
    let near = |found: (f64, f64, f64, f64), expected: (f64, f64, f64, f64)| {
        let worst = (found.0 - expected.0)
            .abs()
            .max((found.1 - expected.1).abs())
            .max((found.2 - expected.2).abs())
            .max((found.3 - expected.3).abs());
        assert!(worst < 1e-7, "{found:?} is not {expected:?}");
    };
    near(look("OPAQUE", [0, 255], 1.0), (1.0, 1.0, 0.5, 1.0));
    near(look("MASK", [0, 255], 1.0), (0.5, 0.0, 0.25, 0.5));
    near(look("MASK", [100, 140], 1.0), (0.5, 0.0, 0.25, 0.5));
    near(look("MASK", [100, 255], 0.4), (0.0, 0.0, 0.0, 0.0));
    near(look("BLEND", [51, 255], 1.0), (0.6, 0.2, 0.3, 0.6));
    near(look("BLEND", [51, 255], 0.5), (0.3, 0.1, 0.15, 0.3));
    near(look("BLEND", [102, 102], 1.0), (0.4, 0.4, 0.2, 0.4));
}

#[test]
fn alpha_of_factor_and_vertices_needs_no_texture() {
    let look = |mode: &str, factor: f64, colours: Option<[[f32; 4]; 4]>| {
        let mut textured = Textured::new();
        if let Some(colours) = colours {
            textured.colours(&colours);
        }
        let scene = textured.scene(json!({
            "alphaMode": mode, "alphaCutoff": 0.3,
            "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, factor] },
        }));
        (cloth(&scene).opacity, cloth(&scene).reflectance.x)
    };
    assert_eq!(look("BLEND", 0.25, None), (0.25, 0.125));
    assert_eq!(look("MASK", 0.25, None), (0.0, 0.0));
    assert_eq!(look("MASK", 0.5, None), (1.0, 0.5));
    assert_eq!(look("BLEND", 1.0, Some([[1.0, 1.0, 1.0, 0.5]; 4])), (0.5, 0.25));
    let fading = look("BLEND", 1.0, Some(SQUARE.map(|[x, _, _]| [1.0, 1.0, 1.0, x])));
    assert!((fading.0 - 0.5).abs() < 1e-7 && (fading.1 - 0.25).abs() < 1e-7, "{fading:?}");
}

#[test]
fn unlit_materials_reflect_their_colour_and_emit_nothing() {
    let textured = Textured::new();
    let scene = textured.scene(json!({
        "emissiveFactor": [1.0, 1.0, 1.0], "extensions": { "KHR_materials_unlit": {} },
        "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.25, 0.125, 1.0], "metallicFactor": 1.0 },
    }));
    assert_eq!(cloth(&scene).reflectance, DVec3::new(0.5, 0.25, 0.125));
    assert_eq!(cloth(&scene).exitance, DVec3::ZERO);
    assert!(scene.warnings[0].contains("unlit, so its emission is left out"), "{:?}", scene.warnings);
}

#[test]
fn specular_glossiness_reflects_what_is_not_mirrored() {
    let mut textured = Textured::new();
    let diffuse = textured.texture(2, &[WHITE, BLACK]);
    let specular = textured.texture(2, &[[255, 0, 0, 0], [0, 255, 0, 0]]);
    let scene = textured.scene(json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": {
        "diffuseTexture": diffuse, "diffuseFactor": [0.5, 0.25, 1.0, 1.0],
        "specularGlossinessTexture": specular, "specularFactor": [0.5, 0.25, 0.0],
    } } }));
    assert_near(cloth(&scene).reflectance, DVec3::new(0.5, 0.25, 1.0) * 0.5 / 2.0);
    let scene = Textured::new().scene(json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": {
        "diffuseFactor": [0.5, 0.25, 1.0, 1.0], "specularFactor": [0.5, 0.25, 0.0],
    } } }));
    assert_eq!(cloth(&scene).reflectance, DVec3::new(0.25, 0.125, 0.5));
}

#[test]
fn transforms_choose_set_and_place() {
    let mut textured = Textured::new();
    let mut texture = textured.texture(2, &[BLACK, WHITE]);
    let other = textured.document.floats("VEC2", &[[0.0f32, 0.0]; 4]);
    textured.attributes["TEXCOORD_1"] = textured.attributes["TEXCOORD_0"].clone();
    textured.attributes["TEXCOORD_0"] = other.into();
    texture["extensions"] = json!({ "KHR_texture_transform": {
        "texCoord": 1, "scale": [0.5, 1.0], "offset": [0.5, 0.0],
    } });
    let scene = textured.scene(json!({ "pbrMetallicRoughness": { "baseColorTexture": texture } }));
    // Only the white half of the image is to be seen; at full reflectance nothing would be absorbed.
    assert_near(cloth(&scene).reflectance, DVec3::splat(0.999));
}

/// Exporters write set -1 for images without coordinates of their own; viewers take the first set.
#[test]
fn coordinates_below_the_first_set_are_the_first() {
    let mut textured = Textured::new();
    let mut texture = textured.texture(2, &[BLACK, WHITE, BLACK, WHITE]);
    // That of a transform stands above the texture's own.
    texture["texCoord"] = 1.into();
    texture["extensions"] = json!({ "KHR_texture_transform": { "texCoord": -1 } });
    let scene = textured.scene(json!({
        "pbrMetallicRoughness": { "baseColorTexture": texture, "baseColorFactor": [0.5, 0.5, 0.5, 1.0] },
    }));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let right = cloth(&scene).mean_reflectance(0, &part(&scene, [0.5, 0.0], [1.0, 1.0]));
    assert_near(right, DVec3::splat(0.5));
}

#[test]
fn broken_references_are_errors_or_warnings() {
    let mut textured = Textured::new();
    let view = textured
        .document
        .push("bufferViews", json!({ "buffer": 0, "byteOffset": 1u64 << 40, "byteLength": 9 }));
    let texture = textured.texture_of(json!({ "bufferView": view, "mimeType": "image/png" }));
    let scene = textured.scene(json!({ "pbrMetallicRoughness": { "baseColorTexture": texture } }));
    assert!(scene.warnings[0].contains("reaches outside its buffer"), "{:?}", scene.warnings);

    for image in [json!({}), json!({ "bufferView": 99, "mimeType": "image/png" })] {
        let mut textured = Textured::new();
        let texture = textured.texture_of(image);
        let document = textured.document(json!({ "pbrMetallicRoughness": { "baseColorTexture": texture } }));
        // Whatever it is, it is told, and nothing panics.
        if let Ok(scene) = import_slice(&document.glb(), &ImportOptions::default()) {
            assert!(!scene.warnings.is_empty());
        }
    }
}

#[test]
fn missing_texture_coordinates_are_told() {
    let mut textured = Textured::new();
    let texture = textured.texture(2, &[BLACK, WHITE]);
    textured.attributes.as_object_mut().unwrap().remove("TEXCOORD_0");
    let scene = textured.scene(json!({ "pbrMetallicRoughness": { "baseColorTexture": texture } }));
    assert_eq!(cloth(&scene).reflectance, DVec3::ZERO);
    assert!(scene.warnings[0].contains("has no TEXCOORD_0"), "{:?}", scene.warnings);
}

#[test]
fn what_counts_and_what_does_not_is_told() {
    let mut textured = Textured::new();
    let texture = textured.texture(2, &[BLACK, WHITE]);
    let scene = textured.scene(json!({
        "alphaMode": "MASK", "normalTexture": texture, "occlusionTexture": texture,
        "pbrMetallicRoughness": { "baseColorTexture": texture },
        "extensions": { "KHR_materials_specular": {}, "KHR_materials_volume": {} },
    }));
    assert_eq!(
        scene.import_report.modelled,
        ["1 base colour texture", "1 material with an alpha mask", "1 emissive surface"]
    );
    assert_eq!(
        scene.import_report.ignored,
        [
            "1 normal texture",
            "1 occlusion texture",
            "1 material with KHR_materials_specular",
            "1 material with KHR_materials_volume"
        ]
    );
}

#[test]
fn unused_images_are_not_decoded() {
    let mut textured = Textured::new();
    let texture = textured.texture_of(json!({ "uri": "missing.png" }));
    // Black whatever it shows, and a normal texture matters to nothing.
    let scene = textured.scene(json!({
        "normalTexture": texture, "emissiveTexture": texture,
        "pbrMetallicRoughness": { "baseColorTexture": texture, "baseColorFactor": [0, 0, 0, 1] },
    }));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn both_sides_show_the_same_image() {
    let mut textured = Textured::new();
    let texture = textured.texture(2, &[BLACK, WHITE]);
    let scene = textured
        .scene(json!({ "doubleSided": true, "pbrMetallicRoughness": { "baseColorTexture": texture } }));
    let right = part(&scene, [0.5, 0.0], [0.75, 1.0]);
    for surface in &scene.surfaces[1..3] {
        assert_near(surface.mean_reflectance(0, &right), DVec3::splat(0.999));
        assert_near(surface.reflectance, DVec3::splat(0.5));
    }
}
