use super::*;

fn caption() -> Caption {
    Caption { exposure: 0.5, tone_map: ToneMap::Linear, camera: "near".to_owned(), samples: 3 }
}

#[test]
fn exr_keeps_every_bit_and_states_the_exposure() {
    let pixels = vec![[0.0, 1e-30, 1e30], [0.1, 0.2, 0.3], [7.0, 8.0, 9.0], [1.0, 2.0, f32::MAX]];
    let picture = Picture { size: [1, 4], pixels, rays: 0, busy_nanoseconds: 0 };
    let bytes = encode_exr(&picture, &caption()).unwrap();
    assert_eq!(bytes, encode_exr(&picture, &caption()).unwrap());
    type Place = exr::math::Vec2<usize>;
    let read = exr::prelude::read_first_rgba_layer_from_file;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.exr");
    std::fs::write(&path, bytes).unwrap();
    let image = read(
        &path,
        |size: Place, _: &_| vec![[0.0_f32; 3]; size.width() * size.height()],
        |pixels: &mut Vec<[f32; 3]>, place: Place, (r, g, b, _): (f32, f32, f32, f32)| {
            pixels[place.y()] = [r, g, b]
        },
    )
    .unwrap();
    assert_eq!(image.layer_data.channel_data.pixels, picture.pixels);
    let comments = image.layer_data.attributes.comments.unwrap().to_string();
    assert!(comments.contains("Exposure: 0.5 "), "{comments}");
}

#[test]
fn png_shows_exposed_srgb_and_states_the_exposure() {
    let value = |shown: f64| (shown / PI / 0.5) as f32;
    let pixels = vec![[value(0.5), 0.0, value(2.0)]];
    let picture = Picture { size: [1, 1], pixels, rays: 0, busy_nanoseconds: 0 };
    let bytes = encode_png(&picture, &caption()).unwrap();
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let mut shown = [0; 3];
    reader.next_frame(&mut shown).unwrap();
    assert_eq!(shown, [188, 0, 255]);
    let texts = &reader.info().uncompressed_latin1_text;
    let exposure = texts.iter().find(|chunk| chunk.keyword == "Exposure").unwrap();
    assert!(exposure.text.starts_with("0.5 "), "{}", exposure.text);
    assert_eq!(PictureFormat::of(Path::new("a/b.PNG")), Some(PictureFormat::Png));
    assert_eq!(PictureFormat::of(Path::new("a/b.jpg")), None);
}

#[test]
fn a_suitable_exposure_clips_a_twentieth() {
    let mut pixels: Vec<[f32; 3]> = (1..=100).map(|value| [0.0, value as f32, 0.0]).collect();
    pixels.extend([[0.0; 3]; 50]);
    let picture = Picture { size: [150, 1], pixels, rays: 0, busy_nanoseconds: 0 };
    assert!((suitable_exposure(&picture) * PI * 96.0 - 1.0).abs() < 1e-12);
    let black = Picture { size: [1, 1], pixels: vec![[0.0; 3]], rays: 0, busy_nanoseconds: 0 };
    assert_eq!(suitable_exposure(&black), 1.0);
}
