//! Channels of light: one where the scene has one colour, else three.

use glam::DVec3;
use kernel::row::Row;

use crate::solver::slab::Slab;
use crate::solver::{Light, add_group, add_row};
use scene::Scene;

/// Colours closer than this, as unit vectors, are equal: f32 numbers are a few times 1e-7 apart.
const ONE_COLOUR: f64 = 1e-6;

/// How many channels of light a scene needs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Channels {
    /// All light has this colour, and every surface reflects all of it alike.
    One(DVec3),
    /// Linear RGB.
    Three,
}

impl Channels {
    /// The channels that a scene needs.
    pub fn needed(scene: &Scene) -> Self {
        let is_grey = |rgb: DVec3| rgb == DVec3::splat(rgb.x);
        let exitances = scene.surfaces.iter().map(|surface| surface.exitance);
        let intensities = scene.lights.iter().map(|light| light.intensity);
        let mut lights =
            exitances.chain(intensities).chain([scene.sky]).filter(|light| *light != DVec3::ZERO);
        let colour = lights.next().unwrap_or(DVec3::ONE).normalize();
        let is_same = |light: DVec3| (light.normalize() - colour).length() <= ONE_COLOUR;
        let varies = || scene.surfaces.iter().filter_map(|surface| surface.appearance.as_ref());
        let is_grey_scene = scene.surfaces.iter().all(|surface| is_grey(surface.reflectance))
            && varies().all(|appearance| appearance.reflects_grey() && appearance.emits_one_colour());
        let is_grey_sky = scene.sky_pattern.as_ref().is_none_or(|pattern| pattern.has_one_colour());
        if is_grey_scene && is_grey_sky && lights.all(is_same) { Self::One(colour) } else { Self::Three }
    }

    /// Number of channels.
    pub fn count(self) -> usize {
        match self {
            Self::One(_) => f64::CHANNELS,
            Self::Three => DVec3::CHANNELS,
        }
    }

    /// Starts to gather at this number of receivers.
    pub fn gathering(self, receivers: usize) -> Gathering {
        match self {
            Self::One(colour) => Gathering::One(colour, vec![0.0; receivers]),
            Self::Three => Gathering::Three(vec![DVec3::ZERO; receivers]),
        }
    }
}

/// Irradiance of receivers, summed up row by row.
pub enum Gathering {
    /// Of one colour.
    One(DVec3, Vec<f64>),
    /// Linear RGB.
    Three(Vec<DVec3>),
}

impl Gathering {
    /// Adds the light of a row's shooter.
    pub fn add(&mut self, row: &Row, light: DVec3) {
        match self {
            Self::One(colour, sums) => add_row(sums, row, f64::from_rgb(light, *colour)),
            Self::Three(sums) => add_row(sums, row, light),
        }
    }

    /// Adds the light of the shooters of several rows.
    pub fn add_slab(&mut self, slab: &Slab, light: impl Fn(usize) -> DVec3 + Sync) {
        match self {
            Self::One(colour, sums) => slab.add(sums, |row, part, mask, factors| {
                add_group(part, mask, factors, f64::from_rgb(light(row), *colour));
            }),
            Self::Three(sums) => {
                slab.add(sums, |row, part, mask, factors| add_group(part, mask, factors, light(row)))
            }
        }
    }

    /// The irradiances.
    pub fn into_irradiance(self) -> Vec<DVec3> {
        match self {
            Self::One(colour, sums) => sums.into_iter().map(|sum| sum.to_rgb(colour)).collect(),
            Self::Three(sums) => sums,
        }
    }
}
