//! Polygons in a BVH that finds the nearest one.

use glam::DVec3;
use obvhs::BvhBuildParams;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::ray::{Ray, RayHit};

use super::faces;
use crate::geometry::{ConvexPolygon, PlaneId, area_vector};
use crate::hierarchy::{PaddedBox, in_order};

/// Boxes are padded by this part of the scene's largest coordinate: rays are rounded to f32 when they meet a box.
const PADDING: f64 = 1e-6;

/// The two sides of a sheet lie in one plane, but may be divided differently into polygons, and the plane's corners are as flat as
/// the numbers of a file. Hits are one that are no farther apart, across the plane, than the clearance; a ray that grazes it is
/// taken to cross it at this cosine at least.
const GRAZING: f64 = 1e-2;

/// Part of a triangle's edges by which it reaches beyond them: no ray passes between neighbours by rounding.
const SEAM: f64 = 1e-9;

/// Polygons of a scene, seen from their fronts.
pub struct SeenPolygons {
    /// Triangles of the polygons' fans.
    triangles: Vec<Triangle>,
    /// Of each polygon; empty where all are opaque.
    opacities: Vec<f32>,
    bvh: CwBvh,
    /// Distance by which a ray starts anew beyond a transparent occluder.
    clearance: f64,
}

struct Triangle {
    corner: DVec3,
    edges: [DVec3; 2],
    normal: DVec3,
    polygon: u32,
    plane: PlaneId,
}

/// What a ray meets first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Index of the polygon.
    pub polygon: usize,
    /// Distance from the origin.
    pub distance: f64,
    /// Whether the ray meets the polygon's front.
    pub is_front: bool,
    /// Plane of the polygon.
    pub plane: PlaneId,
}

impl SeenPolygons {
    /// Builds the BVH. `opacities` has one for each polygon, or none where all are opaque.
    #[must_use]
    pub fn new(polygons: &[ConvexPolygon], opacities: &[f32]) -> Self {
        let mut triangles = vec![];
        for (index, polygon) in (0..).zip(polygons) {
            let normal = area_vector(&polygon.corners).normalize_or_zero();
            let corner = polygon.corners[0];
            triangles.extend(polygon.corners[1..].windows(2).map(|pair| Triangle {
                corner,
                edges: [pair[0] - corner, pair[1] - corner],
                normal,
                polygon: index,
                plane: polygon.plane,
            }));
        }
        let corners = |triangle: &Triangle| {
            let [a, b] = triangle.edges;
            [triangle.corner, triangle.corner + a, triangle.corner + b]
        };
        let largest =
            triangles.iter().flat_map(corners).map(|corner| corner.abs().max_element()).fold(0.0, f64::max);
        let padded = |triangle: &Triangle| PaddedBox::around(corners(triangle), largest * PADDING);
        let boxes: Vec<PaddedBox> = triangles.iter().map(padded).collect();
        let bvh = build_cwbvh(&boxes, BvhBuildParams::medium_build(), &mut Default::default());
        let triangles = in_order(triangles, &bvh.primitive_indices);
        Self { triangles, opacities: opacities.to_vec(), bvh, clearance: largest * PADDING }
    }

    /// Opacity of a polygon.
    #[must_use]
    pub fn opacity(&self, polygon: usize) -> f64 {
        self.opacities.get(polygon).map_or(1.0, |opacity| f64::from(*opacity))
    }

    /// The nearest polygon along a unit direction, farther than `from` and not in the plane `own`. Where both sides of a sheet are
    /// polygons, it is the one whose front the ray meets.
    #[must_use]
    pub fn nearest(&self, origin: DVec3, direction: DVec3, from: f64, own: PlaneId) -> Option<Hit> {
        if self.triangles.is_empty() {
            return None;
        }
        let from = if from > 0.0 { from + self.clearance } else { 0.0 };
        let ray = Ray::new(origin.as_vec3a(), direction.as_vec3a(), from as f32, f32::INFINITY);
        let mut best: Option<Hit> = None;
        let meet = |_: &Ray, index: usize| {
            let triangle = &self.triangles[index];
            let Some(distance) = triangle.distance(origin, direction) else { return f32::INFINITY };
            if triangle.plane == own || distance <= from {
                return f32::INFINITY;
            }
            let is_front = faces(triangle.normal, direction);
            let one_sheet = self.clearance / triangle.normal.dot(direction).abs().max(GRAZING);
            let is_nearer = best.is_none_or(|hit| {
                let apart = distance - hit.distance;
                if hit.plane == triangle.plane && apart.abs() <= one_sheet {
                    is_front && !hit.is_front
                } else {
                    apart < 0.0
                }
            });
            if is_nearer {
                let (polygon, plane) = (triangle.polygon as usize, triangle.plane);
                best = Some(Hit { polygon, distance, is_front, plane });
            }
            // So far that the other side of a sheet is still looked at.
            ((distance + one_sheet) * (1.0 + 1e-6)) as f32
        };
        self.bvh.ray_traverse(ray, &mut RayHit::none(), meet);
        best
    }
}

impl SeenPolygons {
    /// A distance from a point that leads out of all polygons, whichever the direction.
    #[must_use]
    pub fn beyond(&self, point: DVec3) -> f64 {
        point.length() + 2.0 * self.clearance / PADDING
    }

    /// Part of the light that the polygons let through between two points; those in the planes of either end do not count.
    #[must_use]
    pub fn transmittance(&self, from: DVec3, to: DVec3, planes: [PlaneId; 2]) -> f64 {
        let span = to - from;
        let length = span.length();
        let direction = span / length;
        let (mut left, mut at) = (1.0, 0.0);
        while left > 0.0
            && let Some(hit) = self.nearest(from, direction, at, planes[0])
            && hit.distance < length
        {
            if hit.plane != planes[1] {
                left *= 1.0 - self.opacity(hit.polygon);
            }
            at = hit.distance;
        }
        left
    }
}

impl Triangle {
    /// Where a ray crosses it, on either side (Möller and Trumbore, "Fast, minimum storage ray/triangle intersection", 1997). The edges
    /// belong to it.
    fn distance(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let [a, b] = self.edges;
        let across = direction.cross(b);
        let determinant = a.dot(across);
        if determinant == 0.0 {
            return None;
        }
        let inverse = 1.0 / determinant;
        let relative = origin - self.corner;
        let u = relative.dot(across) * inverse;
        if !(-SEAM..=1.0 + SEAM).contains(&u) {
            return None;
        }
        let other = relative.cross(a);
        let v = direction.dot(other) * inverse;
        if v < -SEAM || u + v > 1.0 + SEAM {
            return None;
        }
        Some(b.dot(other) * inverse)
    }
}
