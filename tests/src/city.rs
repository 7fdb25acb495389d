//! A city of box buildings along streets, open to the sky, with every wall, roof and street divided into facets: what view
//! factors of large scenes are measured with.

use glam::DVec3;

use crate::builder::{Material, SceneBuilder};
use crate::shapes::Polygon;

/// Width of a building, metres.
const BUILDING: f64 = 20.0;

/// Width of a street, metres.
const STREET: f64 = 16.0;

/// Buildings in a row.
const ROW: u32 = 8;

/// A city of about this many facets: 8 x 8 buildings of four to ten storeys. Its parts are `ground` and `building 0` to
/// `building 63`.
#[must_use]
pub fn city(facets: usize) -> SceneBuilder {
    let buildings =
        (1_u32..).map(|cells| (cells, all_buildings(cells))).take_while(|(_, count)| *count <= facets);
    // Squares on the ground of half to twice the edge of those on the buildings.
    let both = buildings.flat_map(|(cells, count)| {
        (cells.div_ceil(2)..=2 * cells)
            .map(move |on_ground| ([cells, on_ground], count + ground(on_ground).len()))
    });
    let best = both.min_by_key(|(_, count)| count.abs_diff(facets));
    let [cells, on_ground] = best.map_or([1, 1], |(cells, _)| cells);
    let mut scene = SceneBuilder::new().part("ground", &ground(on_ground), Material::grey(0.2));
    for index in 0..ROW * ROW {
        scene = scene.part(&format!("building {index}"), &building(index, cells), Material::grey(0.4));
    }
    scene
}

/// Facets of all buildings with so many cells along an edge of the roof.
fn all_buildings(cells: u32) -> usize {
    (0..ROW * ROW).map(|index| building(index, cells).len()).sum()
}

/// Storeys of a building: 4 to 10, as if at random.
fn height(index: u32) -> f64 {
    let storeys = 4 + (index.wrapping_mul(2_654_435_761) >> 16) % 7;
    f64::from(storeys) * 3.0
}

fn cells_along(length: f64, cells: u32) -> u32 {
    ((length * f64::from(cells) / BUILDING).round() as u32).max(1)
}

fn building(index: u32, cells: u32) -> Vec<Polygon> {
    let place = |i: u32| f64::from(i) * (BUILDING + STREET);
    let low = DVec3::new(place(index % ROW), 0.0, place(index / ROW));
    let (x, y, z) = (DVec3::X * BUILDING, DVec3::Y * height(index), DVec3::Z * BUILDING);
    let storeys = cells_along(height(index), cells);
    let mut facets = vec![];
    for (corner, along, up, rows) in [
        (low + z, x, y, storeys),
        (low + x + z, -z, y, storeys),
        (low + x, -x, y, storeys),
        (low, z, y, storeys),
        (low + y + z, x, -z, cells),
    ] {
        facets.extend(divided(corner, along, up, [cells, rows]));
    }
    facets
}

/// The streets: everything but what the buildings stand on.
fn ground(cells: u32) -> Vec<Polygon> {
    let street = cells_along(STREET, cells);
    let mut lines = vec![-STREET];
    let mut divisions = vec![];
    for _ in 0..ROW {
        for (length, count) in [(STREET, street), (BUILDING, cells)] {
            let last = lines[lines.len() - 1];
            lines.push(last + length);
            divisions.push(count);
        }
    }
    lines.push(lines[lines.len() - 1] + STREET);
    divisions.push(street);
    let mut facets = vec![];
    for i in 0..divisions.len() {
        for j in 0..divisions.len() {
            if i % 2 == 1 && j % 2 == 1 {
                continue;
            }
            let (x, z) = (lines[i + 1] - lines[i], lines[j + 1] - lines[j]);
            let corner = DVec3::new(lines[i], 0.0, lines[j + 1]);
            facets.extend(divided(corner, DVec3::X * x, DVec3::Z * -z, [divisions[i], divisions[j]]));
        }
    }
    facets
}

/// A rectangle as a grid, lit from the side where `along` turns counter-clockwise to `up`.
fn divided(corner: DVec3, along: DVec3, up: DVec3, [columns, rows]: [u32; 2]) -> Vec<Polygon> {
    let at = |i: u32, j: u32| {
        corner + along * (f64::from(i) / f64::from(columns)) + up * (f64::from(j) / f64::from(rows))
    };
    let cells = (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j)));
    cells.map(|(i, j)| vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]).collect()
}
