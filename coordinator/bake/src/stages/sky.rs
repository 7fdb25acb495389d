//! The sky: a box around the scene, whose faces emit inward.
//!
//! Inside a closed surface of the same radiance everywhere, that radiance comes from every direction that is not blocked, whatever
//! the surface's form and size. So a box does for a sphere infinitely far, its form factors are those of polygons, and what stands
//! before it is cut out of it as of any other.

use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId};

use scene::Scene;

/// Half the edge of the box, in frame units: the scene ends at 1024 from its middle.
const HALF: f64 = 4096.0;

/// Each face is divided into so many rows of so many squares: a smaller polygon is more often wholly hidden by one wall, and fewer
/// occluders stand before it.
const DIVISION: u32 = 4;

/// Corners of the box; none where the scene has no sky.
pub fn corners(scene: &Scene) -> impl Iterator<Item = DVec3> {
    let count = if scene.sky == DVec3::ZERO { 0 } else { 8 };
    let coordinate = |corner: u32, axis: u32| if corner >> axis & 1 == 0 { -HALF } else { HALF };
    (0..count).map(move |corner| DVec3::from_array([0, 1, 2].map(|axis| coordinate(corner, axis))))
}

/// The polygons of the sky, lit inside, in planes of their own.
pub fn polygons(scene: &Scene) -> Vec<ConvexPolygon> {
    if scene.sky == DVec3::ZERO {
        return vec![];
    }
    let edge = 2.0 * HALF / f64::from(DIVISION);
    let squares = || (0..DIVISION).flat_map(|row| (0..DIVISION).map(move |column| (row, column)));
    let faces = (0..3).flat_map(|axis| [false, true].map(|far| (axis, far)));
    faces
        .enumerate()
        .flat_map(|(face, (axis, far))| {
            squares().map(move |(row, column)| {
                // Counter-clockwise seen along the axis, from the far side; seen from within that is the near face.
                let around = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(across, along)| {
                    let mut corner = [if far { HALF } else { -HALF }; 3];
                    corner[(axis + 1) % 3] = edge * f64::from(row + across) - HALF;
                    corner[(axis + 2) % 3] = edge * f64::from(column + along) - HALF;
                    DVec3::from_array(corner)
                });
                let corners = if far { around.into_iter().rev().collect() } else { around.to_vec() };
                ConvexPolygon { plane: PlaneId(scene.plane_count + face as u32), corners }
            })
        })
        .collect()
}
