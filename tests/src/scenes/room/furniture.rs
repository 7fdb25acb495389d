//! What stands in the room.

use glam::{DMat4, DVec3};
use serde_json::json;

use super::Materials;
use crate::scenes::document::{Document, looking, standing};
use crate::scenes::geometry::{Geometry, cuboid, cushion, leaf, rounded, turned};
use crate::scenes::pictures::chance;

/// A table with turned legs, six chairs, plates and a vase.
pub(super) fn dining(document: &mut Document, materials: &Materials) {
    let place = standing(DVec3::new(2.1, 0.0, 3.6), 0.0);
    let top =
        [cushion([0.95, 0.02, 0.5], 8).moved(0.0, 0.75, 0.0), cuboid([-0.8, 0.64, -0.38], [0.8, 0.73, 0.38])];
    let top = document.mesh("table top", &[(&Geometry::of(top), materials.wood)]);
    document.show("table top", top, place);
    let leg = [
        [0.02, 0.0],
        [0.028, 0.03],
        [0.03, 0.12],
        [0.02, 0.2],
        [0.036, 0.3],
        [0.042, 0.42],
        [0.03, 0.5],
        [0.04, 0.53],
        [0.026, 0.56],
        [0.045, 0.6],
        [0.045, 0.66],
    ];
    let leg = document.mesh("table leg", &[(&turned(&rounded(&leg, 4), 24), materials.wood)]);
    let places = [(-0.76, -0.34), (0.76, -0.34), (-0.76, 0.34), (0.76, 0.34)];
    show_copies(document, "table leg", leg, place, &places, 0.0);

    let chair = chair(document, materials);
    let seats = [
        (-0.45, -0.62, 0.0),
        (0.45, -0.66, -8.0),
        (-0.45, 0.64, 176.0),
        (0.45, 0.62, 180.0),
        (-1.2, 0.0, 95.0),
        (1.25, 0.05, -82.0),
    ];
    for (index, (x, z, degrees)) in seats.into_iter().enumerate() {
        let stand = standing(DVec3::new(2.1 + x, 0.0, 3.6 + z), degrees);
        document.show(&format!("chair {index}"), chair, stand);
    }

    let plate = rounded(
        &[
            [0.0, 0.004],
            [0.06, 0.002],
            [0.08, 0.01],
            [0.125, 0.022],
            [0.127, 0.026],
            [0.08, 0.016],
            [0.0, 0.01],
        ],
        2,
    );
    let plate = document.mesh("plate", &[(&turned(&plate, 28), materials.china)]);
    let places = [(-0.45, -0.32), (0.45, -0.32), (-0.45, 0.32), (0.45, 0.32), (-0.75, 0.0), (0.75, 0.0)];
    show_copies(document, "plate", plate, place, &places, 0.771);
    let vase = rounded(
        &[
            [0.0, 0.0],
            [0.05, 0.004],
            [0.085, 0.08],
            [0.05, 0.19],
            [0.03, 0.24],
            [0.045, 0.29],
            [0.04, 0.288],
            [0.022, 0.24],
        ],
        4,
    );
    let glaze = document.paint("glaze", [0.16, 0.28, 0.52]);
    let vase = document.mesh("vase", &[(&turned(&vase, 32), glaze)]);
    document.show("vase", vase, place * DMat4::from_translation(DVec3::new(0.05, 0.771, 0.0)));
}

/// Shows a mesh at several x and z of a thing, all at one height.
fn show_copies(
    document: &mut Document,
    name: &str,
    mesh: usize,
    thing: DMat4,
    places: &[(f64, f64)],
    y: f64,
) {
    for (index, (x, z)) in places.iter().enumerate() {
        let place = thing * DMat4::from_translation(DVec3::new(*x, y, *z));
        document.show(&format!("{name} {index}"), mesh, place);
    }
}

/// A chair with its front at +z: turned legs, a cushion, a back of spindles.
fn chair(document: &mut Document, materials: &Materials) -> usize {
    let leg = [
        [0.014, 0.0],
        [0.02, 0.04],
        [0.016, 0.1],
        [0.024, 0.2],
        [0.026, 0.28],
        [0.018, 0.33],
        [0.024, 0.37],
        [0.024, 0.42],
    ];
    let leg = turned(&rounded(&leg, 3), 16);
    let spindle = [[0.008, 0.0], [0.012, 0.08], [0.015, 0.2], [0.011, 0.32], [0.008, 0.42]];
    let spindle = turned(&rounded(&spindle, 3), 12);
    let post =
        [[0.018, 0.0], [0.02, 0.2], [0.017, 0.4], [0.019, 0.5], [0.012, 0.53], [0.016, 0.55], [0.0, 0.565]];
    let post = turned(&rounded(&post, 2), 12);
    let mut wood = vec![
        cushion([0.21, 0.02, 0.2], 6).moved(0.0, 0.43, 0.0),
        cushion([0.2, 0.035, 0.012], 4).moved(0.0, 0.93, -0.19),
    ];
    for (x, z) in [(-0.17, -0.16), (0.17, -0.16), (-0.17, 0.16), (0.17, 0.16)] {
        wood.push(leg.clone().moved(x, 0.0, z));
    }
    wood.extend((-2..=2).map(|index| spindle.clone().moved(f64::from(index) * 0.065, 0.46, -0.19)));
    wood.extend([-0.2, 0.2].map(|x| post.clone().moved(x, 0.44, -0.19)));
    let seat = cushion([0.19, 0.03, 0.18], 10).moved(0.0, 0.475, 0.02).tiled(1.0, 1.0);
    document.mesh("chair", &[(&Geometry::of(wood), materials.dark_wood), (&seat, materials.cloth)])
}

