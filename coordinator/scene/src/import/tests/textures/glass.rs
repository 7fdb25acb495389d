//! KHR_materials_transmission.

use super::*;

#[test]
fn transmission_lets_the_surface_s_colour_through() {
    let glass = |pbr: Value, transmission: Value| {
        let extensions = json!({ "KHR_materials_transmission": transmission });
        let scene = Textured::new().scene(json!({
            "pbrMetallicRoughness": pbr, "emissiveFactor": [0.1, 0.1, 0.1], "extensions": extensions,
        }));
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let cloth = cloth(&scene);
        assert_near(cloth.exitance, DVec3::splat(f64::from(0.1_f32) * PI));
        (cloth.reflectance, cloth.opacity)
    };
    let half = json!({ "transmissionFactor": 0.5 });
    let (reflectance, opacity) = glass(json!({ "baseColorFactor": [0.75, 0.5, 0.25, 1.0] }), half.clone());
    assert_near(reflectance, DVec3::new(0.375, 0.25, 0.125));
    assert!((opacity - 0.75).abs() < 1e-12, "{opacity}");
    // Metal lets nothing through, and reflects none of it.
    let (reflectance, opacity) = glass(json!({ "metallicFactor": 0.5 }), half);
    assert_near(reflectance, DVec3::splat(0.25));
    assert!((opacity - 0.75).abs() < 1e-12, "{opacity}");
    // Clear glass reflects nothing, and its glow is seen though it hides nothing.
    let (reflectance, opacity) = glass(json!({}), json!({ "transmissionFactor": 1.0 }));
    assert_eq!(reflectance, DVec3::ZERO);
    assert!(opacity > 0.0 && opacity < 0.01, "{opacity}");
}

/// A dark frame and its clear glass on one image, in one polygon: means would let half of the light through the frame.
#[test]
fn transmission_and_colour_are_multiplied_texel_by_texel() {
    let mut textured = Textured::new();
    let base = textured.texture(2, &[[63, 63, 63, 255], WHITE]);
    let texture = textured.texture(2, &[[0, 255, 255, 255], [255, 0, 0, 255]]);
    let scene = textured.scene(json!({
        "pbrMetallicRoughness": { "baseColorTexture": base },
        "extensions": { "KHR_materials_transmission": {
            "transmissionFactor": 1.0, "transmissionTexture": texture,
        } },
    }));
    let frame = document::texture::srgb_to_linear(63.0 / 255.0);
    assert_near(cloth(&scene).reflectance, DVec3::splat(frame / 2.0));
    assert!((cloth(&scene).opacity - 0.5).abs() < 1e-7, "{}", cloth(&scene).opacity);
}

#[test]
fn no_colour_makes_light_of_what_passes() {
    for (mode, alpha) in [("OPAQUE", 1.0), ("BLEND", 0.5)] {
        let scene = Textured::new().scene(json!({
            "alphaMode": mode,
            "pbrMetallicRoughness": { "baseColorFactor": [2.0, 0.5, 0.0, alpha] },
            "extensions": { "KHR_materials_transmission": { "transmissionFactor": 0.5 } },
        }));
        let cloth = cloth(&scene);
        assert!(cloth.reflectance.max_element() <= cloth.opacity, "{mode}: {cloth:?}");
        assert_near(cloth.reflectance, DVec3::new(alpha, 0.5 * alpha, 0.0) / 2.0);
    }
}

#[test]
fn transmission_textures_say_where_light_passes() {
    let mut textured = Textured::new();
    let base = textured.texture(1, &[[188, 188, 188, 255]]);
    let texture = textured.texture(2, &[[255, 0, 0, 255], [0, 255, 255, 255]]);
    let scene = textured.scene(json!({
        "pbrMetallicRoughness": { "baseColorTexture": base, "baseColorFactor": [1.0, 0.5, 0.5, 1.0] },
        "extensions": { "KHR_materials_transmission": {
            "transmissionFactor": 0.75, "transmissionTexture": texture,
        } },
    }));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let colour = document::texture::srgb_to_linear(188.0 / 255.0) * DVec3::new(1.0, 0.5, 0.5);
    for (low, transmitted) in [(0.0, 0.75), (0.5, 0.0)] {
        let half = part(&scene, [low, 0.0], [low + 0.5, 1.0]);
        let (reflectance, _, opacity) = cloth(&scene).mean_material(0, &half);
        assert_near(reflectance, colour * (1.0 - transmitted));
        assert!((opacity - (1.0 - transmitted * colour.element_sum() / 3.0)).abs() < 1e-7, "{opacity}");
    }
    assert_eq!(
        scene.import_report.modelled,
        [
            "1 base colour texture",
            "1 transmission texture",
            "1 material with transmission",
            "1 emissive surface"
        ]
    );
}
