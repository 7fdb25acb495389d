//! Materials averaged over a primitive's surface, with its vertex colours.

use std::sync::Arc;

use glam::{DVec3, DVec4};
use kernel::geometry::area_vector;
use rayon::prelude::*;

use super::primitives::Geometry;
use crate::appearance::{Appearance, Layer, MAX_REFLECTANCE, Pattern, VertexValues};
use crate::facet::Facet;

/// Reflectance, exitance and opacity of a surface: means over its area, and what varies.
pub(super) struct AveragedMaterial {
    pub(super) reflectance: DVec3,
    pub(super) exitance: DVec3,
    pub(super) opacity: f64,
    pub(super) appearance: Option<Arc<Appearance>>,
}

/// Averages the material of a primitive over its facets.
pub(super) fn averaged(pattern: &Arc<Pattern>, geometry: &Geometry, facets: &[Facet]) -> AveragedMaterial {
    let layers = layers(pattern);
    let is_plain = layers.iter().all(Option::is_none);
    let colours = geometry.albedo();
    let first = colours.as_ref().and_then(|colours| colours.first().copied()).unwrap_or([1.0; 4]);
    let is_one_colour = colours.iter().flatten().all(|colour| *colour == first);
    if is_plain && is_one_colour {
        return uniform(pattern, DVec4::from_array(first.map(f64::from)));
    }
    let mut sets: Vec<u32> = layers.into_iter().flatten().map(|layer: &Layer| layer.mapping.set).collect();
    sets.sort_unstable();
    sets.dedup();
    let coordinates = sets.into_iter().filter_map(|set| Some((set, geometry.attributes.coordinates(set)?)));
    let vertices = VertexValues {
        coordinates: coordinates.collect(),
        colours: colours.filter(|_| !is_one_colour || first != [1.0; 4]),
    };
    let appearance = Appearance::new(pattern.clone(), vertices, facets);
    let of_facet = |(index, facet): (usize, &Facet)| {
        let corners: Vec<DVec3> = facet.positions().collect();
        let (index, area) = (index as u32, area_vector(&corners).length());
        let reflectance = appearance.reflectance(index, facet, &corners);
        let exitance = appearance.exitance(index, facet, &corners);
        (area, reflectance * area, exitance * area, appearance.opacity(index, facet, &corners) * area)
    };
    let facets: Vec<(f64, DVec3, DVec3, f64)> = facets.par_iter().enumerate().map(of_facet).collect();
    // One after the other, whatever the threads: the same bits.
    let (area, reflected, emitted, taken) = facets
        .into_iter()
        .reduce(|a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2, a.3 + b.3))
        .unwrap_or((0.0, DVec3::ZERO, DVec3::ZERO, 0.0));
    let area = area.max(f64::MIN_POSITIVE);
    AveragedMaterial {
        reflectance: (reflected / area).min(DVec3::splat(MAX_REFLECTANCE)),
        exitance: emitted / area,
        opacity: (taken / area).min(1.0),
        appearance: Some(Arc::new(appearance)),
    }
}

/// The first set of texture coordinates that the pattern needs and the primitive lacks.
pub(super) fn missing_set(pattern: &Pattern, geometry: &Geometry) -> Option<u32> {
    let mut sets = layers(pattern).into_iter().flatten().map(|layer| layer.mapping.set);
    sets.find(|set| !geometry.attributes.has_coordinates(*set))
}

fn layers(pattern: &Pattern) -> [Option<&Layer>; 4] {
    [&pattern.reflecting, &pattern.dimming, &pattern.transmitting, &pattern.emitting].map(Option::as_ref)
}

fn uniform(pattern: &Pattern, colour: DVec4) -> AveragedMaterial {
    let alpha = pattern.opacity.of(colour.w);
    let diffuse = pattern.reflectance * colour.truncate() * alpha;
    let (reflectance, opacity) =
        pattern.with_transmission(diffuse, DVec3::splat(1.0 - pattern.transmission), alpha);
    AveragedMaterial { reflectance, exitance: pattern.exitance * alpha, opacity, appearance: None }
}
