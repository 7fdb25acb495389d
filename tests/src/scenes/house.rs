use glam::{DMat4, DVec3};
use serde_json::json;

use super::document::{Document, looking};
use super::geometry::{Geometry, cuboid, cushion, rounded, sheet, turned};
use super::pictures;

/// Height of a storey, floor to ceiling, and of the slab over it.
const STOREY: f64 = 2.6;
const SLAB: f64 = 0.25;

/// Thickness of outer and inner walls.
const OUTER: f64 = 0.3;
const INNER: f64 = 0.12;

/// A hole in a wall: from and to along it, and its lower and upper edge over the floor.
type Opening = [f64; 4];

const DOOR: [f64; 2] = [0.0, 2.1];
const WINDOW: [f64; 2] = [0.9, 2.2];

fn opening(from: f64, to: f64, [low, high]: [f64; 2]) -> Opening {
    [from, to, low, high]
}

/// The rectangles that openings leave of a wall of this length and height: from, to, low, high.
fn left_over(length: f64, height: f64, openings: &[Opening]) -> Vec<[f64; 4]> {
    let mut rectangles = vec![];
    let mut done = 0.0;
    for &[from, to, low, high] in openings {
        rectangles.push([done, from, 0.0, height]);
        rectangles.push([from, to, 0.0, low]);
        rectangles.push([from, to, high, height]);
        done = to;
    }
    rectangles.push([done, length, 0.0, height]);
    rectangles.retain(|[from, to, low, high]| from < to && low < high);
    rectangles
}

/// A wall of boxes along x, or along z.
fn wall(start: [f64; 3], along_x: bool, length: f64, thickness: f64, openings: &[Opening]) -> Geometry {
    let [x, y, z] = start;
    Geometry::of(left_over(length, STOREY, openings).into_iter().map(|[from, to, low, high]| {
        if along_x {
            cuboid([x + from, y + low, z], [x + to, y + high, z + thickness])
        } else {
            cuboid([x, y + low, z + from], [x + thickness, y + high, z + to])
        }
    }))
}

/// A wall that is a single sheet.
fn thin_wall(start: DVec3, along: DVec3, height: f64, openings: &[Opening]) -> Geometry {
    let (length, direction) = (along.length(), along.normalize());
    Geometry::of(left_over(length, height, openings).into_iter().map(|[from, to, low, high]| {
        sheet(start + direction * from + DVec3::Y * low, direction * (to - from), DVec3::Y * (high - low))
    }))
}

