//! Hemisphere rows: the form factors of a receiver to all polygons of a scene, by rays.
//!
//! Exact rows compute visibility pair by pair, which grows slow in finely tessellated scenes. Here rays leave a receiver with the
//! density of the cosine; the part of them that hits a polygon is its visible form factor (Malley's method). One ray serves all
//! polygons at once and costs the logarithm of their number.

mod polygons;
#[cfg(test)]
mod rays;
#[cfg(test)]
mod tests;

use std::f64::consts::TAU;

use glam::DVec3;
use sobol_burley::sample_4d;

pub use polygons::{Hit, SeenPolygons};

use crate::replica::Receiver;

/// A ray that transparent occluders leave less than this fraction of its light is not followed any further.
const LEAST_LEFT: f64 = 1e-3;

/// What a receiver sees.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Seen {
    /// Polygons of which something is seen, by rising index, with their form factors.
    pub factors: Vec<(usize, f32)>,
    /// Rays cast.
    pub rays: u64,
}

/// Visible form factors from a receiver to all polygons, by rays: multiples of 1 / rays where all polygons are opaque. Rays
/// that hit the back of an opaque polygon end there and count for none. A factor has in it what stands before a polygon, but not the
/// polygon's own opacity: that is in its radiosity.
///
/// Directions are Owen-scrambled Sobol' points, spread over the disk below the hemisphere: the error of a factor falls
/// faster than with the square root of their number.
#[must_use]
pub fn seen_from(polygons: &SeenPolygons, receiver: &Receiver, rays: u32, seed: u32) -> Seen {
    let part = 1.0 / f64::from(rays);
    let mut met: Vec<(u32, usize, f64)> = Vec::with_capacity(rays as usize);
    let mut cast = 0;
    for (number, direction) in directions(receiver.normal, rays, seed) {
        let mut left = 1.0;
        let mut from = 0.0;
        while left > LEAST_LEFT {
            cast += 1;
            let Some(hit) = polygons.nearest(receiver.position, direction, from, receiver.plane) else {
                break;
            };
            let opacity = polygons.opacity(hit.polygon);
            if hit.is_front && opacity > 0.0 {
                met.push((number, hit.polygon, left * part));
            }
            left *= 1.0 - opacity;
            from = hit.distance;
        }
    }
    if !polygons.are_opaque() {
        // Parts differ, and so would their sums in the order in which rays are cast.
        met.sort_by_key(|(number, ..)| *number);
    }
    let mut met: Vec<(usize, f64)> = met.into_iter().map(|(_, polygon, part)| (polygon, part)).collect();
    met.sort_unstable_by_key(|(polygon, _)| *polygon);
    let factors = met
        .chunk_by(|a, b| a.0 == b.0)
        .map(|same| (same[0].0, same.iter().map(|(_, part)| part).sum::<f64>() as f32))
        .collect();
    Seen { factors, rays: cast }
}

/// Unit vectors over the hemisphere about a normal, with the density of the cosine, and their numbers in the sequence. Vectors that
/// follow each other are much alike: their rays go through the same parts of the tree, which then are in the caches.
#[must_use]
pub fn directions(normal: DVec3, rays: u32, seed: u32) -> Vec<(u32, DVec3)> {
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let mut points: Vec<(u32, u32, [f32; 2])> = (0..rays)
        .map(|index| {
            let [x, y, ..] = sample_4d(index, 0, seed);
            (along_curve(x, y), index, [x, y])
        })
        .collect();
    points.sort_unstable_by_key(|(place, index, _)| (*place, *index));
    let direction = |(_, index, [x, y]): (u32, u32, [f32; 2])| {
        let (disk_x, disk_y) = on_disk(f64::from(x), f64::from(y));
        let height = (1.0 - disk_x * disk_x - disk_y * disk_y).max(0.0).sqrt();
        (index, tangent * disk_x + bitangent * disk_y + normal * height)
    };
    points.into_iter().map(direction).collect()
}

/// Place of a point of the unit square along the curve through 256 x 256 cells that Morton's order is.
fn along_curve(x: f32, y: f32) -> u32 {
    let spread = |coordinate: f32| {
        let cell = (coordinate * 256.0) as u32;
        let cell = (cell | cell << 4) & 0x0f0f;
        let cell = (cell | cell << 2) & 0x3333;
        (cell | cell << 1) & 0x5555
    };
    spread(x) | spread(y) << 1
}

/// The concentric map of the unit square to the unit disk, which keeps areas and neighbours (Shirley and Chiu, "A low distortion map
/// between disk and square", 1997).
fn on_disk(x: f64, y: f64) -> (f64, f64) {
    let (a, b) = (2.0 * x - 1.0, 2.0 * y - 1.0);
    if a == 0.0 && b == 0.0 {
        return (0.0, 0.0);
    }
    let (radius, angle) =
        if a.abs() > b.abs() { (a, TAU / 8.0 * (b / a)) } else { (b, TAU / 4.0 - TAU / 8.0 * (a / b)) };
    let (sine, cosine) = angle.sin_cos();
    (radius * cosine, radius * sine)
}

/// True where a ray meets the front of a polygon with this normal.
fn faces(normal: DVec3, direction: DVec3) -> bool {
    normal.dot(direction) < 0.0
}
