use glam::{DMat4, DVec3};
use serde_json::json;

use super::document::Document;
use super::geometry::{cuboid, curtain, cushion, rounded, sheet, turned};
use super::pictures;

/// Cushions and vases along each side of the room's floor.
const ALONG: u32 = 4;

/// Half of the room's width, and its height.
const HALF: f64 = 3.0;
const HEIGHT: f64 = 2.8;

/// A room of about so many textured triangles, to measure time and memory with: cushions and vases in rows on a floor of planks, cloth
/// at the walls, a lamp at the ceiling. Where [`super::all`] asks for everything at once, this asks for nothing but many small
/// curved triangles.
#[must_use]
pub fn fine_room(triangles: u32) -> Vec<u8> {
    let mut document = Document::default();
    let textured = |document: &mut Document, name: &str, png: &[u8]| {
        let picture = document.picture(name, png);
        document.material(name, json!({ "baseColorTexture": picture }), json!({}))
    };
    let planks = textured(&mut document, "planks", &pictures::planks());
    let wallpaper = textured(&mut document, "wallpaper", &pictures::wallpaper());
    let rug = textured(&mut document, "rug", &pictures::rug());
    let cloth = textured(&mut document, "cloth", &pictures::cloth());
    let white = document.paint("ceiling", [0.82, 0.81, 0.78]);
    let lamp = document.material(
        "lamp",
        json!({ "baseColorFactor": [0.5, 0.5, 0.5, 1.0] }),
        json!({ "emissiveFactor": [1.0, 0.94, 0.84] }),
    );

    let (width, depth, up) = (DVec3::X * 2.0 * HALF, DVec3::Z * 2.0 * HALF, DVec3::Y * HEIGHT);
    let corner = DVec3::new(-HALF, 0.0, -HALF);
    document.thing("floor", &sheet(corner + depth, width, -depth), planks);
    document.thing("ceiling", &sheet(corner + up, width, depth), white);
    document.thing("back", &sheet(corner, width, up), wallpaper);
    document.thing("front", &sheet(corner + width + depth, -width, up), wallpaper);
    document.thing("left", &sheet(corner + depth, -depth, up), wallpaper);
    document.thing("right", &sheet(corner + width, depth, up), wallpaper);
    document.thing("lamp", &cuboid([-0.5, 2.7, -0.5], [0.5, HEIGHT, 0.5]), lamp);

    // A third each for cushions, vases and cloth.
    let third = f64::from(triangles) / 3.0;
    let things = f64::from(ALONG * ALONG) / 2.0;
    let side = |triangles: f64, parts: f64| (triangles / parts).sqrt().round().max(2.0) as u32;
    let cells = side(third / things, 12.0);
    let cushions = document.mesh("cushion", &[(&cushion([0.4, 0.15, 0.4], cells), rug)]);
    let steps = side(third / things, 2.0 * 4.0 * 4.0);
    let profile = rounded(&[[0.0, 0.0], [0.2, 0.05], [0.3, 0.5], [0.12, 0.9], [0.18, 1.1]], steps);
    let vases = document.mesh("vase", &[(&turned(&profile, 4 * steps), cloth)]);
    for (row, column) in (0..ALONG).flat_map(|row| (0..ALONG).map(move |column| (row, column))) {
        let at = |index: u32| (f64::from(index) + 0.5) / f64::from(ALONG) * 4.4 - 2.2;
        let (mesh, height) = if (row + column) % 2 == 0 { (cushions, 0.16) } else { (vases, 0.001) };
        let place = DMat4::from_translation(DVec3::new(at(row), height, at(column)));
        document.show(&format!("thing {row} {column}"), mesh, place);
    }
    let cells = side(third / 2.0, 2.0 * 4.0);
    let hanging = document.mesh("cloth", &[(&curtain(5.0, 2.4, 9.0, 0.06, [4 * cells, cells]), cloth)]);
    let place = |x: f64, z: f64, degrees: f64| {
        DMat4::from_translation(DVec3::new(x, 0.1, z)) * DMat4::from_rotation_y(degrees.to_radians())
    };
    document.show("cloth at the left", hanging, place(-2.85, 2.5, 90.0));
    document.show("cloth at the back", hanging, place(-2.5, -2.85, 0.0));
    document.camera("eye", DVec3::new(2.7, 1.9, 2.8), DVec3::new(-1.0, 0.6, -1.0), 1.0);
    document.glb()
}
