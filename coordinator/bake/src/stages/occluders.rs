//! The facets that can block light.

use glam::DVec3;
use kernel::geometry::ConvexPolygon;
use kernel::occluder::convex_bodies;
use kernel::replica::ScenePolygons;
use rayon::prelude::*;

use super::sides::{Plane, PointTree};
use super::{pieces, sky};
use scene::{Facet, Scene};

/// Heights up to this, in frame units, count as in the plane: a few ulps of f32 coordinates.
const IN_PLANE: f64 = 3e-4;

/// The facets that can occlude two points of the scene, or a point and its lights and sky: all but those with all of these
/// on one side, such as the walls of a convex room; convex bodies stay whole. The back sides of double-sided surfaces are left
/// out, since a facet blocks from both sides. Transparent occluders come in pieces, with the opacity of each.
pub fn occluders(scene: &Scene) -> ScenePolygons {
    let points: Vec<DVec3> = scene
        .front_facets()
        .flat_map(Facet::positions)
        .chain(scene.lights.iter().flat_map(|light| light.kind.extremes()))
        .chain(sky::corners(scene))
        .collect();
    let points = PointTree::new(points);
    let far: Vec<DVec3> = scene
        .lights
        .iter()
        .filter(|light| light.intensity != DVec3::ZERO)
        .filter_map(|light| light.kind.from_far())
        .collect();
    let can_block = |facet: &Facet| has_both_sides(facet, &points, &far);
    let facets =
        || scene.fronts().flat_map(|surface| (0..).zip(&surface.facets).map(move |facet| (surface, facet)));
    let (opaque, clear): (Vec<_>, Vec<_>) = facets().partition(|(surface, _)| surface.opacity >= 1.0);
    let mut blocks: Vec<bool> = opaque.par_iter().map(|(_, (_, facet))| can_block(facet)).collect();
    let polygons: Vec<ConvexPolygon> = opaque.iter().map(|(_, (_, facet))| facet.polygon()).collect();
    let all: f64 = clear.iter().map(|(_, (_, facet))| facet.polygon().area()).sum();
    let pieces: Vec<ScenePolygons> = clear
        .par_iter()
        .filter(|(_, (_, facet))| can_block(facet))
        .map(|(surface, (index, facet))| {
            pieces::cut_by_opacity(surface, *index, pieces::halvings(facet.polygon().area() / all))
        })
        .collect();
    // The bottom of a box on the floor blocks nothing, but makes the box a body.
    for faces in convex_bodies(&polygons) {
        if faces.iter().any(|face| blocks[*face]) {
            faces.iter().for_each(|face| blocks[*face] = true);
        }
    }
    let mut polygons: Vec<ConvexPolygon> =
        polygons.into_iter().zip(blocks).filter(|(_, blocks)| *blocks).map(|(polygon, _)| polygon).collect();
    if pieces.iter().all(|pieces| pieces.polygons.is_empty()) {
        return ScenePolygons { polygons, opacities: vec![] };
    }
    let mut opacities = vec![1.0; polygons.len()];
    for translucent in pieces {
        polygons.extend(translucent.polygons);
        opacities.extend(translucent.opacities);
    }
    ScenePolygons { polygons, opacities }
}

/// Whether some of these points, or of the points infinitely far in some directions, are above a facet and some below.
fn has_both_sides(facet: &Facet, points: &PointTree, far: &[DVec3]) -> bool {
    let is_far = |side: f64| far.iter().any(|direction| facet.normal.dot(*direction) * side > 0.0);
    let plane = Plane { origin: facet.corners[0].position, normal: facet.normal, tolerance: IN_PLANE };
    points.sides(&plane, [is_far(1.0), is_far(-1.0)]) == [true, true]
}
