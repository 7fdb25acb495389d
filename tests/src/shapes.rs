//! Polygons to build scenes from: counter-clockwise seen from the lit side.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// A polygon's corners.
pub type Polygon = Vec<DVec3>;

/// The same polygons, lit from the other side.
#[must_use]
pub fn turned(polygons: &[Polygon]) -> Vec<Polygon> {
    polygons.iter().map(|polygon| polygon.iter().rev().copied().collect()).collect()
}

/// The six faces of a box, lit outside: -x, +x, -y, +y, -z, +z.
#[must_use]
pub fn box_facing_out(low: DVec3, high: DVec3) -> Vec<Polygon> {
    let corner = |x: bool, y: bool, z: bool| {
        DVec3::new(
            if x { high.x } else { low.x },
            if y { high.y } else { low.y },
            if z { high.z } else { low.z },
        )
    };
    let mut faces = vec![];
    for axis in 0..3 {
        for far in [false, true] {
            // Around the face, seen from outside when `far`.
            let around = [(false, false), (true, false), (true, true), (false, true)];
            let face = around.map(|(a, b)| {
                let mut picks = [far; 3];
                picks[(axis + 1) % 3] = a;
                picks[(axis + 2) % 3] = b;
                corner(picks[0], picks[1], picks[2])
            });
            faces.push(if far { face.to_vec() } else { face.into_iter().rev().collect() });
        }
    }
    faces
}

/// The six faces of a room, lit inside: -x, +x, -y, +y, -z, +z.
#[must_use]
pub fn box_facing_in(low: DVec3, high: DVec3) -> Vec<Polygon> {
    turned(&box_facing_out(low, high))
}

/// The unit cube as a room.
#[must_use]
pub fn unit_room() -> Vec<Polygon> {
    box_facing_in(DVec3::ZERO, DVec3::ONE)
}

/// The regular tetrahedron in the corners of the cube from -1 to 1, lit inside.
#[must_use]
pub fn tetrahedron_facing_in() -> Vec<Polygon> {
    let [a, b, c, d] =
        [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]].map(DVec3::from_array);
    [[a, b, c], [a, c, d], [a, d, b], [b, d, c]]
        .map(|face| {
            let outward = (face[1] - face[0]).cross(face[2] - face[0]).dot(face[0]) > 0.0;
            if outward { face.into_iter().rev().collect() } else { face.to_vec() }
        })
        .to_vec()
}

/// A prism over a floor in the plane z = 0, lit inside. The floor is given counter-clockwise seen from above, where it is lit.
#[must_use]
pub fn prism_facing_in(floor: &[DVec3], height: f64) -> Vec<Polygon> {
    let up = DVec3::Z * height;
    let mut faces = vec![floor.to_vec(), floor.iter().rev().map(|corner| *corner + up).collect()];
    // The order of reversal keeps the first corner of the floor first on the ceiling too.
    faces[1].rotate_right(1);
    for (i, &from) in floor.iter().enumerate() {
        let to = floor[(i + 1) % floor.len()];
        faces.push(vec![to, from, from + up, to + up]);
    }
    faces
}

/// The concave L of case A11 as a floor; its first corner sees all of it.
#[must_use]
pub fn l_shape() -> Polygon {
    [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]]
        .map(|[x, y]| DVec3::new(x, y, 0.0))
        .to_vec()
}

/// A square of `cells` x `cells` quads in the plane z = 0, from -1 to 1, each as two triangles; lit from above.
#[must_use]
pub fn triangle_grid(cells: u32) -> Vec<Polygon> {
    let at = |i: u32, j: u32| {
        let place = |k: u32| -1.0 + 2.0 * f64::from(k) / f64::from(cells);
        DVec3::new(place(i), place(j), 0.0)
    };
    let quads = (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j)));
    quads
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [vec![a, b, c], vec![a, c, d]]
        })
        .collect()
}

/// A sphere of radius 1 from an icosahedron whose faces are divided in four, `levels` times; lit outside.
#[must_use]
pub fn icosphere(levels: u32) -> Vec<[DVec3; 3]> {
    let golden = f64::midpoint(1.0, 5.0_f64.sqrt());
    let mut corners = vec![];
    for (a, b) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
        corners.extend([DVec3::new(0.0, a, b), DVec3::new(a, b, 0.0), DVec3::new(b, 0.0, a)]);
    }
    // Neighbours are 2 apart, all others farther.
    let near = |i: usize, j: usize| corners[i].distance_squared(corners[j]) < 4.5;
    let mut faces = vec![];
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                if near(i, j) && near(j, k) && near(i, k) {
                    let outward =
                        (corners[j] - corners[i]).cross(corners[k] - corners[i]).dot(corners[i]) > 0.0;
                    faces.push(if outward { [i, j, k] } else { [i, k, j] });
                }
            }
        }
    }
    let mut points: Vec<DVec3> = corners.iter().map(|corner| corner.normalize()).collect();
    for _ in 0..levels {
        let mut middles = HashMap::new();
        let mut middle = |a: usize, b: usize| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a] + points[b]).normalize());
                points.len() - 1
            })
        };
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    faces.into_iter().map(|face| face.map(|corner| points[corner])).collect()
}

/// A sphere of radius 1, lit inside, whose corners lie on circles of latitude, `rings` of facets around the z axis from pole
/// to pole with so many `sectors` each: flat trapezoids, and triangles at the poles.
#[must_use]
pub fn globe_facing_in(rings: u32, sectors: u32) -> Vec<Polygon> {
    let at = |ring: u32, sector: u32| {
        let (radius, z) = (PI * f64::from(ring) / f64::from(rings)).sin_cos();
        let (y, x) = (TAU * f64::from(sector % sectors) / f64::from(sectors)).sin_cos();
        DVec3::new(radius * x, radius * y, z)
    };
    let facet = |(ring, sector): (u32, u32)| match ring {
        0 => vec![DVec3::Z, at(1, sector + 1), at(1, sector)],
        _ if ring + 1 == rings => vec![-DVec3::Z, at(ring, sector), at(ring, sector + 1)],
        _ => vec![at(ring, sector), at(ring, sector + 1), at(ring + 1, sector + 1), at(ring + 1, sector)],
    };
    (0..rings).flat_map(|ring| (0..sectors).map(move |sector| (ring, sector))).map(facet).collect()
}
