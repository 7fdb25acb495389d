//! Triangles wound the wrong way are reported by name, and nothing else is.

use glam::DVec3;
use tests::builder::{Material, SceneBuilder};
use tests::shapes::{self, Polygon, box_facing_in, box_facing_out, turned};

use super::checked::{CLOSED, Expectation, OPEN, checked, coarse};

/// A room whose walls are parts of their own, with a box over the floor; a lamp under the ceiling.
fn room(walls: &[Polygon], solid: &[Polygon]) -> SceneBuilder {
    let names = ["left", "right", "front", "back", "floor", "ceiling"];
    let lamp = box_facing_out(DVec3::new(0.3, 0.3, 0.9), DVec3::new(0.6, 0.6, 0.95));
    let parts = walls.iter().zip(names);
    parts
        .fold(SceneBuilder::new(), |builder, (wall, name)| {
            builder.part(name, std::slice::from_ref(wall), Material::grey(0.6))
        })
        .part("lamp", &lamp, Material::grey(0.2).emitting(10.0))
        .part("box", solid, Material::grey(0.5))
}

fn solid() -> Vec<Polygon> {
    box_facing_out(DVec3::new(0.2, 0.3, 0.1), DVec3::new(0.5, 0.7, 0.4))
}

/// The warnings of a bake. Flipped surfaces let light escape.
fn warnings(builder: &SceneBuilder) -> Vec<String> {
    let expected = Expectation { imbalance: 0.05, warns: Some(true), ..OPEN };
    checked(builder, &coarse(), expected).baked.report.warnings
}

fn assert_warns(warnings: &[String], names: &[&str]) {
    assert_eq!(warnings.len(), names.len(), "{warnings:?}");
    for (warning, name) in warnings.iter().zip(names) {
        let words = [&format!("node \"{name}\""), "back", "flip its triangles"];
        assert!(words.iter().all(|word| warning.contains(*word)), "{name}: {warning}");
    }
}

/// A room of the right winding, and one closed only by a sheet of two sides, have nothing to report.
#[test]
fn nothing_flipped() {
    checked(&room(&shapes::unit_room(), &solid()), &coarse(), CLOSED);
    let mut walls = shapes::unit_room();
    walls[1] = turned(&walls[1..2]).remove(0);
    let right = walls.remove(1);
    let builder = SceneBuilder::new().part("walls", &walls, Material::grey(0.6).emitting(0.5)).part(
        "right",
        &[right],
        Material::grey(0.6).double_sided(),
    );
    checked(&builder, &coarse(), CLOSED);
}

/// Its front looks out of the room and gets nothing, its back gets a sixth of the light and more.
#[test]
fn wall_of_a_room() {
    let mut walls = shapes::unit_room();
    walls[1] = turned(&walls[1..2]).remove(0);
    assert_warns(&warnings(&room(&walls, &solid())), &["right"]);
}

#[test]
fn whole_room() {
    let walls = turned(&shapes::unit_room());
    assert_warns(&warnings(&room(&walls, &solid())), &["left", "right", "front", "back", "floor", "ceiling"]);
}

/// Inside out: its rows sum to 1, since it sees its own fronts; the room sees its back.
#[test]
fn box_inside_out() {
    assert_warns(&warnings(&room(&shapes::unit_room(), &turned(&solid()))), &["box"]);
    // As small as a vase in a hall.
    let vase = box_facing_in(DVec3::new(0.5, 0.5, 0.3), DVec3::new(0.52, 0.52, 0.33));
    assert_warns(&warnings(&room(&shapes::unit_room(), &vase)), &["box"]);
}

/// Light falls on its back as on its front: it may be meant to have both.
#[test]
fn sheet_in_the_light() {
    let sheet = vec![vec![
        DVec3::new(0.2, 0.2, 0.5),
        DVec3::new(0.7, 0.2, 0.5),
        DVec3::new(0.7, 0.8, 0.5),
        DVec3::new(0.2, 0.8, 0.5),
    ]];
    let found = warnings(&room(&shapes::unit_room(), &sheet));
    assert_warns(&found, &["box"]);
    assert!(found[0].contains("double-sided"), "{found:?}");
    // Two sheets back to back have no back.
    let both = [sheet.clone(), turned(&sheet)].concat();
    checked(&room(&shapes::unit_room(), &both), &coarse(), CLOSED);
}
