//! Light sources: emitting facets, each a polygon of constant exitance, and point lights.

use glam::DVec3;
use shared::geometry::ConvexPolygon;
use shared::row::{Row, Shape, Shooter};

use super::rows::{ReceiverSet, RowOffice};
use super::{BakeError, BakeSettings};
use crate::scene::Scene;
use crate::solver::add_row;

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

/// What the sources give a set of receivers, in all. `look` sees each source with its row and the row's variance.
///
/// # Errors
/// When a row cannot be had.
pub fn irradiance(
    sources: &[LightSource],
    set: ReceiverSet,
    office: &mut RowOffice,
    mut look: impl FnMut(&LightSource, &Row, f64),
) -> Result<Vec<DVec3>, BakeError> {
    let shooters: Vec<Shooter> = sources.iter().map(|source| source.shooter.clone()).collect();
    let mut irradiance = vec![DVec3::ZERO; set.count()];
    office.each_row(&shooters, set, |index, row, variance| {
        look(&sources[index], row, variance);
        add_row(&mut irradiance, row, sources[index].strength);
    })?;
    Ok(irradiance)
}
