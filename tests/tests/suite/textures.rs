//! Textures, vertex colours and alpha against scenes that say the same in plain colours.

use bake::{BakeSettings, Baked};
use glam::DVec3;
use scene::Scene;
use serde_json::{Value, json};
use tests::baking::{baked, baked_by, imported, mean_irradiance};
use tests::builder::{Material, SceneBuilder};
use tests::painting::Painting;
use tests::shapes;

const BLACK: [u8; 4] = [0, 0, 0, 255];
const WHITE: [u8; 4] = [255, 255, 255, 255];

const BOTTOM: usize = 2;
const TOP: usize = 3;

/// The unit cube, each face a part of its own: -x, +x, bottom, top, -z, +z. All reflect half, but for the bottom; the top emits.
fn cube(bottom: f64) -> SceneBuilder {
    let faces = shapes::unit_room().into_iter().enumerate();
    faces.fold(SceneBuilder::new(), |builder, (index, face)| {
        let material = match index {
            BOTTOM => Material::grey(bottom),
            TOP => Material::grey(0.5).emitting(1.0),
            _ => Material::grey(0.5),
        };
        builder.part(&format!("face {index}"), &[face], material)
    })
}

/// The image lies on the horizontal faces once, u along x and v along z.
fn from_above(position: DVec3) -> [f64; 2] {
    [position.x, position.z]
}

fn base_colour(material: &mut Value, texture: Value) {
    material["pbrMetallicRoughness"]["baseColorTexture"] = texture;
}

fn bake(glb: &[u8]) -> (Scene, Baked) {
    let scene = imported(glb);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let baked = baked(&scene, &BakeSettings::default());
    (scene, baked)
}

/// Largest difference of mean irradiances, relative, over the faces that `counts` says.
fn worst_face(a: &Baked, b: &Baked, counts: impl Fn(usize) -> bool) -> f64 {
    (0..6)
        .filter(|face| counts(*face))
        .map(|face| (mean_irradiance(&a.lit, face) / mean_irradiance(&b.lit, face) - 1.0).abs().max_element())
        .fold(0.0, f64::max)
}

#[track_caller]
fn assert_balanced(baked: &Baked) {
    let imbalance = baked.report.balance.relative_imbalance();
    assert!(imbalance.abs() <= 0.01, "an imbalance of {:.3} %", 100.0 * imbalance);
}

/// Sixteen squares along each side, finer than shares: what they send is what a grey floor sends.
#[test]
fn checkered_floor_sends_its_mean() {
    let texels: Vec<[u8; 4]> =
        (0..256).map(|i| if (i % 16 + i / 16) % 2 == 0 { BLACK } else { WHITE }).collect();
    let checkered =
        Painting::new(&cube(0.8)).coordinates(BOTTOM, from_above).texture(BOTTOM, &texels, base_colour);
    let (scene, checkered) = bake(&checkered.glb());
    assert!((scene.surfaces[BOTTOM].reflectance.x - 0.4).abs() < 1e-7);
    let (_, grey) = bake(&cube(0.4).glb());
    let worst = worst_face(&checkered, &grey, |_| true);
    assert!(worst <= 0.002, "off by {:.3} %", 100.0 * worst);
    assert_balanced(&checkered);
    assert_eq!(checkered.report.model.channels, 1);
}

/// A floor of two colours as one part with a texture, and as two parts: as they meet in the middle, shares may straddle the edge.
#[test]
fn halves_of_a_texture_are_two_surfaces() {
    let halves = |left: f64, right: f64| {
        let half = |low: f64, high: f64| {
            vec![
                DVec3::new(low, 0.0, 0.0),
                DVec3::new(low, 0.0, 1.0),
                DVec3::new(high, 0.0, 1.0),
                DVec3::new(high, 0.0, 0.0),
            ]
        };
        let faces = shapes::unit_room();
        let mut builder = SceneBuilder::new();
        for (index, face) in faces.into_iter().enumerate() {
            let material = if index == TOP { Material::grey(0.5).emitting(1.0) } else { Material::grey(0.5) };
            builder = match index {
                BOTTOM => builder.part("left", &[half(0.0, 0.5)], Material::grey(left)),
                _ => builder.part(&format!("face {index}"), &[face], material),
            };
        }
        builder.part("right", &[half(0.5, 1.0)], Material::grey(right))
    };
    let (_, apart) = bake(&halves(0.0, 0.8).glb());
    let texels = [BLACK, WHITE, BLACK, WHITE];
    let painted =
        Painting::new(&cube(0.8)).coordinates(BOTTOM, from_above).texture(BOTTOM, &texels, base_colour);
    let (_, textured) = bake(&painted.glb());
    let worst = worst_face(&textured, &apart, |face| face != BOTTOM);
    assert!(worst <= 0.003, "off by {:.3} %", 100.0 * worst);
    assert_balanced(&textured);

    // The same by the metal in a metallic-roughness texture: black where it is metal.
    let texels = [[0, 0, 255, 255], [0, 0, 0, 255], [0, 0, 255, 255], [0, 0, 0, 255]];
    let metallic = Painting::new(&cube(0.8)).coordinates(BOTTOM, from_above).texture(
        BOTTOM,
        &texels,
        |material, texture| {
            material["pbrMetallicRoughness"]["metallicRoughnessTexture"] = texture;
            material["pbrMetallicRoughness"]["metallicFactor"] = json!(1.0);
        },
    );
    let (_, metallic) = bake(&metallic.glb());
    for (own, other) in metallic.lit.vertices.iter().zip(&textured.lit.vertices) {
        assert!((own.irradiance - other.irradiance).abs().max_element() <= 1e-9);
    }
}

