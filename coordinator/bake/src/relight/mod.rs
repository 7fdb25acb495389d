//! A finished bake lit otherwise: other brightness or colour of its lights, on its mesh, in a small part of its time.
//!
//! | module | what lives there |
//! |---|---|
//! | `kept` | what a bake leaves behind: its light, light by light |
//! | `keep` | solving for it |
//! | `file` | the same as a file |
//! | `change` | which light changes how |
//! | `relit_scene` | the scene with its lights changed, for the output |
//!
//! Light is linear: a surface reflects each channel of a light by itself, and what two lights give is the sum of what each gives.
//! On a given mesh and with given rows the irradiance is therefore the sum over the lights of the irradiance of each alone, channel
//! by channel multiplied by its factor. So a bake leaves behind no rows, which take gigabytes, but the solution for each light at
//! the vertices: 24 bytes for each vertex and light. To relight is to add them up, to fit and to triangulate anew, as the bake
//! itself did with its sum.
//!
//! The mesh stays that of the finished bake, refined for its light. What this does to the error is measured: the light of each
//! source at the validation samples is kept too, and the new sum is held to the new light there.

mod change;
mod file;
mod keep;
mod kept;
mod relit_scene;
#[cfg(test)]
mod tests;

use glam::DVec3;
use kernel::replica::Digest;
use serde::Serialize;

pub use change::{LightChange, NewLight};
pub use keep::keep_light;
pub use kept::KeptLight;

use crate::error_budget::{ErrorBudget, INTERPOLATED_NOISE, RETURNING};
use crate::lit::{LitLayer, LitMesh};
use crate::preview::lit_mesh;
use crate::refinement::best_fit_of_part;
use kept::KeptPart;
use scene::Scene;

/// Why a scene cannot be lit otherwise.
#[derive(Debug, thiserror::Error)]
pub enum RelightError {
    /// The file is something else, or damaged.
    #[error("kept light is of no use: {0}; bake the scene again to keep its light")]
    Damaged(String),
    /// Another release has another mesh.
    #[error("light was kept by release {theirs}, this is {ours}: use that release, or bake the scene again")]
    Version {
        /// Release that wrote it.
        theirs: String,
        /// This release.
        ours: String,
    },
    /// It was kept of something else.
    #[error("the light was not kept of this scene: give the same file and the same options as in the bake")]
    OtherScene,
    /// A light that the scene does not have.
    #[error("the scene has no light {light}; its lights are: {known}")]
    UnknownLight {
        /// The name that is no light's.
        light: String,
        /// Those that are.
        known: String,
    },
    /// A sky where there was none: nothing is known of its light.
    #[error("the scene was baked without a sky: bake it with one to change it")]
    NoSky,
    /// Negative light, or worse.
    #[error("light {0} must be multiplied by finite numbers that are not negative")]
    Factor(String),
    /// The arithmetic went wrong.
    #[error("the light is not finite")]
    NotFinite,
}

/// A scene lit otherwise.
pub struct Relit {
    /// The scene with its lights changed: what the output shows of them.
    pub scene: Scene,
    /// The lit mesh.
    pub lit: LitMesh,
    /// The figures.
    pub report: RelightReport,
}

/// The figures of a scene lit otherwise.
#[derive(Debug, Clone, Serialize)]
pub struct RelightReport {
    /// Vertices of the mesh: that of the finished bake.
    pub vertices: usize,
    /// Lights that can be changed by themselves.
    pub lights: usize,
    /// Estimated relative L2 error of the radiosity, by where it comes from. `receivers` is measured with the new light. `visibility`
    /// is a bound: the noise of all lights as if it went the same way. `shooters` and `form_factors` are those of the finished bake,
    /// which hold as far as the light comes from places like those before.
    pub error: ErrorBudget,
    /// The same of the finished bake.
    pub error_as_baked: ErrorBudget,
    /// What the user should know about the result.
    pub warnings: Vec<String>,
}

