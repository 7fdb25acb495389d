use glam::{DMat4, DVec3};
use serde_json::json;

use super::document::{Document, looking, standing};
use super::geometry::{cuboid, sheet, turned};
use super::pictures;

/// Edge of the box.
const EDGE: f64 = 5.5;

/// A Cornell box with a chequered floor, a spectrum on the back wall, coloured vertices, a sheet of lace and a bright screen.
pub fn cornell_textured() -> Vec<u8> {
    let mut document = Document::default();
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * EDGE);
    let textured = |document: &mut Document, name: &str, png: &[u8]| {
        let picture = document.picture(name, png);
        document.material(name, json!({ "baseColorTexture": picture }), json!({}))
    };
    let board = textured(&mut document, "board", &pictures::squares([0.86, 0.84, 0.8], [0.32, 0.34, 0.38]));
    let spectrum = textured(&mut document, "spectrum", &pictures::spectrum());
    let white = document.paint("white", [0.73, 0.73, 0.73]);
    let green = document.paint("green", [0.14, 0.45, 0.09]);
    let red = document.paint("red", [0.63, 0.06, 0.05]);

    document.thing("floor", &sheet(z, x, -z).tiled(0.25, 0.25), board);
    document.thing("ceiling", &sheet(y, x, z), white);
    document.thing("back wall", &sheet(DVec3::ZERO, x, y).tiled(1.0 / EDGE, 1.0 / EDGE), spectrum);
    document.thing("left wall", &sheet(z, -z, y), red);
    document.thing("right wall", &sheet(x, z, y), green);
    document.thing("front wall", &sheet(x + z, -x, y), white);

    let mut courses = document.picture("bricks", &pictures::bricks());
    courses["extensions"] =
        json!({ "KHR_texture_transform": { "offset": [0.2, 0.1], "rotation": 0.3, "scale": [0.8, 0.6] } });
    let block = document.material("block", json!({ "baseColorTexture": courses }), json!({}));
    let tall = cuboid([-0.8, 0.0, -0.8], [0.8, 3.3, 0.8]);
    let mesh = document.mesh("tall block", &[(&tall, block)]);
    document.show("tall block", mesh, standing(DVec3::new(1.85, 0.0, 1.7), 17.0));

    let dyed = document.material("dyed", json!({ "baseColorFactor": [0.9, 0.9, 0.9, 1.0] }), json!({}));
    let mut short = cuboid([-0.8, 0.0, -0.8], [0.8, 1.6, 0.8]);
    let dye = |p: &DVec3| DVec3::new(0.15 + 0.7 * p.y / 1.6, 0.5, 0.85 - 0.4 * (p.x + 0.8) / 1.6);
    short.colours = short.positions.iter().map(dye).collect();
    let mesh = document.mesh("short block", &[(&short, dyed)]);
    document.show("short block", mesh, standing(DVec3::new(3.7, 0.0, 3.4), -17.0));

    let lace = document.picture("lace", &pictures::lace());
    let lace = document.material(
        "lace",
        json!({ "baseColorTexture": lace }),
        json!({ "alphaMode": "MASK", "alphaCutoff": 0.5, "doubleSided": true }),
    );
    let veil = sheet(DVec3::new(-0.9, 0.0, 0.0), DVec3::X * 1.8, DVec3::Y * 1.2).tiled(2.0, 2.0);
    let mesh = document.mesh("veil", &[(&veil, lace)]);
    document.show("veil", mesh, standing(DVec3::new(3.9, 1.9, 2.2), -35.0));

    let glass = document.material(
        "glass",
        json!({ "baseColorFactor": [0.3, 0.5, 0.55, 0.35] }),
        json!({ "alphaMode": "BLEND", "doubleSided": true }),
    );
    let jar = turned(&[[0.32, 0.0], [0.32, 0.5], [0.32, 1.0]], 24);
    let mesh = document.mesh("jar", &[(&jar, glass)]);
    document.show("jar", mesh, DMat4::from_translation(DVec3::new(3.6, 1.6, 3.5)));

    let lamp = document.material(
        "lamp",
        json!({ "baseColorFactor": [0.0, 0.0, 0.0, 1.0] }),
        json!({
            "emissiveFactor": [1.0, 0.74, 0.36],
            "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 14.0 } },
        }),
    );
    let panel = sheet(DVec3::new(2.1, EDGE - 0.02, 2.2), DVec3::X * 1.3, DVec3::Z * 1.05);
    document.thing("lamp", &panel, lamp);

    let painting = document.picture("painting", &pictures::painting());
    let screen = document.material(
        "screen",
        json!({ "baseColorFactor": [0.05, 0.05, 0.05, 1.0] }),
        json!({
            "emissiveFactor": [1.0, 1.0, 1.0], "emissiveTexture": painting,
            "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 1.5 } },
        }),
    );
    let picture =
        sheet(DVec3::new(EDGE - 0.02, 2.6, 1.5), DVec3::Z * 1.6, DVec3::Y * 1.2).tiled(1.0 / 1.6, 1.0 / 1.2);
    document.thing("screen", &picture, screen);

    let middle = DVec3::splat(EDGE / 2.0);
    document.camera(
        "front",
        DVec3::new(EDGE / 2.0, EDGE / 2.0, EDGE - 0.1),
        DVec3::new(EDGE / 2.0, 2.3, 0.0),
        1.15,
    );
    document.camera("corner", DVec3::new(0.4, 4.6, 5.1), middle - DVec3::Y * 0.8, 1.1);
    document.light(
        "beam",
        json!({ "type": "spot", "intensity": 12.0, "color": [1.0, 0.95, 0.85], "spot": { "innerConeAngle": 0.25, "outerConeAngle": 0.4 } }),
        looking(DVec3::new(0.5, 5.0, 5.0), DVec3::new(1.8, 2.6, 2.4)),
    );
    document.glb()
}
