//! The sky: a box around the scene, whose faces emit inward.
//!
//! Inside a closed surface of the same radiance everywhere, that radiance comes from every direction that is not blocked,
//! whatever the surface's form and size. So a box does for a sphere infinitely far, its form factors are those of polygons, and
//! what stands before it is cut out of it as of any other. Where rays sample it, no polygon is needed. A sky that differs by
//! direction is cut into squares of one radiance each.

use std::f64::consts::PI;

use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::row::Shape;

use super::emitters::{weighted, weighted_by_channel};
use crate::settings::BakeSettings;
use scene::{Scene, SkyCell, SkyPattern};

/// Half the edge of the box, in frame units: the scene ends at 1024 from its middle.
const HALF: f64 = 4096.0;

/// The same of a sky that differs by direction: seen from the ends of the scene a horizon is a twentieth of a degree off.
const FAR_HALF: f64 = 1_048_576.0;

/// Polygons of a sky that differs by direction: at most this divided by the error asked, within the bounds below. An open floor under
/// an overcast sky gets .8 % too little with 256 polygons; the fault falls as their number grows.
const CELLS_TIMES_ERROR: f64 = 12.8;
const MOST_CELLS: f64 = 1024.0;
const LEAST_CELLS: f64 = 128.0;

/// A polygon that gives this part of a sky's light or more, from a square no larger than a [`SUN_CELLS`]th of an edge of the box, is
/// traced by itself: its shadows have edges that must be found exactly.
const SUN_PART: f64 = 1.0 / 64.0;
const SUN_CELLS: usize = 32;

/// Rays of a receiver to an even sky, relative to those of a hemisphere at the error asked. With a quarter, the noise is more than a
/// small error allows.
const RAYS_PART: f64 = 2.0 / 3.0;
const LEAST_RAYS: f64 = 32.0;
const MOST_RAYS: f64 = 4096.0;

/// Each edge of a face is divided into this number of parts: a smaller polygon is more often wholly hidden by one wall, and fewer
/// occluders stand before it.
const DIVISION: u32 = 4;

/// Corners of the box; none where the scene has no sky.
pub fn corners(scene: &Scene) -> impl Iterator<Item = DVec3> {
    let count = if scene.sky == DVec3::ZERO { 0 } else { 8 };
    let half = if scene.sky_pattern.is_some() { FAR_HALF } else { HALF };
    let coordinate = move |corner: u32, axis: u32| if corner >> axis & 1 == 0 { -half } else { half };
    (0..count).map(move |corner| DVec3::from_array([0, 1, 2].map(|axis| coordinate(corner, axis))))
}

/// What the sky shoots from, and the exitance of each. Where `joined`, rays tell what stands between a receiver and all of it.
pub fn shapes(scene: &Scene, settings: &BakeSettings, joined: bool) -> Vec<(Shape, DVec3)> {
    if scene.sky == DVec3::ZERO {
        return vec![];
    }
    let exitance = PI * scene.sky;
    if let Some(pattern) = &scene.sky_pattern {
        return of_pattern(pattern, scene.plane_count, settings.asked_error(), joined)
            .into_iter()
            .map(|(shape, radiance)| (shape, exitance * radiance))
            .collect();
    }
    if joined {
        return vec![(Shape::Sky(rays(settings)), exitance)];
    }
    let squares = || (0..DIVISION).flat_map(|row| (0..DIVISION).map(move |column| (row, column)));
    let polygons = (0..6).flat_map(|face| {
        squares().map(move |(row, column)| square(scene.plane_count, HALF, face, [DIVISION, row, column]))
    });
    polygons.map(|polygon| (Shape::Polygons(vec![polygon]), exitance)).collect()
}

/// Rays of a receiver to an even sky. A power of two has the most even directions.
fn rays(settings: &BakeSettings) -> u32 {
    let wanted = RAYS_PART * f64::from(settings.most_rays());
    wanted.log2().round().exp2().clamp(LEAST_RAYS, MOST_RAYS) as u32
}

/// The cells of a sky that differs by direction, each with its radiance relative to the mean. Joined, they have one row, or one for
/// each channel where they differ in colour, but suns.
fn of_pattern(pattern: &SkyPattern, planes: u32, error: f64, joined: bool) -> Vec<(Shape, DVec3)> {
    let most = (CELLS_TIMES_ERROR / error).clamp(LEAST_CELLS, MOST_CELLS);
    // Half: the rest of what was asked is for the mesh.
    let mut cells = pattern.cells(most as usize, error / 2.0);
    cells.retain(|cell| cell.radiance != DVec3::ZERO);
    let polygon = |cell: &SkyCell| {
        let place = [cell.along_edge, cell.row, cell.column].map(|count| count as u32);
        square(planes, FAR_HALF, cell.face, place)
    };
    let alone = |cell: &SkyCell| (Shape::Polygons(vec![polygon(cell)]), cell.radiance);
    if !joined {
        return cells.iter().map(alone).collect();
    }
    let (suns, others): (Vec<_>, Vec<_>) =
        cells.into_iter().partition(|cell| cell.part >= SUN_PART && cell.along_edge >= SUN_CELLS);
    let mut shapes: Vec<_> = suns.iter().map(alone).collect();
    let others = others.iter().map(|cell| (polygon(cell), cell.radiance));
    if pattern.has_one_colour() {
        // Relative radiance is that of any channel.
        shapes.extend(weighted(others).map(|(shape, most)| (shape, DVec3::splat(most))));
    } else {
        shapes.extend(weighted_by_channel(others));
    }
    shapes
}

/// A square of a face of a box of this size, lit inside. The face is a grid with `along_edge` squares to an edge, and the square is
/// the one in this row and column. Faces are -X, +X, -Y, +Y, -Z, +Z, each in a plane of its own, beyond the `planes` of the scene.
fn square(planes: u32, half: f64, face: usize, [along_edge, row, column]: [u32; 3]) -> ConvexPolygon {
    let (axis, far) = (face / 2, face % 2 == 1);
    let edge = 2.0 * half / f64::from(along_edge);
    // Counter-clockwise seen along the axis, from the far side; seen from within that is the near face.
    let around = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(across, along)| {
        let mut corner = [if far { half } else { -half }; 3];
        corner[(axis + 1) % 3] = edge * f64::from(row + across) - half;
        corner[(axis + 2) % 3] = edge * f64::from(column + along) - half;
        DVec3::from_array(corner)
    });
    let corners = if far { around.into_iter().rev().collect() } else { around.to_vec() };
    ConvexPolygon { plane: PlaneId(planes + face as u32), corners }
}