/// A sofa along the wall on the right, and a round table before it.
pub(super) fn sofa(document: &mut Document, materials: &Materials) {
    let mut parts = vec![
        cushion([1.05, 0.14, 0.42], 8).moved(0.0, 0.24, 0.0),
        cushion([1.05, 0.36, 0.1], 8).moved(0.0, 0.5, -0.38),
    ];
    for x in [-1.08, 1.08] {
        parts.push(cushion([0.11, 0.27, 0.44], 8).moved(x, 0.36, 0.0));
    }
    for x in [-0.66, 0.0, 0.66] {
        parts.push(cushion([0.32, 0.08, 0.36], 10).moved(x, 0.44, 0.06));
        parts.push(cushion([0.31, 0.21, 0.09], 10).moved(x, 0.68, -0.2));
    }
    let sofa = document.mesh("sofa", &[(&Geometry::of(parts).tiled(3.0, 3.0), materials.cloth)]);
    let place = standing(DVec3::new(5.45, 0.0, 2.3), -90.0);
    document.show("sofa", sofa, place);
    let feet = turned(&[[0.02, 0.0], [0.03, 0.06], [0.03, 0.12]], 16);
    let foot = document.mesh("sofa foot", &[(&feet, materials.dark_wood)]);
    let places = [(-0.95, -0.33), (0.95, -0.33), (-0.95, 0.33), (0.95, 0.33)];
    show_copies(document, "sofa foot", foot, place, &places, 0.0);
    let table = rounded(
        &[
            [0.0, 0.0],
            [0.17, 0.004],
            [0.16, 0.03],
            [0.035, 0.07],
            [0.03, 0.2],
            [0.045, 0.3],
            [0.03, 0.38],
            [0.1, 0.41],
            [0.36, 0.42],
            [0.37, 0.435],
            [0.36, 0.45],
            [0.0, 0.45],
        ],
        3,
    );
    document.thing("round table", &turned(&table, 32).moved(4.35, 0.0, 2.35), materials.wood);
}

/// A shelf by the window, with books of coloured vertices.
pub(super) fn shelf(document: &mut Document, materials: &Materials) {
    let (width, depth) = (1.3, 0.28);
    let mut boards = vec![
        cuboid([-0.03, 0.0, 0.0], [0.0, 1.9, depth]),
        cuboid([width, 0.0, 0.0], [width + 0.03, 1.9, depth]),
    ];
    let levels = [0.08, 0.45, 0.82, 1.19, 1.56, 1.87];
    boards.extend(levels.map(|y| cuboid([0.0, y, 0.0], [width, y + 0.03, depth])));
    let place = DMat4::from_translation(DVec3::new(4.55, 0.0, 0.03));
    let mesh = document.mesh("shelf", &[(&Geometry::of(boards), materials.wood)]);
    document.show("shelf", mesh, place);
    let mut books = vec![];
    for (row, level) in levels[..5].iter().enumerate() {
        let mut x = 0.02;
        for number in 0..40 {
            let draw = |which: u64| chance(41 + which, 100 * row as u64 + number);
            let (thick, tall, deep) = (0.02 + 0.03 * draw(0), 0.2 + 0.11 * draw(1), 0.14 + 0.08 * draw(2));
            x += if draw(3) < 0.08 { 0.1 } else { 0.001 };
            if x + thick > width - 0.02 {
                break;
            }
            let colour = DVec3::new(0.12 + 0.5 * draw(4), 0.1 + 0.35 * draw(5), 0.08 + 0.35 * draw(6));
            let book = cuboid([x, level + 0.031, 0.02], [x + thick, level + 0.031 + tall, 0.02 + deep]);
            books.push(book.coloured(colour));
            x += thick;
        }
    }
    let covers = document.material("covers", json!({ "baseColorFactor": [1.0, 1.0, 1.0, 1.0] }), json!({}));
    let mesh = document.mesh("books", &[(&Geometry::of(books), covers)]);
    document.show("books", mesh, place);
}

