use std::f64::consts::{FRAC_PI_8, PI};

use bake::{BakeSettings, Baked};
use glam::{DMat4, DQuat, DVec3};
use scene::Scene;
use serde_json::{Value, json};
use tests::baking::{baked, imported, mean_irradiance};
use tests::builder::{Material, SceneBuilder};
use tests::painting::{Numbers, Painting};

/// Tiles stand so far apart that none lights the plate over another.
const APART: f64 = 100.0;

/// How far above each tile a black plate hangs, on which falls what the tile sends up.
const HEIGHT: f64 = 12.0;

/// What a plate gets of the tiles beside its own: (HEIGHT / APART)^4 of what those send up, from two of them, which may be a little
/// brighter than its own.
const CROSSTALK: f64 = 1e-3;

const RED: [u8; 4] = [255, 0, 0, 255];
const GREEN: [u8; 4] = [0, 255, 0, 255];
const BLUE: [u8; 4] = [0, 0, 255, 255];
const WHITE: [u8; 4] = [255, 255, 255, 255];
const BLACK: [u8; 4] = [0, 0, 0, 255];

/// A horizontal square from a corner on, lit from above.
fn square(corner: DVec3, edge: f64) -> Vec<DVec3> {
    vec![corner, corner + DVec3::Z * edge, corner + DVec3::new(edge, 0.0, edge), corner + DVec3::X * edge]
}

/// So many tiles in slanting light, each under a plate: part 2 i is a tile, 2 i + 1 its plate.
fn tiles(materials: &[Material]) -> SceneBuilder {
    let sun = json!({ "type": "directional", "intensity": 100.0 });
    let towards =
        DMat4::from_quat(DQuat::from_rotation_arc(DVec3::NEG_Z, DVec3::new(0.0, -1.0, 2.0).normalize()));
    let pairs = materials.iter().enumerate().fold(SceneBuilder::new(), |builder, (index, material)| {
        let corner = DVec3::X * (APART * index as f64);
        let mut plate = square(corner + DVec3::Y * HEIGHT, 1.0);
        plate.reverse();
        builder.part(&format!("tile {index}"), &[square(corner, 1.0)], *material).part(
            &format!("plate {index}"),
            &[plate],
            Material::grey(0.0),
        )
    });
    pairs.light(sun, towards)
}

/// Where on its tile a place lies, from 0 to 1.
fn on_tile(place: DVec3) -> [f64; 2] {
    [place.x - APART * (place.x / APART).round(), place.z]
}

fn bake(glb: &[u8]) -> (Scene, Baked) {
    let scene = imported(glb);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let settings = BakeSettings {
        mesh_error: 0.02,
        factor_rounding: 0.0,
        validation_samples: 0,
        ..BakeSettings::default()
    };
    let baked = baked(&scene, &settings);
    (scene, baked)
}

/// Light on the plate over a tile.
fn above(baked: &Baked, tile: usize) -> DVec3 {
    mean_irradiance(&baked.lit, 2 * tile + 1)
}

fn base_colour(material: &mut Value, texture: Value) {
    material["pbrMetallicRoughness"]["baseColorTexture"] = texture;
}

