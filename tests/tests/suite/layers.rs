//! Parts of the light against the whole, and against bakes of scenes that have nothing but the part.

use bake::lit::LitMesh;
use bake::{BakeError, BakeSettings, Baked, LightGroup, LightPart, Unobserved, bake, check_groups};
use cluster::{Cluster, Workers};
use glam::DVec3;
use scene::Scene;
use scene::{ImportOptions, import_slice};
use tests::baking::baked;
use tests::builder::{Material, SceneBuilder, pack};
use tests::shapes;

/// Radiance of the sky.
pub const SKY: DVec3 = DVec3::new(0.5, 0.7, 1.5);

/// A court with a block in it, under the sky, with a red lamp, a green panel and two point lights called bulb.
pub fn court(lamp: f64, panel: f64, bulbs: f64, sky: DVec3) -> Scene {
    let mut walls = shapes::box_facing_in(DVec3::ZERO, DVec3::new(4.0, 3.0, 5.0));
    walls.remove(3);
    let coloured = |rgb: [f64; 3]| Material { reflectance: rgb.into(), ..Material::grey(0.0) };
    let lit = |material: Material, exitance: [f64; 3], factor: f64| Material {
        exitance: DVec3::from_array(exitance) * factor,
        ..material
    };
    let small = |x: f64| shapes::box_facing_out(DVec3::new(x, 1.0, 0.5), DVec3::new(x + 0.5, 1.2, 1.2));
    let (document, binary) = SceneBuilder::new()
        .part("walls", &walls, coloured([0.7, 0.5, 0.4]))
        .part(
            "block",
            &shapes::box_facing_out(DVec3::new(1.0, 0.0, 2.0), DVec3::new(2.0, 1.4, 3.0)),
            Material::grey(0.5),
        )
        .part("lamp", &small(0.5), lit(Material::grey(0.2), [9.0, 3.0, 1.0], lamp))
        .part("panel", &small(2.5), lit(Material::grey(0.2), [1.0, 4.0, 1.0], panel))
        .point_light(DVec3::new(3.0, 2.0, 4.0), 2.0 * bulbs)
        .point_light(DVec3::new(0.5, 0.3, 4.5), bulbs)
        .document();
    let mut document = document;
    for node in document["nodes"].as_array_mut().unwrap() {
        if node.get("name").is_none() {
            node["name"] = "bulb".into();
        }
    }
    let options = ImportOptions { sky, needs_light: false, ..ImportOptions::default() };
    import_slice(&pack(&document, &binary), &options).unwrap_or_else(|error| panic!("{error}"))
}

fn group(name: &str, lights: &[&str]) -> LightGroup {
    LightGroup { name: name.into(), lights: lights.iter().map(|light| (*light).to_owned()).collect() }
}

pub fn groups() -> Vec<LightGroup> {
    vec![group("warm", &["lamp", "bulb"]), group("cold", &["panel"]), group("outside", &["sky"])]
}

/// Coarse: that lights and groups are many is not to take long. With all vertices, which are then those of any light.
fn settings() -> BakeSettings {
    BakeSettings {
        shooter_edge: 0.25,
        mesh_error: 0.03,
        validation_samples: 64,
        simplify: false,
        ..BakeSettings::default()
    }
}

fn irradiances(lit: &LitMesh) -> Vec<DVec3> {
    lit.vertices.iter().map(|vertex| vertex.irradiance).collect()
}

/// Largest difference of two lights, relative to the largest value of the second.
fn difference(found: &[DVec3], expected: &[DVec3]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let largest = expected.iter().map(|value| value.max_element()).fold(0.0, f64::max);
    let worst = found.iter().zip(expected).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f64::max);
    worst / largest
}

fn sum(parts: &[Vec<DVec3>]) -> Vec<DVec3> {
    let first = vec![DVec3::ZERO; parts[0].len()];
    parts.iter().fold(first, |sum, part| sum.iter().zip(part).map(|(a, b)| *a + *b).collect())
}