/// A house of two storeys with thick walls, beside it a studio of single sheets, in a garden. Sun; the sky is given with `--sky`.
pub fn house() -> Vec<u8> {
    let mut document = Document::default();
    let textured = |document: &mut Document, name: &str, png: &[u8]| {
        let picture = document.picture(name, png);
        document.material(name, json!({ "baseColorTexture": picture }), json!({}))
    };
    let grass = textured(&mut document, "grass", &pictures::grass());
    let bricks = textured(&mut document, "bricks", &pictures::bricks());
    let planks = textured(&mut document, "planks", &pictures::planks());
    let plaster = document.paint("plaster", [0.78, 0.76, 0.7]);
    let inside = document.paint("inner plaster", [0.8, 0.79, 0.76]);
    let concrete = document.paint("concrete", [0.55, 0.54, 0.52]);
    let wood = document.paint("oak", [0.5, 0.33, 0.18]);
    let bark = document.paint("bark", [0.2, 0.14, 0.09]);
    let leaves = document.paint("leaves", [0.12, 0.24, 0.07]);
    let both = json!({ "doubleSided": true });
    let tiles =
        document.material("tiles", json!({ "baseColorFactor": [0.45, 0.17, 0.11, 1.0] }), both.clone());
    let board = document.material("board", json!({ "baseColorFactor": [0.74, 0.7, 0.62, 1.0] }), both);

    document.thing(
        "garden",
        &sheet(DVec3::new(-14.0, 0.0, 14.0), DVec3::X * 28.0, DVec3::NEG_Z * 28.0).tiled(0.5, 0.5),
        grass,
    );
    document.thing("path", &cuboid([3.6, 0.0, 6.0], [4.8, 0.04, 13.0]), concrete);

    // Storeys stand on slabs; the floor's boards lie on these between the walls.
    let (width, depth) = (8.0, 6.0);
    let floor = [0.1, 0.1 + STOREY + SLAB];
    document.thing("foundation", &cuboid([0.0, 0.0, 0.0], [width, floor[0], depth]), concrete);
    // The stairs come up through this hole.
    let hole = [5.4, 7.7, 0.3, 1.3];
    let slab = floor[1] - SLAB;
    let around = [
        cuboid([0.0, slab, 0.0], [hole[0], floor[1], depth]),
        cuboid([hole[1], slab, 0.0], [width, floor[1], depth]),
        cuboid([hole[0], slab, 0.0], [hole[1], floor[1], hole[2]]),
        cuboid([hole[0], slab, hole[3]], [hole[1], floor[1], depth]),
    ];
    document.thing("upper slab", &Geometry::of(around), inside);
    let top = floor[1] + STOREY;
    document.thing("top slab", &cuboid([0.0, top, 0.0], [width, top + SLAB, depth]), inside);

    let south = [
        vec![opening(1.0, 2.6, WINDOW), opening(3.7, 4.7, DOOR), opening(5.6, 7.0, WINDOW)],
        vec![opening(1.0, 2.6, WINDOW), opening(3.5, 4.9, WINDOW), opening(5.6, 7.0, WINDOW)],
    ];
    let north = [vec![opening(1.4, 2.8, WINDOW)], vec![opening(1.4, 2.8, WINDOW), opening(6.0, 7.0, WINDOW)]];
    let west = [vec![opening(2.0, 3.6, WINDOW)], vec![opening(2.0, 3.4, WINDOW)]];
    for (storey, name) in ["ground floor", "upper floor"].into_iter().enumerate() {
        let y = floor[storey];
        let outer = [
            wall([0.0, y, depth - OUTER], true, width, OUTER, &south[storey]),
            wall([0.0, y, 0.0], true, width, OUTER, &north[storey]),
            wall([0.0, y, OUTER], false, depth - 2.0 * OUTER, OUTER, &west[storey]),
            wall([width - OUTER, y, OUTER], false, depth - 2.0 * OUTER, OUTER, &[]),
        ];
        document.thing(
            &format!("{name}, outer walls"),
            &Geometry::of(outer),
            if storey == 0 { bricks } else { plaster },
        );
        let inner = [
            wall([3.2, y, OUTER], false, depth - 2.0 * OUTER, INNER, &[opening(3.4, 4.3, DOOR)]),
            wall([3.2 + INNER, y, 2.9], true, width - OUTER - 3.2 - INNER, INNER, &[opening(0.6, 1.6, DOOR)]),
        ];
        document.thing(&format!("{name}, inner walls"), &Geometry::of(inner), inside);
    }
    let laid = |low: [f64; 3], high: [f64; 3]| {
        sheet(
            DVec3::new(low[0], high[1], high[2]),
            DVec3::X * (high[0] - low[0]),
            DVec3::NEG_Z * (high[2] - low[2]),
        )
    };
    let ground_boards = laid([OUTER, 0.0, OUTER], [3.2, floor[0] + 0.01, depth - OUTER]);
    document.thing("boards", &ground_boards, planks);
    let steps = 14;
    let rise = (floor[1] - floor[0]) / f64::from(steps);
    let run = 2.8 / f64::from(steps);
    let step = |index: u32| {
        let (from, up) = (7.6 - run * f64::from(index + 1), floor[0] + rise * f64::from(index));
        cuboid([from, up + rise - 0.05, 0.35], [from + run + 0.03, up + rise, 1.25])
    };
    document.thing("stairs", &Geometry::of((0..steps - 1).map(step)), wood);
    document.thing("table", &table(), wood);

    // The roof: two sheets that overhang, and gables of sheets.
    let (eaves, ridge) = (top + SLAB, top + SLAB + 1.9);
    let slope = |z: f64, out: f64| {
        let along = DVec3::X * (width + 0.8);
        let rise =
            DVec3::new(0.0, (ridge - eaves) * (depth / 2.0 + 0.4) / (depth / 2.0), (depth / 2.0 + 0.4) * out);
        let low = DVec3::new(-0.4, ridge - rise.y, z - rise.z);
        if out < 0.0 { sheet(low, along, rise) } else { sheet(low + along, -along, rise) }
    };
    document.thing("roof", &Geometry::of([slope(depth / 2.0, -1.0), slope(depth / 2.0, 1.0)]), tiles);
    let gable = |x: f64, turn: bool| {
        let corners =
            [DVec3::new(x, eaves, 0.0), DVec3::new(x, eaves, depth), DVec3::new(x, ridge, depth / 2.0)];
        let mut geometry = sheet(corners[0], corners[1] - corners[0], DVec3::Y);
        geometry.positions = corners.to_vec();
        geometry.normals.truncate(3);
        geometry.places.truncate(3);
        geometry.triangles = vec![if turn { [0, 2, 1] } else { [0, 1, 2] }];
        if turn {
            geometry.normals.iter_mut().for_each(|normal| *normal = -*normal);
        }
        geometry
    };
    document.thing("gables", &Geometry::of([gable(0.0, false), gable(width, true)]), board);
    document.thing("chimney", &cuboid([6.2, eaves + 0.9, 1.4], [6.8, ridge + 0.7, 2.0]), bricks);

    // The studio: single sheets, both sides of each.
    let corner = DVec3::new(width, 0.0, 1.0);
    let (along, back) = (DVec3::X * 4.5, DVec3::Z * 4.0);
    let studio = [
        thin_wall(corner + back, along, 2.5, &[opening(0.5, 2.0, [0.8, 2.0]), opening(2.8, 3.8, [0.0, 2.0])]),
        thin_wall(corner + along + back, -back, 2.5, &[opening(1.0, 3.0, [0.8, 2.0])]),
        thin_wall(corner + along, -along, 2.5, &[]),
        sheet(corner + DVec3::Y * 2.5 + back, along, -back),
    ];
    document.thing("studio", &Geometry::of(studio), board);

    let trunk = rounded(&[[0.28, 0.0], [0.17, 0.6], [0.14, 1.6], [0.1, 2.6]], 2);
    let trunk = document.mesh("trunk", &[(&turned(&trunk, 10), bark)]);
    let crown = document.mesh("crown", &[(&cushion([1.1, 1.4, 1.1], 5), leaves)]);
    for (index, (x, z, size)) in
        [(-3.5, 9.0, 1.0), (11.0, 9.5, 1.25), (-4.0, -3.0, 1.4)].into_iter().enumerate()
    {
        let place = DMat4::from_translation(DVec3::new(x, 0.0, z)) * DMat4::from_scale(DVec3::splat(size));
        document.show(&format!("trunk {index}"), trunk, place);
        document.show(&format!("crown {index}"), crown, place * DMat4::from_translation(DVec3::Y * 3.2));
    }

    document.light(
        "sun",
        json!({ "type": "directional", "intensity": 10.0, "color": [1.0, 0.94, 0.82] }),
        looking(DVec3::new(-2.4, 3.2, 3.0), DVec3::ZERO),
    );
    document.camera("garden", DVec3::new(-3.2, 3.4, 17.5), DVec3::new(5.5, 3.0, 3.0), 0.8);
    document.camera("studio side", DVec3::new(15.0, 2.6, 8.0), DVec3::new(7.0, 2.4, 3.0), 0.8);
    document.camera("living room", DVec3::new(0.6, 1.6, 0.7), DVec3::new(2.2, 1.0, 5.5), 1.15);
    document.camera("stairs", DVec3::new(3.7, 1.7, 2.7), DVec3::new(7.2, 1.4, 0.6), 1.1);
    document.glb()
}

/// A table in the living room.
fn table() -> Geometry {
    let leg = |x: f64, z: f64| cuboid([x, 0.1, z], [x + 0.07, 0.8, z + 0.07]);
    Geometry::of([
        cuboid([0.9, 0.8, 2.4], [2.3, 0.84, 3.3]),
        leg(0.95, 2.45),
        leg(2.18, 2.45),
        leg(0.95, 3.18),
        leg(2.18, 3.18),
    ])
}