/// The transforms of TextureTransformTest. What a tile sends up has the mean colour of those texels that it shows.
#[test]
fn texture_transforms_choose_the_texels_that_are_seen() {
    let transforms = [
        json!({ "offset": [0.5, 0.0], "scale": [0.5, 0.5] }),
        json!({ "offset": [0.0, 0.5], "scale": [0.5, 0.5] }),
        json!({ "offset": [0.5, 0.5], "scale": [0.5, 0.5] }),
        json!({ "rotation": FRAC_PI_8 }),
        json!({ "scale": [1.5, 1.5] }),
        json!({ "offset": [-0.2, -0.1], "rotation": 0.3, "scale": [1.5, 1.5] }),
    ];
    // A reference without texture comes last.
    let builder = tiles(&[Material::grey(0.8); 7]);
    let mut painting = Painting::new(&builder);
    for (tile, transform) in transforms.iter().enumerate() {
        painting = painting.coordinates(2 * tile, on_tile).texture(
            2 * tile,
            &[WHITE, RED, GREEN, BLUE],
            |material, mut texture| {
                texture["extensions"] = json!({ "KHR_texture_transform": transform });
                base_colour(material, texture);
            },
        );
    }
    let (_, baked) = bake(&painting.glb());
    let grey = above(&baked, 6);
    for (tile, transform) in transforms.iter().enumerate() {
        let number = |value: &Value, otherwise: f64| value.as_f64().unwrap_or(otherwise);
        let (sine, cosine) = number(&transform["rotation"], 0.0).sin_cos();
        let shown = |u: f64, v: f64| {
            let (u, v) = (u * number(&transform["scale"][0], 1.0), v * number(&transform["scale"][1], 1.0));
            let s = cosine * u + sine * v + number(&transform["offset"][0], 0.0);
            let t = -sine * u + cosine * v + number(&transform["offset"][1], 0.0);
            match (s.rem_euclid(1.0) < 0.5, t.rem_euclid(1.0) < 0.5) {
                (true, true) => DVec3::ONE,
                (false, true) => DVec3::X,
                (true, false) => DVec3::Y,
                (false, false) => DVec3::Z,
            }
        };
        let places = 1000;
        let place = |i: u32| (f64::from(i) + 0.5) / f64::from(places);
        let sum: DVec3 = (0..places * places).map(|i| shown(place(i % places), place(i / places))).sum();
        let expected = sum / f64::from(places * places);
        let found = above(&baked, tile) / grey;
        // Midpoints count a cell's border to within its length over their number.
        assert!((found - expected).abs().max_element() < 0.002, "{transform}: {found} for {expected}");
    }
}

/// Base colour by the first set of coordinates, emission by the second; sets taken for each other give other light.
#[test]
fn each_texture_takes_its_own_coordinates() {
    let texels = [WHITE, BLACK, BLACK, BLACK];
    let builder = tiles(&[Material::grey(0.8), Material::grey(0.8), Material::grey(0.8).emitting(PI)]);
    let bright = |place: DVec3| on_tile(place).map(|value| 0.1 + 0.3 * value);
    let dark = |place: DVec3| on_tile(place).map(|value| 0.6 + 0.3 * value);
    let with_sets = |painting: Painting, tile: usize, [base, glow]: [u32; 2]| {
        painting
            .coordinates_of_set(2 * tile, 0, bright)
            .coordinates_of_set(2 * tile, 1, dark)
            .texture(2 * tile, &texels, |material, mut texture| {
                texture["texCoord"] = json!(base);
                base_colour(material, texture);
            })
            .texture(2 * tile, &texels, |material, mut texture| {
                texture["texCoord"] = json!(glow);
                material["emissiveTexture"] = texture;
                material["emissiveFactor"] = json!([1.0, 1.0, 1.0]);
            })
    };
    let painting = with_sets(with_sets(Painting::new(&builder), 0, [0, 1]), 1, [1, 0]);
    let (scene, baked) = bake(&painting.glb());
    let look = |tile: usize| {
        let surface = &scene.surfaces[2 * tile];
        (surface.reflectance.x, surface.exitance.x)
    };
    let close = |(a, b): (f64, f64), (c, d): (f64, f64)| (a - c).abs() < 1e-6 && (b - d).abs() < 1e-6;
    assert!(close(look(0), (0.8, 0.0)), "{:?}", look(0));
    assert!(close(look(1), (0.0, PI)), "{:?}", look(1));
    // What reflects and what glows, side by side: together they are the tile that does both.
    let [reflecting, glowing, both] = [0, 1, 2].map(|tile| above(&baked, tile).x);
    assert!(reflecting > 0.0 && glowing > 0.0);
    assert!(((reflecting + glowing) / both - 1.0).abs() < CROSSTALK, "{reflecting} + {glowing} for {both}");
}