#[test]
fn emissive_texture_emits_the_flux_of_its_mean() {
    let glowing = |material: &mut Value, texture: Value| material["emissiveTexture"] = texture;
    let texels = [BLACK, WHITE, BLACK, WHITE];
    let painted = Painting::new(&cube(0.5)).coordinates(TOP, from_above).texture(TOP, &texels, glowing);
    let (scene, half) = bake(&painted.glb());
    assert!((scene.surfaces[TOP].exitance.x - 0.5).abs() < 1e-6);
    assert!((half.report.balance.emitted[0] - 0.5).abs() < 1e-6, "{:?}", half.report.balance);
    assert_balanced(&half);
    // The black half has no row, and the bright one is not cut finer than it must be.
    assert!((1..=2).contains(&half.report.model.area_lights), "{} lights", half.report.model.area_lights);

    // Half of a lamp is a lamp of half the size.
    let top = |low: f64, high: f64| {
        vec![
            DVec3::new(low, 1.0, 0.0),
            DVec3::new(high, 1.0, 0.0),
            DVec3::new(high, 1.0, 1.0),
            DVec3::new(low, 1.0, 1.0),
        ]
    };
    let faces = shapes::unit_room().into_iter().enumerate();
    let builder = faces.fold(SceneBuilder::new(), |builder, (index, face)| match index {
        TOP => builder.part("dark", &[top(0.0, 0.5)], Material::grey(0.5)),
        _ => builder.part(&format!("face {index}"), &[face], Material::grey(0.5)),
    });
    let builder = builder.part("lamp", &[top(0.5, 1.0)], Material::grey(0.5).emitting(1.0));
    let (_, apart) = bake(&builder.glb());
    let worst = worst_face(&half, &apart, |face| face != TOP);
    assert!(worst <= 0.002, "off by {:.3} %", 100.0 * worst);
}

/// A picture of fine stripes: every patch has about its mean, and they send what an even lamp sends.
#[test]
fn finely_striped_lamp_is_an_even_one() {
    let glowing = |material: &mut Value, texture: Value| material["emissiveTexture"] = texture;
    let texels: Vec<[u8; 4]> = (0..64 * 64).map(|i| if i % 2 == 0 { BLACK } else { WHITE }).collect();
    let painted = Painting::new(&cube(0.5)).coordinates(TOP, from_above).texture(TOP, &texels, glowing);
    let (_, striped) = bake(&painted.glb());
    let (_, even) = bake(&cube(0.5).glb());
    for face in [0, 1, BOTTOM, 4, 5] {
        let ratio = mean_irradiance(&striped.lit, face) / mean_irradiance(&even.lit, face);
        assert!((ratio - 0.5).abs().max_element() <= 0.001, "face {face}: {ratio}");
    }
    assert_eq!(striped.report.model.area_lights, 1);
}

#[test]
fn vertex_colours_multiply_the_base_colour() {
    let even = Painting::new(&cube(0.8)).colours(BOTTOM, |_| [0.5, 0.5, 0.5, 1.0]);
    let (_, even) = bake(&even.glb());
    let (_, grey) = bake(&cube(0.4).glb());
    let worst = worst_face(&even, &grey, |_| true);
    assert!(worst <= 1e-6, "off by {worst:e}");

    // From black to white: as much light in all, and more of it beside the bright end.
    let fading = Painting::new(&cube(0.8)).colours(BOTTOM, |p| [p.x, p.x, p.x, 1.0]);
    let (scene, fading) = bake(&fading.glb());
    assert!((scene.surfaces[BOTTOM].reflectance.x - 0.4).abs() < 1e-7);
    let ratio = |face: usize| mean_irradiance(&fading.lit, face).x / mean_irradiance(&grey.lit, face).x;
    assert!(ratio(0) < 0.99 && ratio(1) > 1.01, "{} {}", ratio(0), ratio(1));
    assert!((ratio(TOP) - 1.0).abs() <= 0.005, "{}", ratio(TOP));
    assert_balanced(&fading);
}