fn layers(baked: &Baked) -> Vec<Vec<DVec3>> {
    baked.lit.layers.iter().map(|layer| layer.irradiance.clone()).collect()
}

#[test]
fn groups_and_parts_sum_to_the_whole() {
    let scene = court(1.0, 1.0, 1.0, SKY);
    let alone = baked(&scene, &settings());
    assert!(alone.lit.layers.is_empty());
    let whole = baked(&scene, &BakeSettings { groups: groups(), ..settings() });
    assert_eq!(
        irradiances(&whole.lit),
        irradiances(&alone.lit),
        "groups leave the whole as it is, bit for bit"
    );
    assert_eq!(whole.lit.surfaces, alone.lit.surfaces);
    let names: Vec<_> = whole.lit.layers.iter().map(|layer| layer.name.as_str()).collect();
    assert_eq!(names, ["warm", "cold", "outside"]);
    for layer in &whole.lit.layers {
        assert!(layer.irradiance.iter().any(|light| light.max_element() > 0.1), "{} is dark", layer.name);
    }
    // The whole was solved to a millionth of the reflected flux.
    let off = difference(&sum(&layers(&whole)), &irradiances(&whole.lit));
    eprintln!("groups: sum off by {off:.1e} of the largest irradiance");
    assert!(off <= 1e-6, "{off:e}");

    let part = |only: LightPart| baked(&scene, &BakeSettings { only, groups: groups(), ..settings() });
    let (direct, indirect) = (part(LightPart::Direct), part(LightPart::Indirect));
    for (sum_of_parts, whole) in [
        (sum(&[irradiances(&direct.lit), irradiances(&indirect.lit)]), irradiances(&whole.lit)),
        (sum(&layers(&direct)), irradiances(&direct.lit)),
    ] {
        let off = difference(&sum_of_parts, &whole);
        assert!(off <= 1e-12, "{off:e}");
    }
    let off = difference(&sum(&layers(&indirect)), &irradiances(&indirect.lit));
    assert!(off <= 1e-5, "{off:e}");
    assert!(irradiances(&indirect.lit).iter().any(|light| light.max_element() > 0.1));
}

/// A group must be what a scene of its lights alone is. Where no facet is divided the mesh of both is the same, and nothing is
/// fitted to the whole light; rows of f32 have other roundings, for they are added up in another order.
#[test]
fn a_group_is_what_its_lights_give_alone() {
    let unrefined = BakeSettings {
        shooter_edge: 9.0,
        max_vertices: Some(0),
        validation_samples: 0,
        factor_rounding: 0.0,
        ..settings()
    };
    let whole = baked(&court(1.0, 1.0, 1.0, SKY), &BakeSettings { groups: groups(), ..unrefined.clone() });
    let alone =
        [court(1.0, 0.0, 1.0, DVec3::ZERO), court(0.0, 1.0, 0.0, DVec3::ZERO), court(0.0, 0.0, 0.0, SKY)];
    for (scene, layer) in alone.iter().zip(&whole.lit.layers) {
        let off = difference(&layer.irradiance, &irradiances(&baked(scene, &unrefined).lit));
        eprintln!("{}: off by {off:.1e}", layer.name);
        assert!(off <= 1e-6, "{}: {off:e}", layer.name);
    }
}

#[test]
fn an_unknown_light_is_an_error_that_lists_those_that_are() {
    let scene = court(1.0, 0.0, 1.0, SKY);
    let groups = vec![group("warm", &["lamp", "candle"])];
    let error = check_groups(&scene, &groups).unwrap_err();
    assert_eq!(
        error.to_string(),
        "group warm: the scene has no light candle; its lights are: lamp, bulb, sky"
    );
    let cluster = Cluster::start(&Workers::Embedded { threads: 1 }.into()).unwrap();
    let settings = BakeSettings { groups, ..settings() };
    let refused = bake(&scene, &settings, &mut cluster.handle(0), &mut Unobserved).map(|_| ());
    assert!(matches!(refused, Err(BakeError::UnknownLight { .. })));
    cluster.shutdown();
}
