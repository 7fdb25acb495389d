//! Which surfaces see nothing but surfaces? Asked with rays, which share nothing with the form factors.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use kernel::geometry::uniform_point;
use kernel::occluder::Occluder;
use kernel::visibility::pair_seed;
use sobol_burley::sample_4d;

use super::element::Element;

/// Rays of each surface.
const RAYS: u32 = 256;

/// Length of a ray in frame units: out of the scene from everywhere, which is at most 2048 long, wide and high.
const FAR: f64 = 8192.0;

/// True where no ray leaves the scene, of some that leave a surface as diffuse radiation does.
pub fn is_closed(elements: &[&Element], scene: &Occluder, seed: u64, surface: u32) -> bool {
    let area: f64 = elements.iter().map(|element| element.area).sum();
    let seed = pair_seed(seed, u64::from(surface), u64::MAX);
    (0..RAYS).all(|index| {
        let [x, y, choice, _] = sample_4d(index, 0, seed).map(f64::from);
        let [height, angle, ..] = sample_4d(index, 1, seed).map(f64::from);
        let mut left = choice * area;
        let chosen = elements.iter().find(|element| {
            left -= element.area;
            left <= 0.0
        });
        let Some(element) = chosen.or(elements.last()) else { return false };
        let position = uniform_point(element.corners(), x, y);
        // Uniform over the disk under the hemisphere, after Malley.
        let (sine, cosine) = (angle * TAU).sin_cos();
        let local = DVec3::new(cosine * height.sqrt(), sine * height.sqrt(), (1.0 - height).sqrt());
        let direction = DQuat::from_rotation_arc(DVec3::Z, element.normal) * local;
        scene.blocks(position, position + direction * FAR, [element.plane(); 2])
    })
}
