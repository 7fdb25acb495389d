//! Spot and directional lights, as a worker computes their rows and in whole bakes, against their formulas.

use std::f64::consts::{FRAC_PI_3, FRAC_PI_6, TAU};

use bake::BakeSettings;
use glam::{DMat4, DQuat, DVec3};
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::row::{Precision, Shape, Shooter, Spot};
use kernel::visibility::ReceiverGroups;
use serde_json::{Value, json};
use tests::baking::{area_and_flux, baked, imported, mean_irradiance, vertices_of};
use tests::builder::{Material, SceneBuilder};
use tests::shapes::{self, Polygon};
use worker::engine::{Scene, compute_row};

use crate::occlusion::receivers_on;

/// Reflectance at which reflected light does not count but radiosity still drives the mesh.
const NEARLY_BLACK: f64 = 1e-6;

/// Factors with all digits of f32.
fn exact() -> BakeSettings {
    BakeSettings { factor_rounding: 0.0, ..BakeSettings::default() }
}

/// A horizontal square around the origin, lit from above: y is up.
fn plate(half: f64, height: f64) -> Polygon {
    let corner = |x: f64, z: f64| DVec3::new(x * half, height, z * half);
    vec![corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)]
}

/// Where a light shines in this direction.
fn towards(direction: DVec3) -> DMat4 {
    DMat4::from_quat(DQuat::from_rotation_arc(DVec3::NEG_Z, direction.normalize()))
}

fn directional(lux: f64) -> Value {
    json!({ "type": "directional", "intensity": lux, "color": [1.0, 1.0, 1.0] })
}

/// Every factor of a row is s cos / r^2 under the ramp of the specification, to the digits of f32.
#[test]
fn row_of_a_spot_light_is_its_formula() {
    let spot = Spot {
        position: DVec3::new(0.3, 2.0, -0.4),
        direction: DVec3::new(0.1, -1.0, 0.25).normalize(),
        inner_cosine: FRAC_PI_6.cos() + 0.05,
        outer_cosine: FRAC_PI_6.cos(),
    };
    let receivers = receivers_on(&plate(2.0, 0.0), 41);
    let shooter = Shooter { key: 0, shape: Shape::Spot(spot) };
    let precision = Precision { factor_rounding: 0.0, ..Precision::DEFAULT };
    let (row, _) =
        compute_row(&Scene::new(&[]), &ReceiverGroups::new(receivers.clone()), 0, &shooter, &precision);
    let (mut full, mut soft, mut dark) = (0, 0, 0);
    for (receiver, found) in receivers.iter().zip(row) {
        let span = receiver.position - spot.position;
        let distance = span.length();
        let ramp = (span.dot(spot.direction) / distance - spot.outer_cosine) / 0.05;
        *match ramp {
            _ if ramp >= 1.0 => &mut full,
            _ if ramp > 0.0 => &mut soft,
            _ => &mut dark,
        } += 1;
        let cosine = -span.y / distance;
        let expected = ramp.clamp(0.0, 1.0).powi(2) * cosine / (distance * distance);
        assert!((f64::from(found) - expected).abs() <= 1e-7 * expected.max(1e-3), "{found}, not {expected}");
    }
    assert!(full > 50 && soft > 50 && dark > 500, "{full} {soft} {dark}");
}

