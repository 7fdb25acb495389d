//! Hemisphere rows: the form factors of a receiver to all polygons of a scene, by rays.
//!
//! Exact rows compute visibility pair by pair, which grows slow in finely tessellated scenes. Here rays leave a receiver with the
//! density of the cosine; the part of them that hits a polygon is its visible form factor (Malley's method). One ray serves all
//! polygons at once and costs the logarithm of their number.

mod directions;
mod polygons;
#[cfg(test)]
mod rays;
#[cfg(test)]
mod tests;

use glam::DVec3;

pub use directions::directions;
pub use polygons::{Hit, SeenPolygons};

use crate::replica::Receiver;

/// A ray that transparent occluders leave less than this fraction of its light is not followed any further.
const LEAST_LEFT: f64 = 1e-3;

/// Index of the sky among polygons: after all of them.
const SKY: usize = usize::MAX;

/// What a receiver sees.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Seen {
    /// Polygons of which something is seen, by rising index, with their form factors.
    pub factors: Vec<(usize, f32)>,
    /// Sky view factor: the part of the hemisphere in which there is nothing.
    pub sky: f32,
    /// Rays cast.
    pub rays: u64,
}

/// Visible form factors from a receiver to all polygons, by rays: multiples of 1 / rays where all polygons are opaque. Rays
/// that hit the back of an opaque polygon end there and count for none. A factor has in it what stands before a polygon, but not the
/// polygon's own opacity: that is in its radiosity.
///
/// [`directions`] are spread so evenly that the error of a factor falls faster than with the square root of their number.
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
                met.push((number, SKY, left * part));
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
    let mut factors: Vec<(usize, f32)> = met
        .chunk_by(|a, b| a.0 == b.0)
        .map(|same| (same[0].0, same.iter().map(|(_, part)| part).sum::<f64>() as f32))
        .collect();
    let sky = factors.pop_if(|(index, _)| *index == SKY).map_or(0.0, |(_, part)| part);
    Seen { factors, sky, rays: cast }
}

/// True where a ray meets the front of a polygon with this normal.
fn faces(normal: DVec3, direction: DVec3) -> bool {
    normal.dot(direction) < 0.0
}
