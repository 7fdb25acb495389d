//! The estimator: paths from a point, light gathered along them.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use sobol_burley::{NUM_DIMENSION_SETS_4D, sample_4d};

use super::hash::mix;
use super::lights::{FAR, Lights, kernel, weight};
use super::sky::Sky;
use super::solid::{CLEARANCE, Solid};
use super::{GROUPS, Place, Ray, ReferencePoint};
use crate::plain::PlainScene;

/// Bounces after which chance may end a path.
const CERTAIN_BOUNCES: u32 = 3;

/// Sets of four Sobol' dimensions that a bounce takes.
const SETS_PER_BOUNCE: u32 = 2;

/// Bounces after which dimensions are used again, scrambled anew.
const BOUNCES_PER_SEED: u32 = NUM_DIMENSION_SETS_4D / SETS_PER_BOUNCE;

/// A scene ready to be traced.
pub(super) struct Tracer<'a> {
    scene: &'a PlainScene,
    solid: Solid<'a>,
    /// None under a sky alone.
    lights: Option<Lights>,
    /// None under a sky that is the same everywhere.
    sky: Option<Sky<'a>>,
}

/// A path: which of its group, and the seed of the group.
#[derive(Clone, Copy)]
struct Path {
    index: u32,
    seed: u64,
}

impl Path {
    /// Eight uniform numbers of a bounce.
    fn draw(self, bounce: u32) -> [f64; 8] {
        let seed = mix(self.seed, u64::from(bounce / BOUNCES_PER_SEED)) as u32;
        let set = bounce % BOUNCES_PER_SEED * SETS_PER_BOUNCE;
        let [a, b, c, d] = sample_4d(self.index, set, seed).map(f64::from);
        let [e, f, g, h] = sample_4d(self.index, set + 1, seed).map(f64::from);
        [a, b, c, d, e, f, g, h]
    }
}

impl<'a> Tracer<'a> {
    /// Prepares a scene; `None` where nothing gives light.
    pub(super) fn new(scene: &'a PlainScene) -> Option<Self> {
        let solid = Solid::new(scene);
        let lights = Lights::new(&solid, &scene.lights);
        let sky = scene.sky_image.as_ref().and_then(|image| Sky::new(image, scene.sky));
        let has_sky = if scene.sky_image.is_some() { sky.is_some() } else { scene.sky != DVec3::ZERO };
        (has_sky || lights.is_some()).then_some(Self { scene, solid, lights, sky })
    }

    /// The radiosity at a place, from [`GROUPS`] groups of `paths` paths each; `index` makes its random numbers its own.
    pub(super) fn point(&self, place: &Place, index: u64, paths: u32, seed: u64) -> ReferencePoint {
        let material = super::places::material(self.scene, &self.solid, place);
        let at = self.solid.frame.place(place.position) + place.normal * CLEARANCE;
        let groups = [(); GROUPS as usize].map({
            let mut group = 0;
            move |()| {
                let seed = mix(mix(seed, index), group);
                group += 1;
                let sum: DVec3 = (0..paths)
                    .map(|index| self.gather(at, place.normal, material.reflectance, Path { index, seed }))
                    .sum();
                (material.exitance + sum / f64::from(paths)) * material.opacity
            }
        });
        let count = f64::from(GROUPS);
        let mean = groups.iter().sum::<DVec3>() / count;
        let spread: DVec3 = groups.iter().map(|group| (*group - mean) * (*group - mean)).sum();
        let standard_error = (spread / (count * (count - 1.0))).map(f64::sqrt);
        ReferencePoint { place: *place, radiosity: mean, standard_error }
    }

