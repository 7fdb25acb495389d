//! Where light comes from: triangles that emit, and lights that are no surface; chosen by their power.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::places::point_of;
use super::solid::{CLEARANCE, Solid};
use crate::plain::{PlainLight, PlainLightKind};

/// Distance of the place from which light comes from far, in the frame: its extent is 1, so that nothing is beyond.
pub(super) const FAR: f64 = 4.0;

/// The light sources of a scene, in the frame of its solid.
pub(super) struct Lights {
    /// Running sum of power over the emitting triangles, and their index in the solid.
    emitters: Vec<(f64, usize)>,
    /// Chance per area to choose a point, of every triangle of the solid; 0 where it does not emit.
    densities: Vec<f64>,
    /// Running sum of power over the point, spot and area lights, their chance to be chosen, and they themselves in the frame.
    near: Vec<(f64, f64, PlainLight)>,
    /// Where the light of directional lights travels to, and their irradiance.
    far: Vec<(DVec3, DVec3)>,
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
    pub(super) fn new(solid: &Solid, no_surfaces: &[PlainLight]) -> Option<Self> {
        let area = |index: usize| {
            let [a, b, c] = solid.triangles()[index].corners;
            (b - a).cross(c - a).length() / 2.0
        };
        let densities = vec![0.0; solid.triangles().len()];
        let mut lights = Self { emitters: vec![], densities, near: vec![], far: vec![] };
        let mut total = 0.0;
        for (index, triangle) in solid.triangles().iter().enumerate() {
            let exitance = solid.emitted(triangle).element_sum();
            if exitance > 0.0 {
                total += exitance * area(index);
                lights.emitters.push((total, index));
                lights.densities[index] = exitance;
            }
        }
        lights.densities.iter_mut().for_each(|density| *density /= total.max(f64::MIN_POSITIVE));
        let scale = solid.frame.scale;
        let power = |light: &PlainLight| match light.kind {
            PlainLightKind::Directional { .. } => 0.0,
            PlainLightKind::Point { .. } | PlainLightKind::Spot { .. } => light.intensity.element_sum(),
            // What it sends to its front from a distance.
            PlainLightKind::Area { half: [x, y], .. } => {
                light.intensity.element_sum() * x.cross(y).length() * 4.0
            }
        };
        let all: f64 = no_surfaces.iter().map(power).sum();
        let mut sum = 0.0;
        for light in no_surfaces.iter().filter(|light| light.intensity != DVec3::ZERO) {
            let mut placed = *light;
            match &mut placed.kind {
                PlainLightKind::Point { position } | PlainLightKind::Spot { position, .. } => {
                    sum += power(light) / all;
                    *position = solid.frame.place(*position);
                    placed.intensity /= scale * scale;
                    lights.near.push((sum, power(light) / all, placed));
                }
                PlainLightKind::Area { centre, half, .. } => {
                    sum += power(light) / all;
                    *centre = solid.frame.place(*centre);
                    half.iter_mut().for_each(|half| *half /= scale);
                    lights.near.push((sum, power(light) / all, placed));
                }
                PlainLightKind::Directional { along } => lights.far.push((*along, light.intensity)),
            }
        }
        let is_lit = !(lights.emitters.is_empty() && lights.near.is_empty() && lights.far.is_empty());
        is_lit.then_some(lights)
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
        let triangle = &solid.triangles()[index];
        let point = point_of(&triangle.corners, draw[1], draw[2]);
        let side = triangle.side(point - at)?;
        let kernel = kernel(at, normal, point, side);
        let density = self.densities[index];
        (kernel > 0.0 && solid.is_seen(triangle, point, side)).then(|| {
            let material = solid.material(triangle, point);
            let exitance = material.exitance * material.opacity;
            Sample {
                irradiance: exitance * kernel / density * weight(density, kernel),
                from: point + side * CLEARANCE,
            }
        })
    }

    /// The irradiance at a point from a random point, spot or area light.
    pub(super) fn near(&self, at: DVec3, normal: DVec3, draw: [f64; 3]) -> Option<Sample> {
        let chosen =
            self.near.partition_point(|light| light.0 <= draw[0]).min(self.near.len().checked_sub(1)?);
        let (_, chance, light) = &self.near[chosen];
        let (position, part) = match light.kind {
            PlainLightKind::Point { position } => (position, 1.0),
            PlainLightKind::Spot { position, along, ramp: [scale, offset] } => {
                let cosine = (at - position).normalize_or_zero().dot(along);
                (position, (cosine * scale + offset).clamp(0.0, 1.0).powi(2))
            }
            PlainLightKind::Area { centre, half: [x, y], is_round } => {
                let (point, area) = if is_round {
                    let (sine, cosine) = (TAU * draw[2]).sin_cos();
                    (centre + (x * cosine + y * sine) * draw[1].sqrt(), PI * x.cross(y).length())
                } else {
                    (
                        centre + x * (2.0 * draw[1] - 1.0) + y * (2.0 * draw[2] - 1.0),
                        4.0 * x.cross(y).length(),
                    )
                };
                let side = x.cross(y).normalize_or_zero();
                let kernel = kernel(at, normal, point, side);
                return (kernel > 0.0).then(|| Sample {
                    irradiance: light.intensity * (PI * kernel * area / chance),
                    from: point + side * CLEARANCE,
                });
            }
            PlainLightKind::Directional { .. } => return None,
        };
        let span = position - at;
        let cosine = span.normalize_or_zero().dot(normal);
        (cosine > 0.0 && part > 0.0).then(|| Sample {
            irradiance: light.intensity * cosine * part / (span.length_squared() * chance),
            from: position,
        })
    }

    /// The irradiance at a point from each directional light.
    pub(super) fn far(&self, at: DVec3, normal: DVec3) -> impl Iterator<Item = Sample> {
        let sample = move |&(along, irradiance): &(DVec3, DVec3)| {
            let cosine = -along.dot(normal);
            (cosine > 0.0).then(|| Sample { irradiance: irradiance * cosine, from: at - along * FAR })
        };
        self.far.iter().filter_map(sample)
    }
}

/// Radiosity at `to` x kernel x area is irradiance at `from`: cos cos' / (pi r^2). It is also the chance per area at which a
/// direction drawn by the cosine meets `to`.
pub(super) fn kernel(from: DVec3, normal: DVec3, to: DVec3, side: DVec3) -> f64 {
    let span = to - from;
    let squared = span.length_squared();
    let (cosine, other) = (normal.dot(span), -side.dot(span));
    if cosine > 0.0 && other > 0.0 { cosine * other / (PI * squared * squared) } else { 0.0 }
}

/// The balance heuristic: how much a way of sampling counts that chose a point with this density, where another could have
/// chosen it with the other density.
pub(super) fn weight(density: f64, other: f64) -> f64 {
    density / (density + other)
}
