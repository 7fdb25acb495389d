//! The brightness that suits a scene.

use glam::DVec3;
use rayon::prelude::*;

use super::ExportError;
use bake::lit::{LitMesh, LitTriangle, LitVertex};
use scene::Scene;

/// Share of the reflecting area that is not over-exposed.
const PERCENTILE: f64 = 0.95;

/// Triangles that a thread takes at a time.
const TRIANGLES_AT_ONCE: usize = 1024;

/// 1 / (area-weighted 95th percentile of the largest channel of the irradiance on reflecting surfaces).
///
/// Where nearly everything is dark the brightest vertex takes the percentile's place; where all is dark the exposure is 1.
///
/// # Errors
/// When an irradiance is not finite, or a triangle names a vertex that does not exist.
pub(super) fn choose(scene: &Scene, lit: &LitMesh) -> Result<f64, ExportError> {
    let mut samples: Vec<(f64, f64)> = vec![];
    for (surface, triangles) in scene.surfaces.iter().zip(&lit.surfaces) {
        if surface.reflectance.max_element() <= 0.0 {
            continue;
        }
        let at_corners = |triangle: &LitTriangle| {
            let corners = corners(lit, triangle)?;
            let [a, b, c] = corners.map(|corner| corner.position);
            let area = (b - a).cross(c - a).length() / 2.0;
            let sample = |corner: &LitVertex| (corner.irradiance.max_element(), area / 3.0);
            if corners.iter().all(|corner| corner.irradiance.is_finite()) {
                return Ok(corners.map(sample));
            }
            let quantity = "irradiance".into();
            Err(ExportError::NotFinite { surface: surface.name.clone(), quantity })
        };
        let all = triangles.par_iter().with_min_len(TRIANGLES_AT_ONCE).map(at_corners);
        for at_corners in all.collect::<Vec<Result<[_; 3], _>>>() {
            samples.extend(at_corners?);
        }
    }
    samples.par_sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = samples.iter().map(|(_, area)| area).sum();
    let mut below = 0.0;
    let percentile = samples.iter().find(|(_, area)| {
        below += area;
        below >= PERCENTILE * total
    });
    let white = [percentile, samples.last()].into_iter().flatten().map(|(value, _)| *value);
    Ok(white.map(f64::recip).find(|exposure| exposure.is_finite() && *exposure > 0.0).unwrap_or(1.0))
}

/// The triangle's vertices.
pub(super) fn corners<'a>(
    lit: &'a LitMesh,
    triangle: &LitTriangle,
) -> Result<[&'a LitVertex; 3], ExportError> {
    let corner = |index: u32| lit.vertices.get(index as usize);
    match triangle.vertices.map(corner) {
        [Some(a), Some(b), Some(c)] => Ok([a, b, c]),
        _ => Err(ExportError::Mismatch("a triangle names a vertex that does not exist".into())),
    }
}

/// Irradiance as `COLOR_0` shows it.
pub(super) fn display_colour(irradiance: DVec3, exposure: f64) -> DVec3 {
    (irradiance * exposure).clamp(DVec3::ZERO, DVec3::ONE)
}
