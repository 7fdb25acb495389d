//! Light sources: emitting facets, each a polygon of constant exitance, and point lights.

use glam::DVec3;
use shared::geometry::ConvexPolygon;
use shared::row::{Shape, Shooter};

use super::BakeSettings;
use crate::scene::Scene;
use crate::solver::{ShareEnergy, add_row};

/// A light source with a row of its own.
pub struct LightSource {
    /// What its row is made of.
    pub shooter: Shooter,
    /// What one unit of the row is worth: exitance of a facet, intensity of a point light per squared frame unit.
    pub strength: DVec3,
}

/// The light sources of a scene; their keys start at `first_key`.
pub fn sources(scene: &Scene, settings: &BakeSettings, first_key: u64) -> Vec<LightSource> {
    let facets =
        scene.surfaces.iter().filter(|surface| surface.exitance != DVec3::ZERO).flat_map(|surface| {
            surface.facets.iter().map(|facet| {
                let corners = facet.corners.iter().map(|corner| corner.position).collect();
                (Shape::Polygons(vec![ConvexPolygon { plane: facet.plane, corners }]), surface.exitance)
            })
        });
    let lights = scene.point_lights.iter().map(|light| {
        let shape = if settings.planar_point_lights { Shape::PlanarPoint } else { Shape::Point };
        (shape(light.position), light.intensity / (scene.frame.scale * scene.frame.scale))
    });
    facets
        .chain(lights)
        .enumerate()
        .map(|(index, (shape, strength))| LightSource {
            shooter: Shooter { key: first_key + index as u64, shape },
            strength,
        })
        .collect()
}

/// Flux that shares get from the point lights alone, given the sources' rows.
pub fn flux_of_point_lights(sources: &[LightSource], rows: &[Vec<f32>], shares: &[ShareEnergy]) -> DVec3 {
    let flux = |row: &Vec<f32>| -> f64 { shares.iter().map(|s| s.area * f64::from(row[s.receiver])).sum() };
    let lights =
        sources.iter().zip(rows).filter(|(source, _)| !matches!(source.shooter.shape, Shape::Polygons(_)));
    lights.map(|(source, row)| source.strength * flux(row)).sum()
}

/// Adds what the sources give the receivers of their rows to the last entries of `irradiance`.
pub fn add(irradiance: &mut [DVec3], sources: &[LightSource], rows: &[Vec<f32>]) {
    for (source, row) in sources.iter().zip(rows) {
        let first = irradiance.len() - row.len();
        add_row(&mut irradiance[first..], row, source.strength);
    }
}
