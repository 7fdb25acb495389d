//! Does anything block a segment? Watertight: no ray passes between two polygons that share an edge or a corner.

use glam::DVec3;
use obvhs::ray::Ray;

use super::Occluder;
use crate::geometry::PlaneId;

impl Occluder {
    /// True when a polygon crosses the open segment between two points. Polygons in the planes of either end do not count:
    /// they cannot block light that leaves or reaches their own plane from the front, and rounding must not let them.
    /// Segments shorter than the clearance at both ends are never blocked.
    #[must_use]
    pub fn blocks(&self, from: DVec3, to: DVec3, planes: [PlaneId; 2]) -> bool {
        if self.polygons.is_empty() {
            return false;
        }
        let span = to - from;
        let length = span.length();
        if length <= 2.0 * self.clearance {
            return false;
        }
        let direction = span / length;
        let sheared = ShearedRay::new(from, direction);
        let (nearest, farthest) = (self.clearance, length - self.clearance);
        let ray = Ray::new(from.as_vec3a(), direction.as_vec3a(), 0.0, length as f32);
        let hit = |_: &Ray, index: usize| {
            let polygon = &self.polygons[index];
            if planes.contains(&polygon.plane) {
                return f32::INFINITY;
            }
            let distance = sheared.distance_to(&polygon.corners);
            if distance.is_some_and(|distance| distance > nearest && distance < farthest) {
                0.0
            } else {
                f32::INFINITY
            }
        };
        !self.bvh.ray_traverse_miss(ray, hit)
    }
}

/// A ray in the coordinates of Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection" (JCGT 2013): sheared so that it
/// runs along one axis. An edge's side then is the sign of one 2-D determinant, which two triangles that share the edge
/// compute from the same numbers with opposite sign, so that at least one of them is hit; zero counts as a hit for both.
struct ShearedRay {
    origin: DVec3,
    axes: [usize; 3],
    shear: DVec3,
}

impl ShearedRay {
    fn new(origin: DVec3, direction: DVec3) -> Self {
        let z = direction.abs().max_position();
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let along = direction[z];
        let shear = DVec3::new(direction[axes[0]] / along, direction[axes[1]] / along, 1.0 / along);
        Self { origin, axes, shear }
    }

    /// Corner as (x, y across the ray, distance along it).
    fn project(&self, corner: DVec3) -> DVec3 {
        let relative = corner - self.origin;
        let along = relative[self.axes[2]];
        DVec3::new(
            relative[self.axes[0]] - self.shear.x * along,
            relative[self.axes[1]] - self.shear.y * along,
            self.shear.z * along,
        )
    }

    /// Distance along the ray to a convex polygon, in either direction along the ray; `None` for a miss or an edge-on hit.
    fn distance_to(&self, corners: &[DVec3]) -> Option<f64> {
        let first = self.project(corners[0]);
        let mut previous = self.project(corners[1]);
        for corner in &corners[2..] {
            let corner = self.project(*corner);
            let (u, v, w) = (edge(corner, previous), edge(first, corner), edge(previous, first));
            if (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0) {
                let determinant = u + v + w;
                if determinant != 0.0 {
                    return Some((u * first.z + v * previous.z + w * corner.z) / determinant);
                }
            }
            previous = corner;
        }
        None
    }
}

fn edge(a: DVec3, b: DVec3) -> f64 {
    a.x * b.y - a.y * b.x
}
