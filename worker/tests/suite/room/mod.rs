//! A square room with blocks on its floor.

use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::replica::Receiver;

pub fn polygon(plane: u32, corners: [DVec3; 4]) -> ConvexPolygon {
    ConvexPolygon { plane: PlaneId(plane), corners: corners.to_vec() }
}

/// A block that stands on the floor, turned by the angle of this cosine and sine: one convex body with planes from `plane` on.
pub fn block(plane: u32, centre: DVec3, half: DVec3, [cos, sin]: [f64; 2]) -> Vec<ConvexPolygon> {
    let (u, v) = (DVec3::new(cos, 0.0, sin) * half.x, DVec3::new(-sin, 0.0, cos) * half.z);
    let up = DVec3::Y * 2.0 * half.y;
    let [a, b, c, d] = [-u - v, u - v, u + v, v - u].map(|corner| centre + corner);
    let sides = [[a, d], [d, c], [c, b], [b, a]].map(|[left, right]| [left, right, right + up, left + up]);
    let all = sides.into_iter().chain([[d + up, c + up, b + up, a + up], [a, b, c, d]]);
    (plane..).zip(all).map(|(plane, corners)| polygon(plane, corners)).collect()
}

/// A lattice of `along` x `along` receivers on each of four walls and the floor, which have the planes 0 to 4.
pub fn wall_receivers(side: f64, along: usize) -> impl Iterator<Item = Receiver> {
    let step = move |index: usize| (index as f64 + 0.5) / along as f64 * side;
    let walls = [
        (DVec3::ZERO, DVec3::X, DVec3::Z, DVec3::Y),
        (DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z),
        (DVec3::Z * side, DVec3::X, DVec3::Y, DVec3::NEG_Z),
        (DVec3::ZERO, DVec3::Z, DVec3::Y, DVec3::X),
        (DVec3::X * side, DVec3::Z, DVec3::Y, DVec3::NEG_X),
    ];
    (0..).zip(walls).flat_map(move |(plane, (corner, u, v, normal))| {
        (0..along * along).map(move |index| Receiver {
            position: corner + u * step(index % along) + v * step(index / along),
            normal,
            plane: PlaneId(plane),
        })
    })
}