/// A sheet between takes the light of exactly those points whose ray against the light meets it, however far above it is.
#[test]
fn row_of_a_directional_light_has_the_shadow_of_a_sheet() {
    let along = DVec3::new(0.3, -1.0, 0.2).normalize();
    let receivers = receivers_on(&plate(2.0, 0.0), 64);
    for height in [0.01, 1.0, 1000.0] {
        // Against the light, up to the height of the sheet.
        let up = along * (height / along.y);
        let corners = plate(0.9, 0.0).into_iter().map(|corner| corner + up).collect();
        let sheet = ConvexPolygon { plane: PlaneId(9), corners };
        let shooter = Shooter { key: 0, shape: Shape::Directional(along) };
        let precision = Precision { factor_rounding: 0.0, ..Precision::DEFAULT };
        let scene = Scene::new(&[sheet]);
        let (row, _) = compute_row(&scene, &ReceiverGroups::new(receivers.clone()), 0, &shooter, &precision);
        for (receiver, found) in receivers.iter().zip(row) {
            let is_hidden = receiver.position.x.abs().max(receiver.position.z.abs()) < 0.9;
            let expected = if is_hidden { 0.0 } else { -along.y };
            assert!(
                (f64::from(found) - expected).abs() <= 1e-7,
                "{height}: {} has {found}",
                receiver.position
            );
        }
    }
}

/// What a spot straight above the middle of a large plate sends onto it is its intensity times its solid angle.
#[test]
fn spot_light_on_a_plate() {
    let (inner, outer) = (0.2, 0.7);
    let light = json!({
        "type": "spot", "intensity": 5.0, "spot": { "innerConeAngle": inner, "outerConeAngle": outer },
    });
    let place = DMat4::from_translation(DVec3::Y) * towards(DVec3::NEG_Y);
    let scene = SceneBuilder::new()
        .part("plate", &[plate(1.0, 0.0)], Material::grey(NEARLY_BLACK))
        .light(light, place);
    let scene = imported(&scene.glb());
    let baked = baked(&scene, &BakeSettings { mesh_error: 0.005, ..exact() });
    let flux = area_and_flux(&baked.lit, 0, |_| true).1.x * scene.frame.scale.powi(2);
    let (inner, outer) = (f64::from(inner as f32).cos(), f64::from(outer as f32).cos());
    let expected = 5.0 * TAU * (1.0 - inner + (inner - outer) / 3.0);
    assert!((flux / expected - 1.0).abs() <= 0.003, "{flux} lm, expected {expected}");
    let balance = &baked.report.balance;
    assert!((balance.emitted[0] / expected - 1.0).abs() <= 1e-7, "{balance:?}");
    assert_eq!((baked.report.model.point_lights, baked.report.model.spot_lights), (0, 1));
}

/// Each gives its lux times its cosine, everywhere the same; one from below gives nothing.
#[test]
fn two_directional_lights_on_a_plate() {
    let (steep, low) = (DVec3::new(1.0, -2.0, 0.5), DVec3::new(-3.0, -1.0, 1.0));
    let scene = SceneBuilder::new()
        .part("plate", &[plate(1.0, 0.0)], Material::grey(0.5))
        .light(directional(100.0), towards(steep))
        .light(directional(1000.0), towards(low))
        .same_light(towards(DVec3::new(0.1, 1.0, 0.0)));
    let scene = imported(&scene.glb());
    let baked = baked(&scene, &exact());
    let cosine = |direction: DVec3| -direction.normalize().y;
    let expected = 100.0 * cosine(steep) + 1000.0 * cosine(low);
    for vertex in vertices_of(&baked.lit, 0) {
        // Rotations are f32 in the file, and so are factors in rows.
        assert!(
            (vertex.irradiance.x / expected - 1.0).abs() <= 3e-7,
            "{}, not {expected}",
            vertex.irradiance
        );
    }
    let balance = &baked.report.balance;
    assert!(balance.relative_imbalance().abs() <= 1e-6, "{balance:?}");
    assert!((balance.emitted[0] / (4.0 * expected) - 1.0).abs() <= 1e-6, "{balance:?}");
    assert_eq!(baked.report.model.directional_lights, 3);
}

