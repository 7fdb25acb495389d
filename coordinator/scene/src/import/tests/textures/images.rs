//! Where images come from, and what is said of those that cannot be read.

use super::*;

/// A scene whose texture has no image but that of an extension, which the file requires, and so does the output.
fn required(extension: &str, format: &str, bytes: &[u8]) -> Scene {
    let mut textured = Textured::new();
    let view = textured.view(bytes);
    let image = textured.document.push("images", json!({ "bufferView": view, "mimeType": format }));
    let texture = json!({ "sampler": 0, "extensions": { extension: { "source": image } } });
    let texture = textured.document.push("textures", texture);
    textured.document.root["extensionsUsed"] = json!([extension]);
    textured.document.root["extensionsRequired"] = json!([extension]);
    let scene = textured
        .scene(json!({ "pbrMetallicRoughness": { "baseColorTexture": json!({ "index": texture }) } }));
    assert_eq!(scene.source.root.extensions_required, [extension]);
    scene
}

/// Four by four texels of each of six colours in two rows, the last ones cut, as UASTC without loss.
#[test]
fn ktx2_counts_as_a_png_of_its_texels_does() {
    let squares = [
        [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255]],
        [[200, 120, 40, 255], [90, 90, 90, 128], [255, 255, 255, 0]],
    ];
    let texels: Vec<[u8; 4]> =
        (0..7).flat_map(|row| (0..10).map(move |column| squares[row / 4][column / 4])).collect();
    let mut textured = Textured::new();
    let texture = textured.texture(10, &texels);
    let png = textured.scene(json!({ "pbrMetallicRoughness": { "baseColorTexture": texture } }));
    let ktx2 = required(
        "KHR_texture_basisu",
        "image/ktx2",
        include_bytes!("../../../../../../tests/fuzz/seeds/images/uastc.ktx2"),
    );
    assert!(ktx2.warnings.is_empty(), "{:?}", ktx2.warnings);
    let mean = |scene: &Scene| cloth(scene).mean_reflectance(0, &part(scene, [0.1, 0.2], [0.9, 0.7]));
    assert!(mean(&png).min_element() > 0.01);
    assert_near(mean(&ktx2), mean(&png));
}

#[test]
fn images_come_from_data_uris_files_and_extensions() {
    let texels = [BLACK, WHITE];
    let material = |texture: Value| json!({ "pbrMetallicRoughness": { "baseColorTexture": texture } });
    let half = |scene: Scene| {
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        assert_near(cloth(&scene).reflectance, DVec3::splat(0.5));
    };
    let mut textured = Textured::new();
    let data = STANDARD.encode(encoded(2, &texels, ImageFormat::Png));
    let texture = textured.texture_of(json!({ "uri": format!("data:image/png;base64,{data}") }));
    half(textured.scene(material(texture)));

    half(required("EXT_texture_webp", "image/webp", &encoded(2, &texels, ImageFormat::WebP)));

    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a picture.png"), encoded(2, &texels, ImageFormat::Png)).unwrap();
    let mut textured = Textured::new();
    let texture = textured.texture_of(json!({ "uri": "a%20picture.png" }));
    let path = folder.path().join("scene.glb");
    std::fs::write(&path, textured.document(material(texture)).glb()).unwrap();
    half(import(&path, &ImportOptions::default()).unwrap());
}

#[test]
fn unreadable_images_leave_the_factor_and_a_warning() {
    let good = encoded(2, &[BLACK, WHITE], ImageFormat::Png);
    let data = |bytes: &[u8]| format!("data:image/png;base64,{}", STANDARD.encode(bytes));
    let images = [
        (json!({ "uri": data(b"GIF89a"), "name": "icon" }), "image \"icon\" is not read: it is neither PNG"),
        (json!({ "uri": data(&good[..40]) }), "image 0 is not read: it is damaged"),
        (json!({ "uri": "beside.png" }), "may not refer to files"),
        (json!({ "uri": "data:image/png,xyz" }), "only base64 data URIs are read"),
        (json!({ "bufferView": 0, "mimeType": "image/png" }), "it is neither PNG"),
    ];
    for (image, expected) in images {
        let mut textured = Textured::new();
        let texture = textured.texture_of(image);
        let scene = textured.scene(json!({
            "pbrMetallicRoughness": { "baseColorTexture": texture, "baseColorFactor": [0.5, 0.5, 0.5, 1.0] },
        }));
        assert_eq!(cloth(&scene).reflectance, DVec3::splat(0.5));
        assert!(scene.warnings[0].contains(expected), "{expected}: {:?}", scene.warnings);
        assert!(scene.warnings[0].contains("the factors alone count"));
    }
}