/// A plant in the corner by the window: one leaf in many places.
pub(super) fn plant(document: &mut Document) {
    let clay = document.paint("clay", [0.55, 0.27, 0.17]);
    let earth = document.paint("earth", [0.08, 0.06, 0.04]);
    let green = document.material(
        "foliage",
        json!({ "baseColorFactor": [0.1, 0.28, 0.07, 1.0] }),
        json!({ "doubleSided": true }),
    );
    let at = DVec3::new(0.55, 0.0, 0.6);
    let pot = rounded(
        &[
            [0.0, 0.0],
            [0.15, 0.004],
            [0.19, 0.16],
            [0.21, 0.3],
            [0.225, 0.31],
            [0.225, 0.35],
            [0.2, 0.352],
            [0.19, 0.3],
        ],
        3,
    );
    document.thing("pot", &turned(&pot, 32).moved(at.x, at.y, at.z), clay);
    let ground = turned(&[[0.195, 0.3], [0.1, 0.31], [0.0, 0.315]], 24);
    document.thing("earth", &ground.moved(at.x, at.y, at.z), earth);
    let stem = turned(&rounded(&[[0.02, 0.3], [0.016, 0.7], [0.01, 1.2]], 3), 10);
    document.thing("stem", &stem.moved(at.x, at.y, at.z), green);
    let leaf = document.mesh("leaf", &[(&leaf(0.5, 0.09), green)]);
    for index in 0..48_u64 {
        let height = 0.42 + 0.78 * index as f64 / 47.0;
        let turn = 137.5 * index as f64;
        let (sine, cosine) = libm::sincos((10.0 + 45.0 * chance(51, index)).to_radians());
        // Raised about x, then turned about the stem.
        let raised = DMat4::from_cols(
            DVec3::X.extend(0.0),
            DVec3::new(0.0, cosine, -sine).extend(0.0),
            DVec3::new(0.0, sine, cosine).extend(0.0),
            DVec3::ZERO.extend(1.0),
        );
        let size = 0.75 + 0.4 * chance(52, index) - 0.25 * index as f64 / 47.0;
        let place = standing(at + DVec3::Y * height, turn) * raised * DMat4::from_scale(DVec3::splat(size));
        document.show(&format!("leaf {index}"), leaf, place);
    }
}

/// A lamp over the table, one on a stand by the sofa, a beam on the painting.
pub(super) fn lamps(document: &mut Document, materials: &Materials) {
    let glow = |document: &mut Document, name: &str, strength: f64| {
        document.material(
            name,
            json!({ "baseColorFactor": [0.0, 0.0, 0.0, 1.0] }),
            json!({
                "emissiveFactor": [1.0, 0.8, 0.55],
                "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": strength } },
            }),
        )
    };
    let bulb = glow(document, "bulb", 60.0);
    let shade = rounded(&[[0.24, 1.75], [0.19, 1.86], [0.06, 1.95], [0.05, 2.0]], 5);
    let linen = document.material(
        "linen",
        json!({ "baseColorFactor": [0.8, 0.74, 0.6, 1.0] }),
        json!({ "doubleSided": true }),
    );
    document.thing("pendant shade", &turned(&shade, 32).moved(2.1, 0.0, 3.6), linen);
    let cord = turned(&[[0.008, 2.0], [0.008, 2.4], [0.008, 2.79]], 8);
    document.thing("pendant cord", &cord.moved(2.1, 0.0, 3.6), materials.dark_wood);
    let disc = turned(&[[0.0, 1.83], [0.1, 1.83]], 12);
    document.thing("pendant light", &disc.moved(2.1, 0.0, 3.6), bulb);

    let at = DVec3::new(5.5, 0.0, 4.1);
    let stand = rounded(
        &[
            [0.0, 0.0],
            [0.16, 0.004],
            [0.15, 0.025],
            [0.03, 0.045],
            [0.013, 0.12],
            [0.012, 0.8],
            [0.012, 1.35],
            [0.0, 1.37],
        ],
        4,
    );
    document.thing("lamp stand", &turned(&stand, 20).moved(at.x, at.y, at.z), materials.brass);
    let shade = turned(&[[0.23, 1.32], [0.21, 1.44], [0.185, 1.55], [0.16, 1.66]], 32);
    document.thing("lamp shade", &shade.moved(at.x, at.y, at.z), linen);
    document.light(
        "stand",
        json!({ "type": "point", "intensity": 6.0, "color": [1.0, 0.82, 0.58] }),
        DMat4::from_translation(at + DVec3::Y * 1.5),
    );
    document.light(
        "beam",
        json!({ "type": "spot", "intensity": 14.0, "color": [1.0, 0.9, 0.75], "spot": { "innerConeAngle": 0.3, "outerConeAngle": 0.5 } }),
        looking(DVec3::new(1.5, 2.7, 2.0), DVec3::new(0.0, 1.6, 1.97)),
    );
    document.light_again("second beam", looking(DVec3::new(3.0, 2.7, 0.7), DVec3::new(4.9, 1.2, 0.2)));
}
