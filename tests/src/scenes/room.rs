use glam::{DMat4, DVec3};
use serde_json::json;

use super::document::{Document, looking};
use super::geometry::{Geometry, cuboid, curtain, sheet, turned};
use super::pictures;
use furniture::{dining, lamps, plant, shelf, sofa};

mod furniture;

/// The room: x to the right, z towards the eye, the window in the wall at z = 0.
const SIZE: DVec3 = DVec3::new(6.0, 2.8, 5.0);

/// The window: from and to along x, lower and upper edge.
const WINDOW: [f64; 4] = [1.9, 4.1, 0.85, 2.25];

/// Materials that several things are made of.
struct Materials {
    wood: usize,
    dark_wood: usize,
    white: usize,
    cloth: usize,
    china: usize,
    brass: usize,
}

/// A furnished room with some 56,000 triangles where they stand: textures, turned wood, cushions, lace before a window, a plant.
pub fn room() -> Vec<u8> {
    let mut document = Document::default();
    let textured = |document: &mut Document, name: &str, png: &[u8]| {
        let picture = document.picture(name, png);
        document.material(name, json!({ "baseColorTexture": picture }), json!({}))
    };
    let planks = textured(&mut document, "planks", &pictures::planks());
    let wallpaper = textured(&mut document, "wallpaper", &pictures::wallpaper());
    let rug = textured(&mut document, "rug", &pictures::rug());
    let painting = textured(&mut document, "painting", &pictures::painting());
    let cloth = textured(&mut document, "cloth", &pictures::cloth());
    let materials = Materials {
        wood: document.paint("cherry", [0.45, 0.24, 0.12]),
        dark_wood: document.paint("walnut", [0.22, 0.13, 0.08]),
        white: document.paint("white lacquer", [0.82, 0.82, 0.8]),
        cloth,
        china: document.paint("china", [0.84, 0.84, 0.86]),
        brass: document.material(
            "brass",
            json!({ "baseColorFactor": [0.75, 0.6, 0.32, 1.0], "metallicFactor": 0.6, "roughnessFactor": 0.4 }),
            json!({}),
        ),
    };
    shell(&mut document, planks, wallpaper, &materials);
    window(&mut document, &materials);
    let plaid = cuboid([2.0, 0.0, 1.1], [4.0, 0.012, 2.6]);
    document.thing("rug edge", &plaid, materials.dark_wood);
    let pile = sheet(DVec3::new(2.02, 0.016, 2.58), DVec3::X * 1.96, DVec3::NEG_Z * 1.46)
        .tiled(1.0 / 1.96, 1.0 / 1.46);
    document.thing("rug", &pile, rug);
    dining(&mut document, &materials);
    sofa(&mut document, &materials);
    shelf(&mut document, &materials);
    plant(&mut document);
    lamps(&mut document, &materials);

    let frame = cuboid([0.0, 1.25, 1.45], [0.035, 2.05, 2.5]);
    document.thing("frame", &frame, materials.dark_wood);
    let canvas =
        sheet(DVec3::new(0.04, 1.3, 2.45), DVec3::NEG_Z * 0.95, DVec3::Y * 0.7).tiled(1.0 / 0.95, 1.0 / 0.7);
    document.thing("painting", &canvas, painting);

    document.camera("door", DVec3::new(5.5, 1.65, 4.8), DVec3::new(1.9, 0.85, 1.2), 0.95);
    document.camera("sofa", DVec3::new(5.2, 1.3, 1.0), DVec3::new(1.3, 0.8, 3.4), 0.9);
    document.camera("table", DVec3::new(0.5, 1.7, 4.7), DVec3::new(3.6, 0.9, 1.6), 0.95);
    document.glb()
}