/// Half of the light on a floor of half the opacity leaves the room, and the rest is reflected as its colour says.
#[test]
fn blended_floor_lets_light_out() {
    let blended = Painting::new(&cube(0.5)).material(BOTTOM, |material| {
        material["alphaMode"] = json!("BLEND");
        material["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.5, 0.5, 0.5, 0.5]);
    });
    let (scene, blended) = bake(&blended.glb());
    assert_eq!((scene.surfaces[BOTTOM].opacity, scene.surfaces[BOTTOM].reflectance.x), (0.5, 0.25));
    let (_, grey) = bake(&cube(0.25).glb());
    let worst = worst_face(&blended, &grey, |_| true);
    assert!(worst <= 1e-6, "off by {worst:e}");
    let balance = &blended.report.balance;
    let through = 0.5 * mean_irradiance(&blended.lit, BOTTOM).x;
    assert!(
        (balance.escaped[0] / through - 1.0).abs() <= 0.02,
        "{} escaped, {through} on it",
        balance.escaped[0]
    );
    assert_balanced(&blended);
}

/// Glass of half the transmission reflects half of its colour, and lets that of the other half out.
#[test]
fn glass_floor_lets_light_of_its_colour_out() {
    let glass = Painting::new(&cube(0.5)).material(BOTTOM, |material| {
        material["extensions"] = json!({ "KHR_materials_transmission": { "transmissionFactor": 0.5 } });
    });
    let (scene, glass) = bake(&glass.glb());
    assert_eq!((scene.surfaces[BOTTOM].opacity, scene.surfaces[BOTTOM].reflectance.x), (0.75, 0.25));
    let (_, grey) = bake(&cube(0.25).glb());
    let worst = worst_face(&glass, &grey, |_| true);
    assert!(worst <= 1e-6, "off by {worst:e}");
    let (balance, through) = (&glass.report.balance, 0.25 * mean_irradiance(&glass.lit, BOTTOM).x);
    let escaped = balance.escaped[0];
    assert!((escaped / through - 1.0).abs() <= 0.02, "{escaped} escaped, {through} through the floor");
    assert_balanced(&glass);
}

/// A mask of squares takes as much as its mean opacity says, and reflects that part.
#[test]
fn masked_floor_reflects_what_is_there() {
    let texels: Vec<[u8; 4]> =
        (0..256).map(|i| [255, 255, 255, if (i % 16 + i / 16) % 2 == 0 { 100 } else { 200 }]).collect();
    let masked = Painting::new(&cube(0.5))
        .coordinates(BOTTOM, from_above)
        .texture(BOTTOM, &texels, base_colour)
        .material(BOTTOM, |material| material["alphaMode"] = json!("MASK"));
    let (scene, masked) = bake(&masked.glb());
    assert!((scene.surfaces[BOTTOM].opacity - 0.5).abs() < 1e-9);
    let (_, grey) = bake(&cube(0.25).glb());
    let worst = worst_face(&masked, &grey, |_| true);
    assert!(worst <= 0.002, "off by {:.3} %", 100.0 * worst);
    assert_balanced(&masked);
}

/// Of two solids with one material, whose emission is a picture, the one where it is black is dark inside, and needs no light there.
#[test]
fn bodies_are_sealed_where_their_emissive_texture_is_black() {
    let (low, high) = (DVec3::splat(0.1), DVec3::splat(0.4));
    let solids = [0.0, 1.0].map(|x| shapes::box_facing_out(low + DVec3::X * x, high + DVec3::X * x)).concat();
    let builder =
        SceneBuilder::new().part("solids", &solids, Material::grey(0.5).emitting(1.0).double_sided());
    let painted = Painting::new(&builder)
        .coordinates(0, |position| [if position.x < 0.5 { 0.25 } else { 0.75 }, 0.5])
        .texture(0, &[BLACK, WHITE, BLACK, WHITE], |material, texture| material["emissiveTexture"] = texture);
    let scene = imported(&painted.glb());
    let of_sealed = |facet: &&scene::Facet| facet.is_sealed;
    let sealed: Vec<usize> =
        scene.surfaces.iter().map(|surface| surface.facets.iter().filter(of_sealed).count()).collect();
    assert_eq!(sealed, [0, 6]);
    assert!(
        scene.surfaces[1].facets.iter().all(|facet| facet.is_sealed == (facet.corners[0].position.x < 0.0))
    );
    // Of the back, the white part alone emits.
    assert_balanced(&baked(&scene, &BakeSettings::default()));
}

#[test]
fn textured_bakes_have_the_same_bits_whatever_the_threads() {
    let texels: Vec<[u8; 4]> = (0..64).map(|i: u32| [(i * 4) as u8, 90, (255 - i * 3) as u8, 255]).collect();
    let glowing = |material: &mut Value, texture: Value| material["emissiveTexture"] = texture;
    let painted = Painting::new(&cube(0.8))
        .coordinates(BOTTOM, from_above)
        .coordinates(TOP, from_above)
        .texture(BOTTOM, &texels, base_colour)
        .texture(TOP, &texels, glowing);
    let glb = painted.glb();
    let [one, three] = [1, 3].map(|threads| {
        let lit = baked_by(&imported(&glb), &BakeSettings::default(), threads).lit;
        lit.vertices.iter().map(|v| v.irradiance.to_array().map(f64::to_bits)).collect::<Vec<_>>()
    });
    assert_eq!(one, three);
}