/// Lights the scene of a finished bake otherwise. `scene` is that of the bake, with its lights as they were.
///
/// # Errors
/// When the light was kept of another scene, or a change makes no sense.
#[tracing::instrument(skip_all)]
pub fn relight(scene: &Scene, kept: &KeptLight, light: &NewLight) -> Result<Relit, RelightError> {
    if digest_of(scene) != kept.scene {
        return Err(RelightError::OtherScene);
    }
    let factors = light.factors(kept)?;
    let mesh = kept.mesh(scene)?;
    let all = |_: &KeptPart| true;
    let irradiance = kept.sum(&factors, all, |part| &part.irradiance);
    let direct = kept.sum(&factors, all, |part| &part.direct);
    if !irradiance.iter().all(|irradiance| irradiance.is_finite()) {
        return Err(RelightError::NotFinite);
    }
    let (lit, fitted) = lit_mesh(scene, &mesh, light.only, &irradiance, &direct);
    let layers = light.groups.iter().map(|group| {
        let is_meant = |part: &KeptPart| part.names.iter().any(|name| group.lights.contains(name));
        let [all, direct] = [
            kept.sum(&factors, is_meant, |part| &part.irradiance),
            kept.sum(&factors, is_meant, |part| &part.direct),
        ];
        let part = light.only.of_all(&all, &direct);
        LitLayer {
            name: group.name.clone(),
            lights: group.lights.clone(),
            irradiance: best_fit_of_part(&mesh, &irradiance, &part),
        }
    });
    let lit = LitMesh { layers: layers.collect(), ..lit };
    let error = error(kept, &factors, &mesh, &fitted);
    let (scene, warnings) = relit_scene::changed(scene, light);
    let report = RelightReport {
        vertices: mesh.vertices.len(),
        lights: kept.parts.len(),
        error,
        error_as_baked: kept.error,
        warnings,
    };
    Ok(Relit { scene, lit, report })
}

/// The error of the new light on the kept mesh.
fn error(kept: &KeptLight, factors: &[DVec3], mesh: &crate::mesh::Mesh, fitted: &[DVec3]) -> ErrorBudget {
    let as_baked = &kept.error;
    let baked_factors: Vec<DVec3> = kept.parts.iter().map(|part| part.as_baked).collect();
    let [before, now] = [&baked_factors, factors].map(|factors| kept.checks_lit_by(factors));
    // The noise of each part is known relative to the whole light of the finished bake.
    let part_of = |(part, factor): (&KeptPart, &DVec3)| factor.max_element() * part.noise;
    let sum: f64 = kept.parts.iter().zip(factors).map(part_of).sum();
    let noise = if now.level() > 0.0 { sum * before.level() / now.level() } else { 0.0 };
    let receivers = if now.count() > 0 {
        now.interpolation_error(mesh, fitted, kept.reflectance, noise)
    } else {
        as_baked.receivers
    };
    let residual = kept.parts.iter().map(|part| part.residual).fold(0.0, f64::max);
    let unshot = residual / (1.0 - RETURNING * kept.reflectance);
    let visibility = noise * INTERPOLATED_NOISE.sqrt();
    ErrorBudget::new(unshot, visibility, as_baked.form_factors, receivers, as_baked.shooters)
}

/// All that the light of a scene depends on, and the file that the output is made from, as a digest.
pub(super) fn digest_of(scene: &Scene) -> Digest {
    let mut hasher = blake3::Hasher::new();
    let mut numbers = |numbers: &[f64]| {
        numbers.iter().for_each(|number| {
            hasher.update(&number.to_bits().to_le_bytes());
        });
    };
    numbers(&scene.frame.centre.to_array());
    numbers(&[scene.frame.scale, f64::from(scene.plane_count), scene.lights.len() as f64]);
    numbers(&scene.sky.to_array());
    for light in &scene.lights {
        numbers(&light.intensity.to_array());
        numbers(&light.kind.position().unwrap_or_default().to_array());
    }
    for surface in &scene.surfaces {
        numbers(&[surface.node as f64, surface.primitive as f64, surface.opacity]);
        numbers(&surface.reflectance.to_array());
        numbers(&surface.exitance.to_array());
        for corner in surface.facets.iter().flat_map(|facet| &facet.corners) {
            numbers(&corner.position.to_array());
            numbers(&corner.normal.to_array());
        }
    }
    // What cannot be written as JSON could not be written to the output either.
    hasher.update(&serde_json::to_vec(&scene.source.root).unwrap_or_default());
    scene.source.buffers.iter().for_each(|buffer| {
        hasher.update(buffer);
    });
    Digest(*hasher.finalize().as_bytes())
}
