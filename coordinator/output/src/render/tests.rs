use std::collections::VecDeque;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use glam::DVec3;
use kernel::picture::{
    Camera, FinishedTile, Projection, TileRequest, TileService, decode_pixels, encode_picture,
};
use kernel::replica::{Digest, EncodedReplica};
use serde_json::{Value, json};
use worker::store::{Replica, ReplicaStore};
use worker::tile::Tile;

use super::*;
use document::ReadOptions;
use kernel::row::JobId;

/// A worker without a network, that answers the latest job first.
struct Local {
    store: ReplicaStore,
    finished: VecDeque<FinishedTile>,
}

impl Default for Local {
    fn default() -> Self {
        Self { store: ReplicaStore::new(1 << 30), finished: VecDeque::new() }
    }
}

impl TileService for Local {
    type Error = std::convert::Infallible;

    fn publish(&mut self, replica: EncodedReplica) {
        let decoded = Replica::decode(replica.kind, &replica.bytes).unwrap();
        self.store.insert(replica.digest, decoded, replica.bytes.len() as u64);
    }

    fn release(&mut self, digest: Digest) {
        self.store.remove(digest);
    }

    fn submit(&mut self, requests: Vec<(JobId, TileRequest)>) {
        for (job, request) in requests {
            let answer = Tile::new(&request.to_job(job.0), &mut self.store).unwrap().compute();
            let (pixels, _) = decode_pixels(&request, &answer).unwrap();
            self.finished.push_front(FinishedTile { job, pixels, rays: answer.rays, busy_nanoseconds: 0 });
        }
    }

    fn next(&mut self) -> Result<FinishedTile, Self::Error> {
        Ok(self.finished.pop_front().unwrap())
    }
}

/// A glTF in the making: squares of 2 x 2 in their planes z = 0.
struct Builder {
    json: Value,
    bytes: Vec<u8>,
}

const CORNERS: [[f32; 3]; 4] = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];

impl Builder {
    fn new() -> Self {
        let json = json!({
            "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [] }], "nodes": [], "meshes": [],
            "materials": [], "accessors": [], "bufferViews": [], "cameras": [],
        });
        Self { json, bytes: vec![] }
    }

    fn push(&mut self, list: &str, value: Value) -> usize {
        let list = self.json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let (offset, length) = (self.bytes.len(), values.len() * N * 4);
        self.bytes.extend(values.as_flattened().iter().flat_map(|value| value.to_le_bytes()));
        let view =
            self.push("bufferViews", json!({ "buffer": 0, "byteOffset": offset, "byteLength": length }));
        let kind = format!("VEC{N}");
        let mut accessor =
            json!({ "bufferView": view, "componentType": 5126, "count": values.len(), "type": kind });
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..N).map(|at| values.iter().map(|value| value[at]).reduce(pick).unwrap()).collect()
        };
        (accessor["min"], accessor["max"]) = (json!(bound(f32::min)), json!(bound(f32::max)));
        self.push("accessors", accessor)
    }

    /// A square with these attributes beside its positions.
    fn square(&mut self, node: Value, material: Value, attributes: &[(&str, usize)]) {
        let fan = [0, 1, 2, 0, 2, 3].map(|corner| CORNERS[corner]);
        let mut all = json!({ "POSITION": self.floats(&fan) });
        attributes.iter().for_each(|(name, accessor)| all[name] = json!(accessor));
        let material = self.push("materials", material);
        let mesh =
            self.push("meshes", json!({ "primitives": [{ "attributes": all, "material": material }] }));
        let mut node = node;
        node["mesh"] = json!(mesh);
        self.node(node);
    }

    /// One value per corner of a square.
    fn corners<const N: usize>(&mut self, values: [[f32; N]; 4]) -> usize {
        self.floats(&[0, 1, 2, 0, 2, 3].map(|corner| values[corner]))
    }

    fn node(&mut self, node: Value) {
        let node = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(node));
    }

    fn camera(&mut self, name: &str, translation: [f64; 3], camera: Value) {
        let camera = self.push("cameras", camera);
        self.node(json!({ "name": name, "translation": translation, "scale": [3, 3, 3], "camera": camera }));
    }

    fn read(mut self) -> LitFile {
        let data = BASE64_STANDARD.encode(&self.bytes);
        let uri = format!("data:application/octet-stream;base64,{data}");
        self.json["buffers"] = json!([{ "byteLength": self.bytes.len(), "uri": uri }]);
        let lists = self.json.as_object_mut().unwrap();
        lists.retain(|_, list| list != &json!([]));
        let folder = tempfile::tempdir().unwrap();
        let path: PathBuf = folder.path().join("lit.gltf");
        std::fs::write(&path, self.json.to_string()).unwrap();
        read_lit(&path, &ReadOptions::default()).unwrap()
    }
}

fn unlit(base: [f64; 4]) -> Value {
    json!({
        "pbrMetallicRoughness": { "baseColorFactor": base, "metallicFactor": 0 },
        "extensions": { "KHR_materials_unlit": {} },
    })
}

/// A picture of the 2 x 2 square around the origin from z = 5, by parallel rays.
fn front(file: &LitFile, size: [u32; 2], background: DVec3) -> Picture {
    let camera = Camera {
        eye: file.frame.to_frame(DVec3::Z * 5.0),
        right: DVec3::X,
        up: DVec3::Y,
        forward: DVec3::NEG_Z,
        projection: Projection::Parallel { half: [1.0 / file.frame.scale; 2] },
        near: 0.0,
    };
    take(file, camera, size, background)
}

