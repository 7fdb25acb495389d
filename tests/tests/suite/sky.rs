//! Skies, in whole bakes: a uniform one against view factors, images against what they stand for.

use std::f64::consts::PI;
use std::io::Cursor;
use std::sync::Arc;

use bake::{BakeSettings, Baked, KeptLight, NewLight, RowStrategy, relight};
use document::sky::Projection;
use glam::{DMat4, DQuat, DVec3};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use scene::Scene;
use scene::{ImportOptions, SkyImage, SkyPattern, import_slice};
use serde_json::{Value, json};
use tests::baking::{baked, mean_irradiance, vertices_of};
use tests::builder::{Material, SceneBuilder, pack};
use tests::painting::Painting;
use tests::shapes::{self, Polygon};

/// Reflectance at which reflected light does not count but radiosity still drives the mesh.
const NEARLY_BLACK: f64 = 1e-6;

/// Radiance of the sky.
const RADIANCE: DVec3 = DVec3::new(1.0, 2.0, 4.0);

/// Exact rows have a sky of polygons, hemisphere rows one by rays, with this noise at most.
const STRATEGIES: [RowStrategy; 2] = [RowStrategy::Exact, RowStrategy::Gather];
const NOISE: f64 = 0.02;

fn under_sky(builder: &SceneBuilder, settings: &BakeSettings) -> (Scene, Baked) {
    let options = ImportOptions { sky: RADIANCE, ..ImportOptions::default() };
    let scene = import_slice(&builder.glb(), &options).unwrap_or_else(|error| panic!("{error}"));
    let baked = baked(&scene, settings);
    (scene, baked)
}

/// A horizontal square about a place, lit from above.
fn plate(middle: DVec3, half: f64) -> Polygon {
    let corner = |x: f64, z: f64| middle + DVec3::new(x * half, 0.0, z * half);
    vec![corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)]
}

/// Form factor from a point to a wall that stands on the ground at this distance, this high, and so long to either side.
fn to_wall(distance: f64, height: f64, half: f64) -> f64 {
    let slant = distance.hypot(height);
    ((half / distance).atan() - distance / slant * (half / slant).atan()) / PI
}

/// pi L, whichever way a plate looks; what it reflects leaves the scene again.
#[test]
fn free_plates_get_pi_times_the_radiance() {
    let up = plate(DVec3::ZERO, 1.0);
    let down = up.iter().rev().copied().collect();
    let tilted = vec![DVec3::ZERO, DVec3::new(1.0, 0.5, 0.2), DVec3::new(0.0, 2.0, 1.0)];
    for plate in [up, down, tilted] {
        let builder = SceneBuilder::new().part("plate", &[plate], Material::grey(0.2));
        let (_, baked) = under_sky(&builder, &BakeSettings::default());
        for vertex in vertices_of(&baked.lit, 0) {
            let error = (vertex.irradiance / (PI * RADIANCE) - 1.0).abs().max_element();
            assert!(error <= 1e-4, "off by {error:e}");
        }
    }
    let alone = SceneBuilder::new().part("plate", &[plate(DVec3::ZERO, 1.0)], Material::grey(0.5));
    let (_, baked) = under_sky(&alone, &BakeSettings::default());
    let balance = &baked.report.balance;
    let expected = 4.0 * PI * RADIANCE;
    assert!((balance.emitted[2] / expected.z - 1.0).abs() <= 1e-4, "{balance:?}");
    assert!((balance.escaped[2] / balance.emitted[2] - 0.5).abs() <= 1e-4, "{balance:?}");
    assert!(balance.relative_imbalance().abs() <= 1e-6, "{balance:?}");
    assert!(baked.report.warnings.is_empty(), "{:?}", baked.report.warnings);
}

/// Boards on the ground, with gaps between them: light is interpolated there between points that see more of the sky than others.
#[test]
fn nothing_under_a_sky_gets_more_than_open_ground() {
    let board = |index: usize| {
        let (x, z) = (0.27 * (index % 20) as f64, 0.12 * (index / 20) as f64);
        shapes::box_facing_out(DVec3::new(x, 0.002, z), DVec3::new(x + 0.25, 0.06, z + 0.1))
    };
    let boards: Vec<Polygon> = (0..500).flat_map(board).collect();

    let builder = SceneBuilder::new()
        .part("ground", &[plate(DVec3::new(2.7, 0.0, 1.5), 8.0)], Material::grey(0.8))
        .part("boards", &boards, Material::grey(0.8));
    let settings = BakeSettings { rows: RowStrategy::Gather, ..BakeSettings::for_error(0.1) };
    let (_, baked) = under_sky(&builder, &settings);
    let most = baked.lit.vertices.iter().map(|vertex| vertex.irradiance.x / (PI * RADIANCE.x));
    let most = most.fold(0.0, f64::max);
    assert!(most <= 1.0 + 3.0 * NOISE, "{most} of what open ground gets");
}