/// One light at several nodes is as several lights; and scaled and mirrored nodes shine as others.
#[test]
fn instances_and_mirrored_nodes_shine_as_lights_of_their_own() {
    let spot = || json!({ "type": "spot", "intensity": 2.0, "spot": { "outerConeAngle": FRAC_PI_3 } });
    let places = [DVec3::new(-0.5, 1.0, 0.0), DVec3::new(0.5, 0.8, 0.3)]
        .map(|position| DMat4::from_translation(position) * towards(DVec3::new(0.2, -1.0, 0.1)));
    let plate = || SceneBuilder::new().part("plate", &[plate(1.0, 0.0)], Material::grey(0.5));
    let bake = |builder: SceneBuilder| baked(&imported(&builder.glb()), &exact()).lit;
    let apart = bake(plate().light(spot(), places[0]).light(spot(), places[1]));
    let shared = bake(plate().light(spot(), places[0]).same_light(places[1]));
    assert_eq!(apart.vertices, shared.vertices);
    let mirrored = |scale| DMat4::from_scale(scale);
    let odd = plate()
        .light(spot(), places[0] * mirrored(DVec3::new(-2.0, 3.0, 0.5)))
        .same_light(places[1] * mirrored(DVec3::new(1.0, -1.0, 100.0)));
    let odd = bake(odd);
    assert_eq!(apart.vertices.len(), odd.vertices.len());
    for (one, other) in apart.vertices.iter().zip(&odd.vertices) {
        assert!((one.irradiance - other.irradiance).abs().max_element() <= 1e-5, "{one:?} {other:?}");
    }
}

/// A room of single sheets, dark inside though the sun shines on it: walls with all of the scene on one side block what comes from
/// without. Through a window in its roof falls as much as is wide across the sun.
#[test]
fn sun_enters_a_room_by_its_window_only() {
    let sun = DVec3::new(0.4, -1.0, 0.3);
    let walls = shapes::unit_room();
    let closed = SceneBuilder::new()
        .part("walls", &walls, Material::grey(0.5))
        .light(directional(1000.0), towards(sun))
        .same_light(towards(DVec3::new(-1.0, 0.3, 0.2)));
    let dark = baked(&imported(&closed.glb()), &BakeSettings::default());
    assert!(
        dark.lit.vertices.iter().all(|vertex| vertex.irradiance == DVec3::ZERO),
        "light comes through walls"
    );
    assert_eq!(dark.report.balance.emitted, [0.0; 3]);

    // The roof with a hole from .3 to .6, as four strips.
    let strip = |low: [f64; 2], high: [f64; 2]| {
        let corner = |x, z| DVec3::new(x, 1.0, z);
        vec![
            corner(low[0], low[1]),
            corner(high[0], low[1]),
            corner(high[0], high[1]),
            corner(low[0], high[1]),
        ]
    };
    let roof = [
        strip([0.0, 0.0], [1.0, 0.3]),
        strip([0.0, 0.6], [1.0, 1.0]),
        strip([0.0, 0.3], [0.3, 0.6]),
        strip([0.6, 0.3], [1.0, 0.6]),
    ];
    let others: Vec<Polygon> =
        walls.into_iter().filter(|wall| wall.iter().any(|corner| corner.y != 1.0)).collect();
    let open = SceneBuilder::new()
        .part("walls", &others, Material::grey(NEARLY_BLACK))
        .part("roof", &roof, Material::grey(NEARLY_BLACK))
        .light(directional(1000.0), towards(sun));
    let scene = imported(&open.glb());
    let lit = baked(&scene, &BakeSettings { mesh_error: 0.02, ..BakeSettings::default() });
    let flux = area_and_flux(&lit.lit, 0, |_| true).1.x * scene.frame.scale.powi(2);
    let expected = 1000.0 * 0.09 * -sun.normalize().y;
    assert!((flux / expected - 1.0).abs() <= 0.01, "{flux} lm, expected {expected}");
    assert!(mean_irradiance(&lit.lit, 1).x <= 1e-3, "the roof is lit inside");
    assert!(
        lit.report.warnings.iter().all(|warning| !warning.contains("its back")),
        "{:?}",
        lit.report.warnings
    );
}