/// Colours of vertices as floats with and without alpha, bytes and 16 bits are one colour, linear, times the base colour.
#[test]
fn vertex_colours_of_every_kind_are_one() {
    // Multiples of 1/255 are exact in bytes and in shorts.
    let colour = |place: DVec3| {
        let [u, v] = on_tile(place);
        [51.0 + 102.0 * u, 204.0 - 153.0 * v, 102.0].map(|value| value.round() / 255.0)
    };
    let opaque = |place: DVec3| {
        let [red, green, blue] = colour(place);
        [red, green, blue, 1.0]
    };
    let builder = tiles(&[Material::grey(0.5); 6]);
    let painting = Painting::new(&builder)
        .colours_as(0, Numbers::Floats, colour)
        .colours_as(2, Numbers::Floats, opaque)
        .colours_as(4, Numbers::Bytes, colour)
        .colours_as(6, Numbers::Bytes, opaque)
        .colours_as(8, Numbers::Shorts, opaque);
    let (_, baked) = bake(&painting.glb());
    let plain = above(&baked, 5);
    let expected = DVec3::new(102.0, 127.5, 102.0) / 255.0;
    for tile in 0..5 {
        let found = above(&baked, tile) / plain;
        assert!((found - expected).abs().max_element() < CROSSTALK, "tile {tile}: {found} for {expected}");
    }
}

/// The row of AlphaBlendModeTest: under a sheet whose alpha rises from 0 to 1 in sixteen steps falls as much light as its mode says.
#[test]
fn alpha_modes_let_their_part_through() {
    let modes = [
        (json!({ "alphaMode": "OPAQUE" }), 0.0),
        (json!({ "alphaMode": "BLEND" }), 0.5),
        (json!({ "alphaMode": "MASK", "alphaCutoff": 0.25 }), 0.25),
        (json!({ "alphaMode": "MASK" }), 0.5),
        (json!({ "alphaMode": "MASK", "alphaCutoff": 0.75 }), 0.75),
    ];
    let texels: Vec<[u8; 4]> = (0..256).map(|i| [0, 0, 0, 17 * (i % 16) as u8]).collect();
    let sun = json!({ "type": "directional", "intensity": 100.0 });
    let down = DMat4::from_quat(DQuat::from_rotation_arc(DVec3::NEG_Z, DVec3::NEG_Y));
    let mut builder = SceneBuilder::new();
    for index in 0..modes.len() {
        let corner = DVec3::X * (4.0 * index as f64);
        let sheet = square(corner + DVec3::new(-0.5, 0.5, -0.5), 2.0);
        builder = builder.part("floor", &[square(corner, 1.0)], Material::grey(1e-6)).part(
            "sheet",
            &[sheet],
            Material::grey(0.5).double_sided(),
        );
    }
    let mut painting = Painting::new(&builder.light(sun, down));
    for (index, (mode, _)) in modes.iter().enumerate() {
        let sheet = 2 * index + 1;
        painting =
            painting.coordinates(sheet, |place| [place.x, place.z]).texture(sheet, &texels, base_colour);
        painting = painting.material(sheet, |material| {
            for (name, value) in mode.as_object().unwrap() {
                material[name] = value.clone();
            }
        });
    }
    let scene = imported(&painting.glb());
    let baked =
        baked(&scene, &BakeSettings { mesh_error: 0.02, validation_samples: 0, ..BakeSettings::default() });
    let floors = scene.surfaces.iter().enumerate().filter(|(_, surface)| surface.name.contains("floor"));
    for ((index, _), (mode, part)) in floors.zip(&modes) {
        let found = mean_irradiance(&baked.lit, index).x / 100.0;
        // Steps of brightness are ramps over a triangle.
        assert!((found - part).abs() < 0.02, "{mode}: {found} for {part}");
    }
}

/// An unlit surface is no lamp, and reflects as its colour says.
#[test]
fn unlit_surfaces_reflect_their_colour_and_send_no_light() {
    let colours = [DVec3::new(0.8, 0.3, 0.05), DVec3::new(0.05, 0.2, 0.8)];
    let materials = colours.map(|reflectance| Material { reflectance, ..Material::grey(0.0) });
    let builder = tiles(&materials);
    let lit = |painting: Painting| {
        let (_, baked) = bake(&painting.glb());
        let bits = |v: &bake::lit::LitVertex| v.irradiance.to_array().map(f64::to_bits);
        baked.lit.vertices.iter().map(bits).collect::<Vec<_>>()
    };
    let unlit = (0..2).fold(Painting::new(&builder), |painting, tile| {
        painting.material(2 * tile, |material| material["extensions"] = json!({ "KHR_materials_unlit": {} }))
    });
    assert!(lit(unlit) == lit(Painting::new(&builder)));
}
