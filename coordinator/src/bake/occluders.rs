//! Which facets can block light at all.

use glam::DVec3;
use shared::geometry::ConvexPolygon;
use shared::occluder::convex_bodies;

use crate::scene::{Facet, Scene, Side};

/// Heights up to this, in frame units, count as in the plane: a few units in the last place of f32 coordinates.
const IN_PLANE: f64 = 3e-4;

/// Directions whose extreme points are tried first.
const PROBES: i32 = 2;

/// Full scans over all points are made for at most this many pairs of facet and point; further facets just count as occluders.
const MAX_TESTS: usize = 2_000_000_000;

/// The facets that can stand between two points of the scene: all but those with the whole scene on one side, such as the
/// walls of a convex room; but convex bodies stay whole. The back sides of double-sided surfaces are left out, since a facet blocks from both sides.
pub fn occluders(scene: &Scene) -> Vec<ConvexPolygon> {
    let facets = || scene.surfaces.iter().filter(|s| s.side == Side::Front).flat_map(|s| &s.facets);
    let points: Vec<DVec3> = facets()
        .flat_map(|facet| facet.corners.iter().map(|corner| corner.position))
        .chain(scene.point_lights.iter().map(|light| light.position))
        .collect();
    let extremes = extreme_points(&points);
    let mut tests = 0;
    let mut blocks: Vec<bool> = facets()
        .map(|facet| {
            if has_both_sides(facet, &extremes) {
                return true;
            }
            tests += points.len();
            tests > MAX_TESTS || has_both_sides(facet, &points)
        })
        .collect();
    let polygons: Vec<ConvexPolygon> = facets()
        .map(|facet| ConvexPolygon {
            plane: facet.plane,
            corners: facet.corners.iter().map(|corner| corner.position).collect(),
        })
        .collect();
    // The bottom of a box on the floor blocks nothing, but makes the box a body.
    for faces in convex_bodies(&polygons) {
        if faces.iter().any(|face| blocks[*face]) {
            faces.iter().for_each(|face| blocks[*face] = true);
        }
    }
    polygons.into_iter().zip(blocks).filter(|(_, blocks)| *blocks).map(|(polygon, _)| polygon).collect()
}

fn has_both_sides(facet: &Facet, points: &[DVec3]) -> bool {
    let origin = facet.corners[0].position;
    let (mut above, mut below) = (false, false);
    for point in points {
        let height = facet.normal.dot(*point - origin);
        above |= height > IN_PLANE;
        below |= height < -IN_PLANE;
        if above && below {
            return true;
        }
    }
    false
}

/// The farthest points in a fixed set of directions: enough to find both sides of nearly every inner facet.
fn extreme_points(points: &[DVec3]) -> Vec<DVec3> {
    let steps = || -PROBES..=PROBES;
    let directions = steps().flat_map(|x| steps().flat_map(move |y| steps().map(move |z| (x, y, z))));
    directions
        .filter_map(|(x, y, z)| {
            let direction = DVec3::new(f64::from(x), f64::from(y), f64::from(z));
            points.iter().copied().reduce(|a, b| if direction.dot(b) > direction.dot(a) { b } else { a })
        })
        .collect()
}
