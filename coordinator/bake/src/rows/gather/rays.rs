//! How many rays hemispheres have. A power of two has the most even directions.

use crate::settings::BakeSettings;

/// Fewest rays of a receiver, and per hemisphere for light sources.
const LEAST: u32 = 256;

/// Fewest rays of a gather point: interpolation evens out their noise.
const LEAST_OF_POINT: u32 = 64;

/// Rays of a receiver that takes no light from gather points.
pub fn of_receiver(settings: &BakeSettings) -> u32 {
    settings.rays_per_hemisphere.max(LEAST).next_power_of_two()
}

/// Rays per hemisphere for light sources.
pub fn to_sources(settings: &BakeSettings) -> u32 {
    settings.most_rays().max(LEAST).next_power_of_two()
}

/// Rays of a gather point.
pub fn of_point(settings: &BakeSettings) -> u32 {
    settings.rays_per_hemisphere.max(LEAST_OF_POINT).next_power_of_two()
}

/// Rays of each draw at a receiver that the answer is measured at: half of those that the asked error needs. Noise does not matter where
/// there are two draws, and many positions tell more than many rays.
pub fn of_draw(settings: &BakeSettings) -> u32 {
    (settings.rays_per_hemisphere.max(LEAST_OF_POINT) / 2).next_power_of_two()
}
