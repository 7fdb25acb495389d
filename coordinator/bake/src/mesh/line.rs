//! Lines on facets that become edges of the mesh.

use glam::DVec3;

/// A line on a facet along which another facet rises from it, or a shadow ends.
pub type Contact = [DVec3; 2];

/// Distance of a point from a line.
pub fn distance_to_line(point: DVec3, [start, end]: &Contact) -> f64 {
    let span = *end - *start;
    let t = ((point - *start).dot(span) / span.length_squared()).clamp(0.0, 1.0);
    point.distance(*start + span * t)
}
