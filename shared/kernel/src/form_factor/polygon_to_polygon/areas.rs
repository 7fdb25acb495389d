//! Quadrature over polygons.

use std::f64::consts::PI;

use glam::DVec3;
use libm::log;

use super::gauss::{MAX_NODES, rule};
use crate::form_factor::contour;

/// A point of a polygon and the part of its area that it stands for.
pub type AreaPoint = (DVec3, f64);

/// Nodes in each direction of a polygon for an integrand that is analytic within `ratio` > 1 radii of the polygon's centre.
///
/// The error of Gauss's rule is about rho^(-2 nodes) with rho = z + sqrt(z^2 - 1), where the integrand is singular at z half
/// lengths from the middle of the interval. Intervals within the polygon have half lengths up to the radius, so z is about the
/// ratio. This many nodes bring the error under that of rounding, the last of them for the constant before it.
pub fn nodes_for(ratio: f64) -> usize {
    let rho = ratio + (ratio * ratio - 1.0).sqrt();
    let nodes = -log(f64::EPSILON) / (2.0 * log(rho));
    (nodes.ceil() as usize + 1).min(MAX_NODES)
}

/// Points of a convex polygon: the product of two Gauss rules on each of the quadrilaterals, and perhaps one triangle, into which
/// it falls from its first corner. At most 16 nodes.
#[must_use]
pub fn points(corners: &[DVec3], nodes: usize) -> Vec<AreaPoint> {
    let mut points = vec![];
    let end = corners.len() - 1;
    for first in (1..end).step_by(2) {
        // A triangle is a quadrilateral whose last two corners are one.
        let [a, b, c, d] = [corners[0], corners[first], corners[first + 1], corners[(first + 2).min(end)]];
        for s in rule(nodes) {
            for t in rule(nodes) {
                let along = (b - a).lerp(c - d, t.place);
                let across = (d - a).lerp(c - b, s.place);
                let position = a.lerp(b, s.place).lerp(d.lerp(c, s.place), t.place);
                points.push((position, s.weight * t.weight * along.cross(across).length()));
            }
        }
    }
    points
}

/// The integral of cos cos / (pi r^2) over two polygons, given by their points and normals, of which each lies wholly in front
/// of the other.
#[must_use]
pub fn between_areas(from: &[AreaPoint], normal: DVec3, to: &[AreaPoint], other_normal: DVec3) -> f64 {
    let kernel = |offset: DVec3| {
        let square = offset.length_squared();
        -normal.dot(offset) * other_normal.dot(offset) / (PI * square * square)
    };
    let seen = |point: DVec3| to.iter().map(|(other, area)| area * kernel(*other - point)).sum::<f64>();
    from.iter().map(|(point, area)| area * seen(*point)).sum()
}

/// The integral over a polygon, given by its points and normal, of the exact form factor of each to another polygon. Each lies
/// wholly in front of the other.
pub fn from_points(from: &[AreaPoint], normal: DVec3, to: &[DVec3]) -> f64 {
    let mut relative = to.to_vec();
    let mut seen = |point: DVec3| {
        for (relative, corner) in relative.iter_mut().zip(to) {
            *relative = *corner - point;
        }
        contour(normal, &relative)
    };
    from.iter().map(|(point, area)| area * seen(*point)).sum()
}
