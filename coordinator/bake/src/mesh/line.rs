//! Lines on facets that become edges of the mesh.

use glam::DVec3;

/// A line on a facet along which another facet rises from it, or a shadow ends.
pub type Contact = [DVec3; 2];

/// Nearest point of a line.
pub fn nearest([start, end]: Contact, point: DVec3) -> DVec3 {
    let span = end - start;
    let t = (point - start).dot(span) / span.length_squared();
    start + span * t.clamp(0.0, 1.0)
}

/// Distance of a point from a line.
pub fn distance_to_line(point: DVec3, line: &Contact) -> f64 {
    point.distance(nearest(*line, point))
}

/// Narrows a part of a line, from 0 to 1, to where a height is not negative that is linear along the line and has these values at
/// its ends. False where it is negative everywhere.
pub fn narrow(part: &mut (f64, f64), [start, end]: [f64; 2]) -> bool {
    if start < 0.0 && end < 0.0 {
        return false;
    }
    if start < 0.0 {
        part.0 = part.0.max(start / (start - end));
    } else if end < 0.0 {
        part.1 = part.1.min(start / (start - end));
    }
    true
}
