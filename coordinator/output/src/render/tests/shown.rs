use super::*;

#[test]
fn a_lit_square_has_reflectance_times_irradiance_over_pi() {
    let mut builder = Builder::new();
    builder.json["asset"]["extras"] = json!({ "halflight": { "exposure": 0.25, "sky": [1, 2, 3] } });
    let irradiance = builder.corners([[0.0, 2.0, 8.0], [4.0, 2.0, 8.0], [4.0, 2.0, 8.0], [0.0, 2.0, 8.0]]);
    let (colours, tint) = (builder.corners([[0.3; 3]; 4]), builder.corners([[1.0, 0.5, 0.25]; 4]));
    builder.square(
        json!({}),
        unlit([0.5, 0.5, 0.5, 1.0]),
        &[("_IRRADIANCE", irradiance), ("COLOR_0", colours), ("_COLOR_0", tint)],
    );
    let file = builder.read();
    assert_eq!((file.light, file.exposure), (LightOfFile::Irradiance, Some(0.25)));
    assert_eq!(file.sky, Some(DVec3::new(1.0, 2.0, 3.0)));
    assert!(file.warnings.is_empty(), "{:?}", file.warnings);
    let picture = front(&file, [8, 8], DVec3::ZERO);
    for x in 0..8 {
        let red = 0.5 * 4.0 * (f64::from(x) + 0.5) / 8.0 / PI;
        assert_near(at(&picture, x, 3), [red, 0.5 / PI, 1.0 / PI]);
    }
}

