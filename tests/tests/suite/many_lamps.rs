//! Many small lamps, which share rows, against the same lamps with a row for each.

use bake::{BakeSettings, LightGroup, RowStrategy};
use glam::DVec3;
use scene::Scene;
use tests::baking::{baked, baked_by, imported};
use tests::builder::{Material, SceneBuilder};
use tests::shapes;

const LAMPS_ALONG: u32 = 20;

/// Two halves of a room, with a door in the wall between them, under a ceiling of small lamps: half of these are hidden, at least.
fn halves() -> Scene {
    let room = shapes::box_facing_in(DVec3::ZERO, DVec3::new(6.0, 3.0, 6.0));
    let wall = shapes::box_facing_out(DVec3::new(2.95, 0.0, 0.0), DVec3::new(3.05, 3.0, 5.0));
    let builder =
        SceneBuilder::new().part("room", &room, Material::grey(0.5)).part("wall", &wall, Material::grey(0.3));
    let lamps = (0..LAMPS_ALONG * LAMPS_ALONG).fold(builder, |builder, index| {
        let at = |place: u32| 0.15 + 0.3 * f64::from(place);
        let low = DVec3::new(at(index % LAMPS_ALONG), 2.9, at(index / LAMPS_ALONG));
        let (x, z) = (0.04 * DVec3::X, 0.04 * DVec3::Z);
        // They face down.
        let lamp = vec![low, low + x, low + x + z, low + z];
        builder.part(&name_of(index), &[lamp], Material::grey(0.0).emitting(100.0))
    });
    imported(&lamps.glb())
}

fn name_of(lamp: u32) -> String {
    format!("lamp {lamp}")
}

fn settings() -> BakeSettings {
    let lights = (0..LAMPS_ALONG * LAMPS_ALONG).map(name_of).collect();
    let groups = vec![LightGroup { name: "all".to_owned(), lights }];
    BakeSettings { rows: RowStrategy::Gather, groups, simplify: false, ..BakeSettings::for_error(0.05) }
}

/// Groups have rows for each lamp, the whole has not.
#[test]
fn lamps_that_share_rows_give_the_light_of_each() {
    let baked = baked(&halves(), &settings());
    let rows = baked.report.model.area_lights;
    assert!((1..=4).contains(&rows), "{rows} rows for {} lamps", LAMPS_ALONG * LAMPS_ALONG);
    let whole = baked.lit.vertices.iter().map(|vertex| vertex.irradiance);
    let (mut off, mut all, mut sum, mut expected) = (0.0, 0.0, DVec3::ZERO, DVec3::ZERO);
    for (found, own) in whole.zip(&baked.lit.layers[0].irradiance) {
        off += (found - *own).length_squared();
        all += own.length_squared();
        (sum, expected) = (sum + found, expected + *own);
    }
    let (error, mean) = ((off / all).sqrt(), (sum / expected - 1.0).abs().max_element());
    eprintln!("{rows} rows: off by {:.2} %, in the mean {:.2} %", 100.0 * error, 100.0 * mean);
    assert!(error > 0.0, "rows of each are others");
    assert!(error <= 0.01, "off by {:.2} %", 100.0 * error);
    assert!(mean <= 0.002, "off by {:.2} % in the mean", 100.0 * mean);
}

#[test]
fn lamps_that_share_rows_have_the_same_bits_whatever_the_threads() {
    let scene = halves();
    let settings = BakeSettings { groups: vec![], ..settings() };
    let bits = |threads| -> Vec<[u64; 3]> {
        let lit = baked_by(&scene, &settings, threads).lit;
        lit.vertices.iter().map(|vertex| vertex.irradiance.to_array().map(f64::to_bits)).collect()
    };
    assert_eq!(bits(1), bits(3));
}