/// What a pane lets through falls on the ground, and counts once.
#[test]
fn light_through_a_pane_is_accounted_for() {
    let builder = SceneBuilder::new().part("ground", &[plate(DVec3::ZERO, 1.0)], Material::grey(0.5)).part(
        "pane",
        &[plate(DVec3::new(0.2, 0.3, 0.0), 0.6)],
        Material::grey(0.5).double_sided(),
    );
    let transparent = |material: &mut Value| {
        material["alphaMode"] = json!("BLEND");
        material["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.5, 0.5, 0.5, 0.3]);
    };
    let glb = Painting::new(&builder).material(1, transparent).glb();
    let options = ImportOptions { sky: RADIANCE, ..ImportOptions::default() };
    let scene = import_slice(&glb, &options).unwrap_or_else(|error| panic!("{error}"));
    let balance = baked(&scene, &BakeSettings::default()).report.balance;
    assert!(balance.relative_imbalance().abs() <= 0.005, "{balance:?}");
    // The ground and the upper side of the pane get most of the sky; the pane stops .3 of its part.
    let falls_in = 4.0 * PI * RADIANCE.x;
    assert!((1.0..1.1).contains(&(balance.emitted[0] / falls_in)), "{balance:?}");
}

/// Beside a long wall the ground sees what the wall leaves of the sky.
#[test]
fn ground_beside_a_wall() {
    let (height, half) = (3.0, 50.0);
    let wall = vec![
        DVec3::new(0.0, 0.0, half),
        DVec3::new(0.0, 0.0, -half),
        DVec3::new(0.0, height, -half),
        DVec3::new(0.0, height, half),
    ];
    for (distance, rows) in [0.5, 2.0, 10.0].into_iter().flat_map(|own| STRATEGIES.map(|rows| (own, rows))) {
        let builder = SceneBuilder::new()
            .part("ground", &[plate(DVec3::new(distance, 0.0, 0.0), 0.05)], Material::grey(NEARLY_BLACK))
            .part("wall", std::slice::from_ref(&wall), Material::grey(0.0).double_sided());
        let (_, baked) = under_sky(&builder, &BakeSettings { rows, ..BakeSettings::default() });
        let found = mean_irradiance(&baked.lit, 0);
        // Over the little plate the factor is next to linear: its mean is that of the middle.
        let expected = PI * RADIANCE * (1.0 - to_wall(distance, height, half));
        let error = (found / expected - 1.0).abs().max_element();
        let most = if rows == RowStrategy::Exact { 2e-4 } else { NOISE };
        assert!(error <= most, "{distance}, {rows:?}: {found}, not {expected}, off by {error:e}");
    }
}

/// A closed room is dark, and a courtyard sees what its walls leave open.
#[test]
fn courtyard_and_closed_room() {
    let yard: Vec<Polygon> =
        shapes::unit_room().into_iter().filter(|wall| wall.iter().any(|corner| corner.y != 1.0)).collect();
    let walls: Vec<Polygon> =
        yard.iter().filter(|wall| wall.iter().any(|corner| corner.y != 0.0)).cloned().collect();
    let builder = SceneBuilder::new()
        .part("floor", &[plate(DVec3::new(0.5, 0.0, 0.5), 0.005)], Material::grey(NEARLY_BLACK))
        .part("walls", &walls, Material::grey(0.0));
    for (rows, most) in STRATEGIES.into_iter().zip([2e-4, NOISE]) {
        let settings = BakeSettings { rows, ..BakeSettings::default() };
        let (_, baked) = under_sky(&builder, &settings);
        let expected = PI * RADIANCE * (1.0 - 4.0 * to_wall(0.5, 1.0, 0.5));
        let found = mean_irradiance(&baked.lit, 0);
        let error = (found / expected - 1.0).abs().max_element();
        assert!(error <= most, "{rows:?}: {found}, not {expected}, off by {error:e}");

        let room = SceneBuilder::new().part("walls", &shapes::unit_room(), Material::grey(0.5));
        let (_, baked) = under_sky(&room, &settings);
        assert!(
            baked.lit.vertices.iter().all(|vertex| vertex.irradiance == DVec3::ZERO),
            "{rows:?}: light comes through walls"
        );
        assert!(baked.report.warnings.is_empty(), "{:?}", baked.report.warnings);
    }
}

/// An equirectangular sky, from the radiance in each direction.
fn image(width: usize, radiance: impl Fn(DVec3) -> [f64; 3]) -> SkyImage {
    let height = width / 2;
    let texels = (0..width * height).map(|index| {
        let longitude = 2.0 * PI * ((index % width) as f64 + 0.5) / width as f64 - PI;
        let (out, up) = (PI * ((index / width) as f64 + 0.5) / height as f64).sin_cos();
        let direction = DVec3::new(longitude.cos() * out, up, longitude.sin() * out);
        radiance(direction).map(|value| value as f32)
    });
    let projection = Projection::Equirectangular { width, height };
    SkyImage { projection, texels: texels.collect(), rotation: DQuat::IDENTITY }
}

fn options(image: &SkyImage) -> ImportOptions {
    let pattern = SkyPattern::new(image);
    ImportOptions { sky: pattern.mean(), sky_pattern: Some(Arc::new(pattern)), ..ImportOptions::default() }
}

fn under_image(builder: &SceneBuilder, image: &SkyImage, settings: &BakeSettings) -> (Scene, Baked) {
    let scene = import_slice(&builder.glb(), &options(image)).unwrap_or_else(|error| panic!("{error}"));
    let baked = baked(&scene, settings);
    (scene, baked)
}

/// The overcast sky of the CIE, L = L_z (1 + 2 sin(height)) / 3: 7 pi / 9 L_z on the ground, and .3963 of that on a wall that
/// faces a dark ground.
#[test]
fn an_overcast_sky_gives_what_the_cie_says() {
    let overcast =
        image(256, |direction| [(1.0 + 2.0 * direction.y.max(-0.5)) / 3.0 * f64::from(direction.y > 0.0); 3]);
    let ground = plate(DVec3::ZERO, 1.0);
    let wall =
        vec![DVec3::ZERO, DVec3::new(1.0, 0.0, 0.2), DVec3::new(1.0, 1.0, 0.2), DVec3::new(0.0, 1.0, 0.0)];
    let horizontal = 7.0 * PI / 9.0;
    for (plate, expected) in [(ground, horizontal), (wall, 2.0 / 3.0 * (PI / 4.0 + 2.0 / 3.0))] {
        for rows in [RowStrategy::Exact, RowStrategy::Gather] {
            let builder =
                SceneBuilder::new().part("plate", std::slice::from_ref(&plate), Material::grey(0.2));
            let settings = BakeSettings { rows, error: Some(0.01), ..BakeSettings::default() };
            let (_, baked) = under_image(&builder, &overcast, &settings);
            for vertex in vertices_of(&baked.lit, 0) {
                let error = (vertex.irradiance / expected - 1.0).abs().max_element();
                assert!(error <= 4e-3, "{rows:?}: {}, not {expected}, off by {error:e}", vertex.irradiance);
            }
        }
    }
}

/// One bright texel is the sun: the same light, the same shadow of a wall, but for its width.
#[test]
fn one_bright_texel_is_a_directional_light() {
    let towards = DVec3::new(0.5, 0.7, 0.3).normalize();
    let mut sky = image(1024, |_| [0.0; 3]);
    let (mut nearest, mut sun) = (f64::MAX, 0);
    let mut texel = 0;
    sky.each_part(1, |direction, _, _| {
        if direction.distance(towards) < nearest {
            (nearest, sun) = (direction.distance(towards), texel);
        }
        texel += 1;
    });
    sky.texels[sun] = [1e5, 8e4, 6e4];
    let (mut flux, mut middle) = (DVec3::ZERO, DVec3::ZERO);
    sky.each_part(8, |direction, solid_angle, radiance| {
        flux += radiance * solid_angle;
        middle += direction * solid_angle * radiance.x;
    });
    let wall = vec![
        DVec3::new(0.0, 0.0, 2.0),
        DVec3::new(0.0, 0.0, -2.0),
        DVec3::new(0.0, 2.0, -2.0),
        DVec3::new(0.0, 2.0, 2.0),
    ];
    let scene = || {
        SceneBuilder::new().part("ground", &[plate(DVec3::ZERO, 4.0)], Material::grey(0.5)).part(
            "wall",
            std::slice::from_ref(&wall),
            Material::grey(0.5).double_sided(),
        )
    };
    let along = DQuat::from_rotation_arc(DVec3::NEG_Z, -middle.normalize());
    let light = json!({ "type": "directional", "intensity": flux.x, "color": (flux / flux.x).to_array() });
    let lamp = scene().light(light, DMat4::from_quat(along));
    let lit = import_slice(&lamp.glb(), &ImportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    for rows in [RowStrategy::Exact, RowStrategy::Gather] {
        let settings = BakeSettings { rows, ..BakeSettings::for_error(0.04) };
        let expected = baked(&lit, &settings);
        let (_, found) = under_image(&scene(), &sky, &settings);
        for surface in 0..3 {
            let [expected, found] = [&expected, &found].map(|baked| mean_irradiance(&baked.lit, surface));
            let error = (found - expected).abs().max_element() / flux.x;
            assert!(error <= 0.01, "{rows:?}, surface {surface}: {found}, not {expected}");
        }
    }
}

/// A sky within the file: six images of one colour each, of which every face of a cube sees one half and of four others a part.
#[test]
fn cube_maps_of_the_file_are_its_sky() {
    let (mut document, mut binary) =
        SceneBuilder::new().part("plate", &[plate(DVec3::ZERO, 1.0)], Material::grey(0.2)).document();
    let mut views = document["bufferViews"].as_array().cloned().unwrap_or_default();
    let mut images = vec![];
    for face in 0..6 {
        // Only the face above shines, at half alpha: twice as bright as its colour, which is white.
        let texel = if face == 2 { [255, 255, 255, 128] } else { [0, 0, 0, 255] };
        let mut png = Cursor::new(vec![]);
        let texels: Vec<u8> = std::iter::repeat_n(texel, 16).flatten().collect();
        PngEncoder::new(&mut png).write_image(&texels, 4, 4, ExtendedColorType::Rgba8).unwrap();
        let png = png.into_inner();
        views.push(json!({ "buffer": 0, "byteOffset": binary.len(), "byteLength": png.len() }));
        images.push(json!({ "bufferView": views.len() - 1, "mimeType": "image/png" }));
        binary.extend(png);
        binary.resize(binary.len().next_multiple_of(4), 0);
    }
    document["bufferViews"] = views.into();
    document["images"] = images.into();
    document["buffers"][0]["byteLength"] = binary.len().into();
    document["extensionsUsed"] = json!(["EXT_lights_image_based"]);
    document["extensions"]["EXT_lights_image_based"] = json!({ "lights": [{
        "intensity": 3.0, "specularImageSize": 4, "specularImages": [[0, 1, 2, 3, 4, 5]],
        "irradianceCoefficients": vec![[0.0; 3]; 9],
    }] });
    document["scenes"][0]["extensions"]["EXT_lights_image_based"] = json!({ "light": 0 });
    let scene = import_slice(&pack(&document, &binary), &ImportOptions::default()).unwrap();
    let baked = baked(&scene, &BakeSettings::default());
    // The form factor of the face above: of a square of edge 2 at distance 1.
    let quarter = 2.0 / (2.0 * PI) / 2.0_f64.sqrt() * (1.0 / 2.0_f64.sqrt()).atan();
    let expected = PI * 3.0 * (255.0 / 128.0) * 4.0 * quarter;
    for vertex in vertices_of(&baked.lit, 0) {
        let error = (vertex.irradiance / expected - 1.0).abs().max_element();
        assert!(error <= 1e-4, "{}, not {expected}, off by {error:e}", vertex.irradiance);
    }
}

/// The light of a sky image is kept as that of its mean: twice the mean is twice the light, without the image.
#[test]
fn a_sky_image_can_be_relit() {
    let sky = image(64, |direction| [1.0 + direction.x, 1.0 + direction.y, 2.0]);
    let builder = SceneBuilder::new().part("ground", &[plate(DVec3::ZERO, 1.0)], Material::grey(0.5)).part(
        "roof",
        &[plate(DVec3::Y * 0.5, 0.5)],
        Material::grey(0.5).double_sided(),
    );
    let settings = BakeSettings { keep_light: Some(u64::MAX), ..BakeSettings::default() };
    let (scene, baked) = under_image(&builder, &sky, &settings);
    let kept = KeptLight::from_bytes(&baked.kept.unwrap().to_bytes()).unwrap();
    let without = ImportOptions { sky: kept.sky(), ..ImportOptions::default() };
    let again = import_slice(&builder.glb(), &without).unwrap();
    let twice = NewLight { sky: Some(scene.sky * 2.0), ..NewLight::default() };
    let relit = relight(&again, &kept, &twice).unwrap_or_else(|error| panic!("{error}"));
    for surface in 0..3 {
        let [before, after] = [&baked.lit, &relit.lit].map(|lit| mean_irradiance(lit, surface));
        assert!(
            (after - 2.0 * before).length() <= 1e-5 * after.length(),
            "{surface}: {before}, then {after}"
        );
    }
}