fn take(file: &LitFile, camera: Camera, size: [u32; 2], background: DVec3) -> Picture {
    let settings = TileSettings { camera, size, samples: 1, background };
    render_tiles(&mut Local::default(), encode_picture(&file.scene), &settings, &mut |_, _| ()).unwrap()
}

fn at(picture: &Picture, x: u32, y: u32) -> DVec3 {
    DVec3::from_array(picture.pixels[(y * picture.size[0] + x) as usize].map(f64::from))
}

fn assert_near(found: DVec3, expected: [f64; 3]) {
    assert!((found - DVec3::from_array(expected)).abs().max_element() < 1e-5, "{found} {expected:?}");
}

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

/// A large dark square with a small white one on it, whose middle is at (1, 0.5, 0), and cameras.
fn with_cameras() -> LitFile {
    let mut builder = Builder::new();
    let irradiance = builder.corners([[PI as f32; 3]; 4]);
    let lit = [("_IRRADIANCE", irradiance)];
    builder.square(json!({ "scale": [8, 8, 1] }), unlit([0.25, 0.25, 0.25, 1.0]), &lit);
    let small = json!({ "translation": [1, 0.5, 0.001], "scale": [0.0626, 0.0626, 1] });
    builder.square(small, unlit([1.0; 4]), &lit);
    // 4 high at a distance of 4, and 8 wide.
    let angle = 2.0 * 0.5_f64.atan();
    builder.camera(
        "near",
        [0.0, 0.0, 4.0],
        json!({ "type": "perspective", "perspective": { "yfov": angle, "aspectRatio": 2, "znear": 0.1 } }),
    );
    builder.camera(
        "flat",
        [0.0, 0.0, 90.0],
        json!({ "type": "orthographic", "orthographic": { "xmag": 4, "ymag": 2, "znear": 0.1, "zfar": 99 } }),
    );
    builder.read()
}

#[test]
fn a_known_point_lands_on_a_known_pixel() {
    let file = with_cameras();
    let look_at = LookAt {
        eye: DVec3::new(0.0, 0.0, 4.0),
        target: DVec3::ZERO,
        up: DVec3::Y,
        height_angle: 2.0 * 0.5_f64.atan(),
    };
    let named = |name: &str| {
        let choice = CameraChoice::OfFile(name.to_owned());
        let camera = choice.of_file(&file.cameras).unwrap().unwrap();
        assert_eq!(camera.aspect(), Some(2.0));
        camera.camera(&file.frame, 2.0).unwrap()
    };
    assert_eq!(CameraChoice::Any.of_file(&file.cameras).unwrap().unwrap().names, ["near"]);
    let cameras = [named("near"), named("0"), named("flat"), look_at.camera(&file.frame, 2.0).unwrap()];
    for camera in cameras {
        // 16 pixels to a unit; the small square is 2 pixels wide.
        let picture = take(&file, camera, [128, 64], DVec3::ZERO);
        let white: Vec<[u32; 2]> = (0..128)
            .flat_map(|x| (0..64).map(move |y| [x, y]))
            .filter(|[x, y]| at(&picture, *x, *y).x > 0.5)
            .collect();
        assert_eq!(white, [[79, 23], [79, 24], [80, 23], [80, 24]], "{camera:?}");
    }
    let unknown = CameraChoice::OfFile("far".into()).of_file(&file.cameras).unwrap_err();
    assert!(unknown.to_string().contains("it has 0: \"near\", 1: \"flat\""), "{unknown}");
    let blind = LookAt { target: look_at.eye, ..look_at };
    assert!(blind.camera(&file.frame, 1.0).is_err());
    let along = LookAt { up: DVec3::Z, ..look_at };
    assert!(along.camera(&file.frame, 1.0).is_err());
}

#[test]
fn a_picture_does_not_depend_on_its_tiles() {
    let file = with_cameras();
    let camera = file.cameras[0].camera(&file.frame, 1.5).unwrap();
    let scene = encode_picture(&file.scene);
    let settings = TileSettings { camera, size: [201, 134], samples: 7, background: DVec3::ONE };
    let picture = render_tiles(&mut Local::default(), scene.clone(), &settings, &mut |_, _| ()).unwrap();
    assert_eq!(picture.rays, 201 * 134 * 7);
    let mut whole = Local::default();
    whole.publish(scene.clone());
    let request = TileRequest {
        picture: scene.digest,
        camera,
        size: settings.size,
        corner: [0, 0],
        extent: settings.size,
        samples: 7,
        background: DVec3::ONE,
    };
    whole.submit(vec![(JobId(0), request)]);
    assert!(whole.next().unwrap().pixels == picture.pixels);
    let none = TileSettings { size: [0, 9], ..settings };
    assert!(render_tiles(&mut Local::default(), scene, &none, &mut |_, _| ()).is_err());
}

#[test]
fn a_view_is_chosen_that_sees_the_scene() {
    // A square seen from its front only.
    let mut builder = Builder::new();
    let irradiance = builder.corners([[1.0; 3]; 4]);
    builder.square(json!({}), unlit([1.0; 4]), &[("_IRRADIANCE", irradiance)]);
    let file = builder.read();
    for aspect in [0.5, 1.0, 2.0] {
        let camera = choose_view(&file.scene, aspect);
        assert!(camera.eye.z > 0.0, "{camera:?}");
        for corner in CORNERS {
            let corner = file.frame.to_frame(DVec3::from_array(corner.map(f64::from)));
            let place = camera.place(corner).unwrap();
            assert!(place.iter().all(|at| (0.0..=1.0).contains(at)), "{aspect} {place:?}");
        }
    }
}

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