/// Floor, ceiling and walls, all single sheets, and skirting boards.
fn shell(document: &mut Document, planks: usize, wallpaper: usize, materials: &Materials) {
    let [x, y, z] = [DVec3::X * SIZE.x, DVec3::Y * SIZE.y, DVec3::Z * SIZE.z];
    document.thing("floor", &sheet(z, x, -z).tiled(0.7, 0.7), planks);
    document.thing("ceiling", &sheet(y, x, z), materials.white);
    let [from, to, low, high] = WINDOW;
    let strip = |from: f64, to: f64, low: f64, high: f64| {
        sheet(DVec3::new(from, low, 0.0), DVec3::X * (to - from), DVec3::Y * (high - low))
    };
    let walls = [
        strip(0.0, from, 0.0, SIZE.y),
        strip(to, SIZE.x, 0.0, SIZE.y),
        strip(from, to, 0.0, low),
        strip(from, to, high, SIZE.y),
        sheet(z, -z, y),
        sheet(x, z, y),
        sheet(x + z, -x, y),
    ];
    document.thing("walls", &Geometry::of(walls).tiled(1.25, 1.25), wallpaper);
    let board = 0.02;
    let boards = [
        cuboid([board, 0.0, 0.0], [SIZE.x - board, 0.1, board]),
        cuboid([board, 0.0, SIZE.z - board], [SIZE.x - board, 0.1, SIZE.z]),
        cuboid([0.0, 0.0, 0.0], [board, 0.1, SIZE.z]),
        cuboid([SIZE.x - board, 0.0, 0.0], [SIZE.x, 0.1, SIZE.z]),
    ];
    document.thing("skirting", &Geometry::of(boards), materials.white);
}

/// A frame around a pane, a sill, lace to both sides of it on a rod, and the sun.
fn window(document: &mut Document, materials: &Materials) {
    let [from, to, low, high] = WINDOW;
    let (outside, width) = (-0.12, 0.06);
    let middle = 0.5 * (from + to);
    let frame = [
        cuboid([from - width, low, outside], [from, high, 0.0]),
        cuboid([to, low, outside], [to + width, high, 0.0]),
        cuboid([from - width, high, outside], [to + width, high + width, 0.0]),
        cuboid([from - width, low - width, outside], [to + width, low, 0.0]),
        cuboid([middle - 0.025, low, -0.09], [middle + 0.025, high, -0.05]),
        cuboid([from - 0.12, low - 0.03, 0.0], [to + 0.12, low, 0.16]),
    ];
    document.thing("window frame", &Geometry::of(frame), materials.white);
    let glass = document.material(
        "window glass",
        json!({ "baseColorFactor": [0.5, 0.6, 0.6, 0.12] }),
        json!({ "alphaMode": "BLEND", "doubleSided": true }),
    );
    let pane = sheet(DVec3::new(from, low, -0.07), DVec3::X * (to - from), DVec3::Y * (high - low));
    document.thing("pane", &pane, glass);

    let lace = document.picture("lace", &pictures::lace());
    let lace = document.material(
        "lace",
        json!({ "baseColorTexture": lace }),
        json!({ "alphaMode": "MASK", "alphaCutoff": 0.5, "doubleSided": true }),
    );
    let cloth = curtain(0.75, 2.25, 6.0, 0.05, [96, 8]).tiled(4.0, 4.0);
    let mesh = document.mesh("curtain", &[(&cloth, lace)]);
    document.show("left curtain", mesh, DMat4::from_translation(DVec3::new(from - 0.4, 0.15, 0.1)));
    document.show("right curtain", mesh, DMat4::from_translation(DVec3::new(to - 0.35, 0.15, 0.1)));
    let rod = turned(&[[0.012, 0.0], [0.012, 1.6], [0.012, 3.2]], 12);
    let rod = document.mesh("rod", &[(&rod, materials.brass)]);
    let lying = DMat4::from_cols(
        DVec3::NEG_Y.extend(0.0),
        DVec3::X.extend(0.0),
        DVec3::Z.extend(0.0),
        DVec3::ZERO.extend(1.0),
    );
    document.show("rod", rod, DMat4::from_translation(DVec3::new(from - 0.5, 2.43, 0.1)) * lying);

    document.light(
        "sun",
        json!({ "type": "directional", "intensity": 60.0, "color": [1.0, 0.93, 0.8] }),
        looking(DVec3::new(0.9, 2.3, -2.6), DVec3::ZERO),
    );
}
