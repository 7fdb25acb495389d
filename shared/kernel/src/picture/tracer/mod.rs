//! Pictures of lit scenes, pixel by pixel: pure, the same bits for the same request on every machine.
//!
//! | module | what lives there |
//! |---|---|
//! | `tree` | the nearest surface along a ray |
//! | `surface` | what is seen of it: radiance and opacity |
//! | `texture` | images, looked up at a point |
//!
//! A pixel is the mean of the radiance along its rays. Along a ray surfaces are laid over each other from the nearest to the
//! farthest, each by its opacity, until nothing behind can be seen.

mod surface;
#[cfg(test)]
mod tests;
mod texture;
mod tree;

use crate::picture::{Image, Part, PictureScene, Pixels, Ray, TileRequest};
use glam::DVec3;

use tree::{Passed, Tree};

/// Surfaces behind this part of the light are not looked for: less than a step of eight bits, of anything that is not a lamp.
const LEAST_TRANSMITTANCE: f64 = 1e-4;

/// Surfaces that a ray passes at most. Of two hundred that let through nine tenths, nothing is left to see.
const MOST_LAYERS: usize = 256;

/// A picture replica made ready.
pub struct Picture {
    parts: Vec<Part>,
    images: Vec<Image>,
    tree: Tree,
}

impl Picture {
    /// Builds the BVH. The same scene gives the same bits everywhere.
    #[must_use]
    pub fn new(scene: PictureScene) -> Self {
        let tree = Tree::new(&scene);
        let PictureScene { parts, images, .. } = scene;
        Self { parts, images, tree }
    }

    /// The part and the triangle in it that a ray meets first, holes left out.
    #[must_use]
    pub fn first_surface(&self, ray: &Ray) -> Option<(usize, usize)> {
        let ray = self.tree.enter(ray)?;
        let hit = self.tree.nearest(&ray, Passed::NOTHING, |hit| self.is_hole(hit))?;
        Some((hit.part as usize, hit.triangle as usize))
    }

    /// Radiance along a ray, and the number of times that the scene was searched for it.
    #[must_use]
    pub fn radiance(&self, ray: &Ray, background: DVec3) -> (DVec3, u64) {
        let Some(ray) = self.tree.enter(ray) else { return (background, 1) };
        let (mut radiance, mut transmittance, mut passed) = (DVec3::ZERO, 1.0, Passed::NOTHING);
        for searches in 1..=MOST_LAYERS as u64 {
            let Some(hit) = self.tree.nearest(&ray, passed, |hit| self.is_hole(hit)) else {
                return (radiance + transmittance * background, searches);
            };
            let seen = self.surface(&hit);
            radiance += transmittance * seen.opacity * seen.radiance;
            transmittance *= 1.0 - seen.opacity;
            if transmittance < LEAST_TRANSMITTANCE {
                return (radiance, searches);
            }
            passed = Passed::hit(&hit);
        }
        (radiance, MOST_LAYERS as u64)
    }

    /// Computes the pixels of a tile, on the calling thread, and the number of rays that it took.
    #[must_use]
    pub fn tile(&self, request: &TileRequest) -> (Pixels, u64) {
        let TileRequest { corner: [left, top], extent: [columns, rows], .. } = *request;
        let mut rays = 0;
        let mut pixels = Vec::with_capacity(request.pixels());
        for y in top..top + rows {
            for x in left..left + columns {
                let (radiance, cast) = self.pixel(request, [x, y]);
                rays += cast;
                // What f32 cannot hold is as bright as can be.
                pixels.push(radiance.min(DVec3::splat(f32::MAX.into())).as_vec3().to_array());
            }
        }
        (pixels, rays)
    }

    fn pixel(&self, request: &TileRequest, [x, y]: [u32; 2]) -> (DVec3, u64) {
        let [width, height] = request.size.map(f64::from);
        let seed = y.wrapping_mul(0x9e37_79b9) ^ x;
        let (mut sum, mut rays) = (DVec3::ZERO, 0);
        for sample in 0..request.samples {
            let [right, down] = match request.samples {
                1 => [0.5; 2],
                _ => [0, 1].map(|axis| f64::from(sobol_burley::sample(sample, axis, seed))),
            };
            let ray = request.camera.ray((f64::from(x) + right) / width, (f64::from(y) + down) / height);
            let (radiance, cast) = self.radiance(&ray, request.background);
            sum += radiance;
            rays += cast;
        }
        (sum / f64::from(request.samples), rays)
    }
}