/// A page of two texels, 1 and less.
#[test]
fn a_lightmap_is_light_in_both_encodings() {
    let srgb = page(png::ColorType::Rgb, 2, &[255, 255, 255, 188, 188, 188]);
    let rgbm = page(png::ColorType::Rgba, 2, &[255, 255, 255, 255, 255, 255, 255, 51]);
    for (encoding, page, right) in [("srgb", srgb, 0.502_886), ("rgbm", rgbm, 0.2)] {
        let mut builder = Builder::new();
        let lightmap = json!({ "encoding": encoding });
        builder.json["asset"]["extras"] = json!({ "halflight": { "exposure": 0.25, "lightmap": lightmap } });
        builder.json["images"] = json!([{ "uri": page }]);
        builder.json["samplers"] = json!([{ "magFilter": 9728, "wrapS": 33071, "wrapT": 33071 }]);
        builder.json["textures"] = json!([{ "source": 0, "sampler": 0 }]);
        // The transform swaps the halves of the page.
        let places = builder.corners([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        let colours = builder.corners([[0.5, 1.0, 1.0]; 4]);
        let transform = json!({ "KHR_texture_transform": { "scale": [-1.0, 1.0], "offset": [1.0, 0.0] } });
        let link = json!({ "index": 0, "texCoord": 1, "intensity": PI, "extensions": transform });
        let material = json!({
            "pbrMetallicRoughness": { "baseColorFactor": [1.0, 0.5, 0.25, 1.0], "metallicFactor": 0.5 },
            "extensions": { "MOZ_lightmap": link },
        });
        builder.square(json!({}), material, &[("TEXCOORD_1", places), ("COLOR_0", colours)]);
        let file = builder.read();
        assert_eq!((file.light, file.exposure), (LightOfFile::Lightmaps, Some(0.25)));
        assert!(file.warnings.is_empty(), "{:?}", file.warnings);
        let picture = front(&file, [4, 4], DVec3::ZERO);
        for (x, light) in [(0, right), (1, right), (2, 1.0), (3, 1.0)] {
            assert_near(at(&picture, x, 2), [0.25, 0.25, 0.125].map(|part| part * light));
        }
    }
}

/// A square with this material and a lightmap of irradiance pi all over, and one beside it with light at its vertices or none.
fn with_lightmap(material: Value, page: &str, is_placed: bool, beside: Option<f32>) -> (LitFile, DVec3) {
    let mut builder = Builder::new();
    builder.json["asset"]["extras"] = json!({ "halflight": { "exposure": 0.25 } });
    builder.json["images"] = json!([{ "uri": page }]);
    builder.json["textures"] = json!([{ "source": 0 }]);
    let mut material = material;
    material["extensions"]["MOZ_lightmap"] = json!({ "index": 0, "texCoord": 1, "intensity": PI });
    let places = builder.corners([[0.0, 0.0]; 4]);
    let colours = builder.corners([[0.5; 3]; 4]);
    let set = if is_placed { "TEXCOORD_1" } else { "TEXCOORD_0" };
    builder.square(json!({}), material, &[(set, places), ("COLOR_0", colours)]);
    if let Some(light) = beside {
        let irradiance = builder.corners([[light; 3]; 4]);
        let away = json!({ "translation": [9, 0, 0] });
        builder.square(away, unlit([1.0; 4]), &[("_IRRADIANCE", irradiance)]);
    }
    let file = builder.read();
    let seen = at(&front(&file, [2, 2], DVec3::ZERO), 0, 0);
    (file, seen)
}

#[test]
fn a_lightmap_lights_the_diffuse_part_of_any_material() {
    let plain = |factors: Value| json!({ "pbrMetallicRoughness": factors });
    let mut unlit = plain(json!({ "baseColorFactor": [0.8, 0.8, 0.8, 1.0] }));
    unlit["extensions"] = json!({ "KHR_materials_unlit": {} });
    let glossy = json!({ "diffuseFactor": [0.8, 0.8, 0.8, 1.0], "specularFactor": [0.5, 0.25, 0.0] });
    let of_gloss = |own: Value| json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": own } });
    let mut glowing = plain(json!({ "metallicFactor": 0.0 }));
    glowing["emissiveFactor"] = json!([1.0, 1.0, 1.0]);
    let mut glass = plain(json!({ "metallicFactor": 0.0, "baseColorFactor": [0.4, 0.4, 0.4, 1.0] }));
    glass["extensions"] = json!({ "KHR_materials_transmission": { "transmissionFactor": 0.25 } });
    let mut bulb = glass.clone();
    bulb["emissiveFactor"] = json!([1.0, 1.0, 1.0]);
    for (name, material, expected) in [
        ("glass, three quarters of whose colour is seen before black", glass, 0.15),
        ("all of its glow", bulb, 1.15),
        ("metal", plain(json!({ "metallicFactor": 0.25 })), 0.375),
        ("unlit", unlit, 0.4),
        ("glossy", of_gloss(glossy), 0.2),
        ("white and glossy", of_gloss(json!({ "specularFactor": [0.5, 0.25, 0.0] })), 0.25),
        ("glowing", glowing, 1.5),
    ] {
        let (file, seen) = with_lightmap(material, &white_page(), true, None);
        assert!(file.warnings.is_empty(), "{name}: {:?}", file.warnings);
        assert_near(seen, [expected; 3]);
    }
}

#[test]
fn without_its_lightmap_a_surface_is_dark_whatever_else_is_lit() {
    let material = || json!({ "pbrMetallicRoughness": { "metallicFactor": 0.0 } });
    let white = white_page();
    for (page, is_placed, beside, expected) in [
        (white.as_str(), true, Some(1.0), [0.5; 3]),
        (white.as_str(), false, None, [0.0; 3]),
        ("no-such-page.png", true, None, [0.0; 3]),
        ("no-such-page.png", true, Some(1.0), [0.0; 3]),
    ] {
        let (file, seen) = with_lightmap(material(), page, is_placed, beside);
        let light = if beside.is_some() { LightOfFile::Irradiance } else { LightOfFile::Lightmaps };
        assert_eq!(file.light, light);
        assert_near(seen, expected);
        let said = file.warnings.iter().any(|warning| warning.starts_with("1 primitive is without light"));
        assert_eq!(said, expected == [0.0; 3], "{:?}", file.warnings);
    }
}

/// An image of one line, as a data URI.
fn page(colour: png::ColorType, width: u32, bytes: &[u8]) -> String {
    let mut file = vec![];
    let mut encoder = png::Encoder::new(&mut file, width, 1);
    encoder.set_color(colour);
    encoder.write_header().unwrap().write_image_data(bytes).unwrap();
    format!("data:image/png;base64,{}", BASE64_STANDARD.encode(&file))
}

/// An image of one white pixel.
fn white_page() -> String {
    page(png::ColorType::Rgb, 1, &[255; 3])
}

#[test]
fn colours_stand_for_light_where_there_is_no_other() {
    let square = |extras: Value| {
        let mut builder = Builder::new();
        builder.json["asset"]["extras"] = extras;
        let colours = builder.corners([[0.5, 0.25, 1.0]; 4]);
        builder.square(json!({}), unlit([0.5, 1.0, 0.125, 1.0]), &[("COLOR_0", colours)]);
        builder.read()
    };
    let clamped = square(json!({ "halflight": { "exposure": 0.25 } }));
    assert_eq!(clamped.light, LightOfFile::ExposedColours);
    assert_near(at(&front(&clamped, [2, 2], DVec3::ZERO), 0, 0), [1.0 / PI, 1.0 / PI, 0.5 / PI]);
    let dark = square(Value::Null);
    assert_eq!((dark.light, dark.exposure), (LightOfFile::None, Some(1.0)));
    assert!(dark.warnings[0].contains("no light"), "{:?}", dark.warnings);
    // Base colour x COLOR_0, as any viewer shows it.
    let shown = ToneMap::Linear.apply(&front(&dark, [2, 2], DVec3::ZERO), 1.0);
    assert_near(shown[0], [0.25, 0.25, 0.125]);
}

#[test]
fn metals_and_lamps_that_are_not_unlit_show_diffuse_light_and_emission() {
    let mut builder = Builder::new();
    let irradiance = builder.corners([[PI as f32; 3]; 4]);
    let material = json!({
        "pbrMetallicRoughness": { "baseColorFactor": [1, 1, 1, 1], "metallicFactor": 0.75 },
        "emissiveFactor": [1, 0.5, 0],
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 4 } },
    });
    builder.square(json!({}), material, &[("_IRRADIANCE", irradiance)]);
    let picture = front(&builder.read(), [2, 2], DVec3::ZERO);
    assert_near(at(&picture, 1, 1), [4.25, 2.25, 0.25]);
}

