//! Where light comes from: triangles that emit, and point lights; chosen by their power.

use glam::DVec3;

use super::places::point_of;
use super::solid::{CLEARANCE, Solid};
use crate::plain::PlainLight;

/// The light sources of a scene, in the frame of its solid.
pub(super) struct Lights {
    /// Running sum of power over the emitting triangles, and their index in the solid.
    emitters: Vec<(f64, usize)>,
    /// Chance per area to choose a point, of every triangle of the solid; 0 where it does not emit.
    densities: Vec<f64>,
    /// Running sum of power over the point lights, their chance to be chosen, position and intensity in the frame.
    points: Vec<(f64, f64, PlainLight)>,
}

/// Light that could fall on a point from a chosen place, before visibility.
pub(super) struct Sample {
    /// Irradiance over the chance to have been chosen, weighed.
    pub(super) irradiance: DVec3,
    /// Where it comes from, a little off the surface.
    pub(super) from: DVec3,
}

impl Lights {
    /// Collects the light sources; `None` where there are none.
    pub(super) fn new(solid: &Solid, point_lights: &[PlainLight]) -> Option<Self> {
        let area = |index: usize| {
            let [a, b, c] = solid.triangles[index].corners;
            (b - a).cross(c - a).length() / 2.0
        };
        let mut lights =
            Self { emitters: vec![], densities: vec![0.0; solid.triangles.len()], points: vec![] };
        let mut total = 0.0;
        for (index, triangle) in solid.triangles.iter().enumerate() {
            let exitance = triangle.material.exitance.element_sum();
            if exitance > 0.0 {
                total += exitance * area(index);
                lights.emitters.push((total, index));
                lights.densities[index] = exitance;
            }
        }
        lights.densities.iter_mut().for_each(|density| *density /= total.max(f64::MIN_POSITIVE));
        let power = |light: &PlainLight| light.intensity.element_sum();
        let all: f64 = point_lights.iter().map(power).sum();
        let mut sum = 0.0;
        for light in point_lights.iter().filter(|light| power(light) > 0.0) {
            sum += power(light) / all;
            let scale = solid.frame.scale;
            let placed = PlainLight {
                position: solid.frame.place(light.position),
                intensity: light.intensity / (scale * scale),
            };
            lights.points.push((sum, power(light) / all, placed));
        }
        (!lights.emitters.is_empty() || !lights.points.is_empty()).then_some(lights)
    }

    /// Chance per area at which [`Self::surface`] chooses a point of this triangle.
    pub(super) fn density(&self, triangle: usize) -> f64 {
        self.densities[triangle]
    }

    /// The irradiance at a point from a random point of the emitting surfaces, weighed against a direction drawn by the cosine
    /// that meets the same point (see [`weight`]).
    pub(super) fn surface(&self, solid: &Solid, at: DVec3, normal: DVec3, draw: [f64; 3]) -> Option<Sample> {
        let wanted = draw[0] * self.emitters.last()?.0;
        let chosen = self.emitters.partition_point(|emitter| emitter.0 <= wanted);
        let index = self.emitters[chosen.min(self.emitters.len() - 1)].1;
        let triangle = &solid.triangles[index];
        let point = point_of(&triangle.corners, draw[1], draw[2]);
        let side = triangle.side(point - at)?;
        let kernel = kernel(at, normal, point, side);
        let density = self.densities[index];
        (kernel > 0.0).then(|| Sample {
            irradiance: triangle.material.exitance * kernel / density * weight(density, kernel),
            from: point + side * CLEARANCE,
        })
    }

    /// The irradiance at a point from a random point light.
    pub(super) fn point(&self, at: DVec3, normal: DVec3, draw: f64) -> Option<Sample> {
        let chosen =
            self.points.partition_point(|light| light.0 <= draw).min(self.points.len().checked_sub(1)?);
        let (_, chance, light) = &self.points[chosen];
        let span = light.position - at;
        let cosine = span.normalize_or_zero().dot(normal);
        (cosine > 0.0).then(|| Sample {
            irradiance: light.intensity * cosine / (span.length_squared() * chance),
            from: light.position,
        })
    }
}

/// Radiosity at `to` x kernel x area is irradiance at `from`: cos cos' / (pi r^2). It is also the chance per area at which a
/// direction drawn by the cosine meets `to`.
pub(super) fn kernel(from: DVec3, normal: DVec3, to: DVec3, side: DVec3) -> f64 {
    let span = to - from;
    let squared = span.length_squared();
    let (cosine, other) = (normal.dot(span), -side.dot(span));
    if cosine > 0.0 && other > 0.0 {
        cosine * other / (std::f64::consts::PI * squared * squared)
    } else {
        0.0
    }
}

/// The balance heuristic: how much a way of sampling counts that chose a point with this density, where another could have
/// chosen it with the other density.
pub(super) fn weight(density: f64, other: f64) -> f64 {
    density / (density + other)
}
