//! Path-traced references: the radiosity at points of a scene's surfaces, with standard errors; and the radiance along rays.
//!
//! Bakes are measured against these references, which share no import, mesh, form factor or visibility with the solver.
//!
//! | module | job |
//! |---|---|
//! | `file` | references as CSV |
//! | `places` | the points: random ones, or those of another reference |
//! | `solid` | the triangles behind a bounding volume hierarchy: what does a ray meet first? |
//! | `lights` | where light comes from, and how to choose a point of it |
//! | `sky` | a sky that differs by direction |
//! | `paths` | the estimator |
//! | `hash` | seeds of random draws |
//! | `agreement` | one reference against another |

mod agreement;
mod file;
mod hash;
mod lights;
mod paths;
mod places;
mod sky;
mod solid;
#[cfg(test)]
mod tests;

use std::path::PathBuf;

use glam::DVec3;
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;

pub use self::agreement::Agreement;
pub use self::file::{ReferenceFileError, read, to_csv};
pub use self::places::{locate, materials, random};

use self::paths::Tracer;
use crate::plain::PlainScene;

/// Groups of paths at each point, drawn independently of each other. The spread of their means gives the standard error; with
/// fewer its own error would widen the tails (at 32 the chance of three standard errors is 0.5 %, in place of 0.3 %).
pub const GROUPS: u32 = 32;

/// Most paths at a point: each group has a Sobol' sequence, which ends at 65,536.
pub const MOST_PATHS: u32 = GROUPS << 16;

/// A point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Position in the world.
    pub position: DVec3,
    /// Unit normal of the side that counts.
    pub normal: DVec3,
    /// Number of the primitive, in the order in which a walk of the scene's nodes meets those of triangles.
    pub primitive: usize,
}

/// A point of a reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferencePoint {
    /// Where.
    pub place: Place,
    /// Radiosity, emitted and reflected: opacity x (exitance + reflectance x irradiance), W/m^2.
    pub radiosity: DVec3,
    /// Standard error of the radiosity.
    pub standard_error: DVec3,
}

/// A ray into a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where it starts, in the world.
    pub origin: DVec3,
    /// Unit vector along it.
    pub direction: DVec3,
}

/// How a reference is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceSettings {
    /// Paths at each point, in `1..=MOST_PATHS`, rounded up to a multiple of [`GROUPS`]; or for each ray, in `1..=65536`.
    pub paths: u32,
    /// Seed of everything random. The same seed gives the same bits.
    pub seed: u64,
    /// Threads; the result does not depend on them.
    pub threads: usize,
}

impl Default for ReferenceSettings {
    fn default() -> Self {
        Self { paths: 2048, seed: 1, threads: 1 }
    }
}

/// Why there is no reference.
#[derive(Debug, thiserror::Error)]
pub enum ReferenceError {
    /// No surface reflects.
    #[error(
        "the scene has no surface that reflects, so there is nothing to measure: give a material a base colour, and metallicFactor 0"
    )]
    NoReflection,
    /// What reflects lies under other layers.
    #[error(
        "other surfaces in the same plane hide the surfaces that reflect: {places} of {tries} points are seen; move these surfaces apart"
    )]
    Hidden {
        /// Points that are seen.
        places: usize,
        /// Points that were tried.
        tries: usize,
    },
    /// Nothing gives light.
    #[error(
        "the scene has no light: give a material an emissiveFactor, add a light (KHR_lights_punctual, EXT_lights_area, EXT_lights_image_based), or give --sky"
    )]
    NoLight,
    /// The other reference has points that the scene does not have.
    #[error(
        "point {point} of {reference} lies on no side of primitive {primitive} that reflects: use the scene of the reference"
    )]
    OffScene {
        /// The other reference.
        reference: PathBuf,
        /// Number of the point, from 1.
        point: usize,
        /// The primitive that it names.
        primitive: usize,
    },
    /// The machine gives no threads.
    #[error("threads cannot be started: {0}")]
    Threads(rayon::ThreadPoolBuildError),
}

/// Traces the radiosity at these places; `done` is called for each that is finished.
///
/// # Errors
/// When the scene has no light, or threads cannot be started.
pub fn trace(
    scene: &PlainScene,
    places: &[Place],
    settings: &ReferenceSettings,
    done: &(dyn Fn() + Sync),
) -> Result<Vec<ReferencePoint>, ReferenceError> {
    let paths = settings.paths.clamp(1, MOST_PATHS).div_ceil(GROUPS);
    each(scene, places, settings, done, |tracer, index, place| {
        tracer.point(place, index, paths, settings.seed)
    })
}

/// Traces the radiance that comes back along these rays; `done` is called for each that is finished, and `background` is what those that
/// meet nothing see.
///
/// # Errors
/// When the scene has no light, or threads cannot be started.
pub fn trace_rays(
    scene: &PlainScene,
    rays: &[Ray],
    background: DVec3,
    settings: &ReferenceSettings,
    done: &(dyn Fn() + Sync),
) -> Result<Vec<DVec3>, ReferenceError> {
    let paths = settings.paths.clamp(1, MOST_PATHS / GROUPS);
    each(scene, rays, settings, done, |tracer, index, ray| {
        tracer.radiance(ray, background, index, paths, settings.seed)
    })
}

/// What a tracer finds for each item, by its index, on the threads of the settings.
fn each<T: Sync, R: Send>(
    scene: &PlainScene,
    items: &[T],
    settings: &ReferenceSettings,
    done: &(dyn Fn() + Sync),
    find: impl Fn(&Tracer<'_>, u64, &T) -> R + Sync,
) -> Result<Vec<R>, ReferenceError> {
    let tracer = Tracer::new(scene).ok_or(ReferenceError::NoLight)?;
    let pool =
        ThreadPoolBuilder::new().num_threads(settings.threads).build().map_err(ReferenceError::Threads)?;
    let found = |(index, item): (usize, &T)| {
        let found = find(&tracer, index as u64, item);
        done();
        found
    };
    Ok(pool.install(|| items.par_iter().enumerate().map(found).collect()))
}

/// Standard error of all points together, relative to the norm of their radiosity: sqrt(sum s^2 / sum B^2).
#[must_use]
pub fn relative_standard_error<'a>(points: impl IntoIterator<Item = &'a ReferencePoint> + Clone) -> f64 {
    let sum = |of: fn(&ReferencePoint) -> DVec3| {
        points.clone().into_iter().map(|point| of(point).length_squared()).sum::<f64>()
    };
    (sum(|point| point.standard_error) / sum(|point| point.radiosity)).sqrt()
}