#[test]
fn fronts_are_seen_and_backs_where_both_sides_are_and_mirrored_nodes_face_the_same_way() {
    let background = DVec3::new(0.0, 0.0, 9.0);
    let seen = |node: Value, double_sided: bool| {
        let mut builder = Builder::new();
        let mut material = unlit([1.0, 0.0, 0.0, 1.0]);
        material["doubleSided"] = json!(double_sided);
        builder.square(node, material, &[]);
        at(&front(&builder.read(), [2, 2], background), 0, 0) != background
    };
    assert!(seen(json!({}), false));
    let turned = json!({ "rotation": [0, 1, 0, 0] });
    assert!(!seen(turned.clone(), false));
    assert!(seen(turned, true));
    assert!(seen(json!({ "scale": [-1, 1, 1] }), false));
    assert!(!seen(json!({ "scale": [1, 1, -1] }), false), "mirrored in its own plane it looks away");
}

/// Red, green; blue, a hole: as PNG.
fn image() -> String {
    let mut bytes = vec![];
    let mut encoder = png::Encoder::new(&mut bytes, 2, 2);
    encoder.set_color(png::ColorType::Rgba);
    let texels = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 128], [255, 255, 255, 0]];
    encoder.write_header().unwrap().write_image_data(texels.as_flattened()).unwrap();
    format!("data:image/png;base64,{}", BASE64_STANDARD.encode(bytes))
}

/// A square with the image, over a white one behind it.
fn textured(image: &str, alpha: Value, transform: Value) -> LitFile {
    let mut builder = Builder::new();
    builder.json["images"] = json!([{ "uri": image }]);
    builder.json["samplers"] = json!([{ "magFilter": 9728 }]);
    builder.json["textures"] = json!([{ "source": 0, "sampler": 0 }]);
    let coordinates = builder.corners([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
    let irradiance = builder.corners([[PI as f32; 3]; 4]);
    let mut material = unlit([1.0; 4]);
    material["pbrMetallicRoughness"]["baseColorTexture"] =
        json!({ "index": 0, "extensions": { "KHR_texture_transform": transform } });
    material["alphaMode"] = alpha;
    builder.square(json!({}), material, &[("TEXCOORD_0", coordinates), ("_IRRADIANCE", irradiance)]);
    builder.square(json!({ "translation": [0, 0, -1] }), unlit([1.0; 4]), &[("_IRRADIANCE", irradiance)]);
    builder.read()
}

#[test]
fn textures_are_placed_transformed_cut_out_and_blended() {
    let (red, green, blue, white) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0; 3]);
    let pixels = |alpha: &str, transform: Value| {
        let picture = front(&textured(&image(), json!(alpha), transform), [2, 2], DVec3::ZERO);
        [at(&picture, 0, 0), at(&picture, 1, 0), at(&picture, 0, 1), at(&picture, 1, 1)]
    };
    let check = |found: [DVec3; 4], expected: [[f64; 3]; 4]| {
        found.into_iter().zip(expected).for_each(|(found, expected)| assert_near(found, expected));
    };
    check(pixels("OPAQUE", json!({})), [red, green, blue, white]);
    check(pixels("OPAQUE", json!({ "offset": [0.5, 0] })), [green, red, white, blue]);
    check(pixels("MASK", json!({})), [red, green, blue, white]);
    let half = 128.0 / 255.0;
    check(pixels("BLEND", json!({})), [red, green, [1.0 - half, 1.0 - half, 1.0], white]);
}

#[test]
fn an_image_that_cannot_be_had_is_a_warning() {
    for image in ["data:image/png;base64,AAAA", "missing.png", "../outside.png", "http://example.org/a.png"] {
        let file = textured(image, json!("OPAQUE"), json!({}));
        assert!(file.warnings.iter().any(|text| text.contains("image 0 is not read")), "{:?}", file.warnings);
        assert_near(at(&front(&file, [2, 2], DVec3::ZERO), 0, 0), [1.0; 3]);
    }
}