    /// The radiance that comes back along a ray, the mean of `paths` paths; `index` makes its random numbers its own. Rays pass the
    /// backs of one-sided surfaces, as in viewers.
    pub(super) fn radiance(&self, ray: &Ray, background: DVec3, index: u64, paths: u32, seed: u64) -> DVec3 {
        let seed = mix(seed, index);
        let start = self.solid.frame.place(ray.origin);
        // Boxes are met in f32: a ray from afar starts just before the scene, which lies within 1 of the frame's origin.
        let before = -start.dot(ray.direction) - 1.0;
        let start = start + ray.direction * before.max(0.0);
        let radiance = |index: u32| {
            let chance = mix(seed, u64::from(index));
            let mut from = start;
            let (met, side, material) = loop {
                let Some(hit) = self.solid.first_hit(from, ray.direction, chance) else { return background };
                let triangle = &self.solid.triangles()[hit.triangle];
                let met = from + ray.direction * hit.distance;
                match triangle.side(ray.direction) {
                    Some(side) => break (met, side, self.solid.material(triangle, met)),
                    None => from = met + ray.direction * CLEARANCE,
                }
            };
            let path = Path { index, seed };
            (material.exitance + self.gather(met + side * CLEARANCE, side, material.reflectance, path)) / PI
        };
        (0..paths).map(radiance).sum::<DVec3>() / f64::from(paths)
    }

    /// The estimate of one path of the reflected radiosity of a side, in the frame.
    fn gather(&self, mut at: DVec3, mut normal: DVec3, reflectance: DVec3, path: Path) -> DVec3 {
        let mut gathered = DVec3::ZERO;
        // The part of irradiance at the present surface that becomes radiosity where the path begins.
        let mut share = reflectance;
        for bounce in 0.. {
            if share == DVec3::ZERO {
                break;
            }
            let [u, v, survival, which_near, which_emitter, s, t, chance] = path.draw(bounce);
            let samples = self.lights.iter().flat_map(|lights| {
                let chosen = [
                    lights.near(at, normal, [which_near, s, t]),
                    lights.surface(&self.solid, at, normal, [which_emitter, s, t]),
                ];
                chosen.into_iter().flatten().chain(lights.far(at, normal))
            });
            for sample in samples {
                let passing = self.solid.transmittance(at, sample.from);
                if passing > 0.0 {
                    gathered += share * sample.irradiance * passing;
                }
            }
            if let Some(sky) = &self.sky {
                let towards = sky.direction([which_near, s, t]);
                let cosine = normal.dot(towards);
                if cosine > 0.0 {
                    let passing = self.solid.transmittance(at, at + towards * FAR);
                    // The balance heuristic, over the density.
                    let weighed = passing * cosine / (sky.density(towards) + cosine / PI);
                    gathered += share * sky.radiance(towards) * weighed;
                }
            }
            let direction = by_cosine(normal, u, v);
            let Some(hit) = self.solid.first_hit(at, direction, chance.to_bits()) else {
                gathered += match &self.sky {
                    Some(sky) => {
                        let weight = weight(normal.dot(direction) / PI, sky.density(direction));
                        share * PI * sky.radiance(direction) * weight
                    }
                    None if self.scene.sky_image.is_none() => share * PI * self.scene.sky,
                    None => DVec3::ZERO,
                };
                break;
            };
            let triangle = &self.solid.triangles()[hit.triangle];
            let Some(side) = triangle.side(direction) else { break };
            let met = at + direction * hit.distance;
            let material = self.solid.material(triangle, met);
            let density = self.lights.as_ref().map_or(0.0, |lights| lights.density(hit.triangle));
            if density > 0.0 {
                gathered += share * material.exitance * weight(kernel(at, normal, met, side), density);
            }
            let reflectance = material.reflectance;
            share *= reflectance;
            if bounce >= CERTAIN_BOUNCES {
                let chance = reflectance.max_element();
                if survival >= chance {
                    break;
                }
                share /= chance;
            }
            normal = side;
            at = met + side * CLEARANCE;
        }
        gathered
    }
}

/// A direction of the hemisphere over a normal, as likely as its cosine is large.
fn by_cosine(normal: DVec3, u: f64, v: f64) -> DVec3 {
    let (across, along) = normal.any_orthonormal_pair();
    let (sine, cosine) = (TAU * v).sin_cos();
    (across * cosine + along * sine) * u.sqrt() + normal * (1.0 - u).sqrt()
}
