//! Relights a finished bake: new light intensities and colours, on its mesh, without baking again.
//!
//! | module | what lives there |
//! |---|---|
//! | `kept` | kept light: the light of each source |
//! | `keep` | solves for it |
//! | `file` | kept light as a file |
//! | `change` | new intensities and colours |
//! | `relit_scene` | the scene with its lights changed, for the output |
//!
//! Light is linear: on a given mesh and with given rows irradiance is the sum over the lights of the irradiance of each, times its
//! factor per channel. So a bake keeps no rows, which take gigabytes, but the solution for each light at the vertices: 24 bytes
//! per vertex and light. Relighting sums them, then fits and triangulates as the bake does.
//!
//! The mesh stays that of the finished bake, refined for its light. The effect on the error is measured: the light of each
//! source at the validation samples is kept too, and compared with the new sum there.

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
use crate::output_mesh::output_mesh;
use crate::preview::lit_mesh;
use crate::refinement::{RevealedErrors, best_fit_of_part};
use kept::KeptPart;
use scene::Scene;

/// Why a scene cannot be relit.
#[derive(Debug, thiserror::Error)]
pub enum RelightError {
    /// The file is not kept light, or damaged.
    #[error("kept light cannot be used: {0}; bake the scene again to keep its light")]
    Damaged(String),
    /// Another release has another mesh.
    #[error("light was kept by release {theirs}, this is {ours}: use that release, or bake the scene again")]
    Version {
        /// Release that wrote it.
        theirs: String,
        /// This release.
        ours: String,
    },
    /// It was kept of another scene.
    #[error("the light was not kept of this scene: give the same file and the same options as in the bake")]
    OtherScene,
    /// A light that the scene does not have.
    #[error("the scene has no light {light}; its lights are: {known}")]
    UnknownLight {
        /// The unknown name.
        light: String,
        /// The names that the scene has.
        known: String,
    },
    /// A sky where there was none: its light was not kept.
    #[error("the scene was baked without a sky: bake it with one to change it")]
    NoSky,
    /// A factor that is negative or not finite.
    #[error("light {0} must be multiplied by finite numbers that are not negative")]
    Factor(String),
    /// The arithmetic failed.
    #[error("the light is not finite")]
    NotFinite,
}

/// A relit scene.
pub struct Relit {
    /// The scene with its lights changed, for the output.
    pub scene: Scene,
    /// The lit mesh.
    pub lit: LitMesh,
    /// Its metrics.
    pub report: RelightReport,
}

/// The metrics of a relit scene.
#[derive(Debug, Clone, Serialize)]
pub struct RelightReport {
    /// Vertices of the mesh.
    pub vertices: usize,
    /// Lights that can be changed separately.
    pub lights: usize,
    /// Estimated relative L2 error of the radiosity, by origin. `receivers` is measured with the new light. `visibility` is a bound:
    /// the noise of all lights added up. `shooters` and `form_factors` are those of the finished bake, which hold for light from
    /// similar places.
    pub error: ErrorBudget,
    /// The same of the finished bake.
    pub error_as_baked: ErrorBudget,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// Relights the scene of a finished bake. `scene` is that of the bake, with its lights unchanged.
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
    let revealed = RevealedErrors::new(&mesh, &irradiance);
    let (lit, fitted) = lit_mesh(scene, &mesh, light.only, (&irradiance, &revealed), &direct);
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
            irradiance: best_fit_of_part(&mesh, &irradiance, &revealed, &part),
        }
    });
    let lit = LitMesh { layers: layers.collect(), ..lit };
    let (lit, difference) = output_mesh(scene, lit, kept.simplify.then_some(&kept.error));
    let error = error(kept, &factors, &mesh, &fitted).with_simplification(difference);
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
    let [before, now] = [&baked_factors, factors].map(|factors| kept.validation_lit_by(factors));
    // The noise of each part is known relative to the whole light of the finished bake.
    let part_of = |(part, factor): (&KeptPart, &DVec3)| factor.max_element() * part.noise;
    let sum: f64 = kept.parts.iter().zip(factors).map(part_of).sum();
    let noise = if now.level() > 0.0 { sum * before.level() / now.level() } else { 0.0 };
    let receivers = if now.count() > 0 {
        now.interpolation_error(mesh, fitted, kept.reflectance, noise)[0]
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
