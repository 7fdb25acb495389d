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
/// that hit the back of a polygon end there and count for none.
///
/// Directions are Owen-scrambled Sobol' points, spread over the disk below the hemisphere: the error of a factor falls
/// faster than with the square root of their number.
#[must_use]
pub fn seen_from(polygons: &SeenPolygons, receiver: &Receiver, rays: u32, seed: u32) -> Seen {
    let (tangent, bitangent) = receiver.normal.any_orthonormal_pair();
    let part = 1.0 / f64::from(rays);
    let mut met: Vec<(usize, f64)> = Vec::with_capacity(rays as usize);
    let mut cast = 0;
    for index in 0..rays {
        let [x, y, ..] = sample_4d(index, 0, seed);
        let (disk_x, disk_y) = on_disk(f64::from(x), f64::from(y));
        let height = (1.0 - disk_x * disk_x - disk_y * disk_y).max(0.0).sqrt();
        let direction = tangent * disk_x + bitangent * disk_y + receiver.normal * height;
        let mut left = 1.0;
        let mut from = 0.0;
        while left > LEAST_LEFT {
            cast += 1;
            let Some(hit) = polygons.nearest(receiver.position, direction, from, receiver.plane) else {
                break;
            };
            let opacity = polygons.opacity(hit.polygon);
            if hit.is_front {
                met.push((hit.polygon, left * opacity * part));
            }
            left *= 1.0 - opacity;
            from = hit.distance;
        }
    }
    met.sort_unstable_by_key(|(polygon, _)| *polygon);
    let factors = met
        .chunk_by(|a, b| a.0 == b.0)
        .map(|same| (same[0].0, same.iter().map(|(_, part)| part).sum::<f64>() as f32))
        .collect();
    Seen { factors, rays: cast }
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
