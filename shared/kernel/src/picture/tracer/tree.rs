//! The nearest surface along a ray.
//!
//! The BVH finds candidates in single precision, in boxes that are padded for it. Whether a triangle is hit, and where, is
//! computed in f64: for each edge the sign of the volume that ray and edge span. Two triangles that share an edge compute the
//! same number for it with opposite sign, bit for bit, so that no ray passes between them (Woop, Benthin, Wald, *Watertight
//! Ray/Triangle Intersection*, JCGT 2013, without its projection, which f64 does not need). Corners that were rounded apart, and
//! corners on another triangle's edge, are closed by a slack: a ray hits that misses an edge by no more than the rounding.

use crate::geometry::Bounds;
use crate::hierarchy::Hierarchy;
use crate::picture::{PictureScene, Ray};
use glam::DVec3;

/// Boxes are padded by this part of the largest coordinate: eight times what rounding a ray to f32 moves it within the scene.
const PADDING: f64 = 4e-6;

/// Distances in f32 are lifted by this part, some roundings, so that no box with a nearer surface is left out.
const LIFT: f64 = 1e-6;

/// Frame coordinates are computed in f64, and not known better than to some roundings of the largest.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Two triangles of an edge are met at distances that differ by some slacks, where they are seen at an angle.
const SAME: f64 = 16.0;

/// All triangles in a BVH.
pub(super) struct Tree {
    triangles: Hierarchy<Triangle>,
    /// Box around all of them.
    bounds: Bounds,
    /// Square of the distance by which a ray may miss an edge.
    slack: f64,
    /// Distances along a ray that differ by so much are those of one place.
    same: f64,
}

struct Triangle {
    corners: [DVec3; 3],
    part: u32,
    triangle: u32,
    double_sided: bool,
}

/// Where a ray meets a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit {
    /// Distance from the start of the entered ray.
    distance: f64,
    /// Place in the order of the leaves: decides between surfaces at the same distance.
    place: u32,
    /// The part of the scene.
    pub(super) part: u32,
    /// The triangle in it.
    pub(super) triangle: u32,
    /// Barycentric coordinates: none is negative, and they sum to one.
    pub(super) weights: DVec3,
}

/// What was seen already: all that is nearer than this, or as near and earlier in the order of the leaves, and what belongs to the
/// same surface in the same place: on an edge a ray meets both of its triangles.
#[derive(Clone, Copy)]
pub(super) struct Passed {
    distance: f64,
    place: u32,
    part: u32,
}

impl Passed {
    /// Nothing was seen.
    pub(super) const NOTHING: Self = Self { distance: f64::NEG_INFINITY, place: 0, part: u32::MAX };

    /// The surface of this hit, and what is before it, was seen.
    pub(super) fn hit(hit: &Hit) -> Self {
        Self { distance: hit.distance, place: hit.place, part: hit.part }
    }

    /// `same`: distances that differ by so much are those of one place.
    fn is_before(self, hit: &Hit, same: f64) -> bool {
        let is_same = hit.part == self.part && hit.distance - self.distance <= same;
        (self.distance, self.place) < (hit.distance, hit.place) && !is_same
    }
}

/// A ray that starts where the scene does.
pub(super) struct Entered {
    origin: DVec3,
    direction: DVec3,
    start: f64,
}

impl Tree {
    /// Builds the BVH.
    pub(super) fn new(scene: &PictureScene) -> Self {
        let triangles: Vec<Triangle> = scene
            .parts
            .iter()
            .zip(0..)
            .flat_map(|(part, number)| {
                part.triangles.iter().zip(0..).map(move |(vertices, triangle)| Triangle {
                    corners: vertices.map(|vertex| DVec3::from_array(part.positions[vertex as usize])),
                    part: number,
                    triangle,
                    double_sided: part.double_sided,
                })
            })
            .collect();
        let corners = || triangles.iter().flat_map(|triangle| triangle.corners);
        let largest = corners().map(|corner| corner.abs().max_element()).fold(0.0, f64::max);
        let padding = DVec3::splat(largest * PADDING + scene.rounding);
        let bounds = Bounds::around(corners()).padded(padding);
        let around = |triangle: &Triangle| Bounds::around(triangle.corners).padded(padding).into();
        let triangles = Hierarchy::new(triangles, around);
        let slack = scene.rounding + largest * ROUNDING;
        Self { triangles, bounds, slack: slack * slack, same: SAME * slack }
    }

    /// Moves the start of a ray to where it enters the box around the scene, which may be far away from the eye: coordinates
    /// are small then. `None` where the ray misses the box.
    pub(super) fn enter(&self, ray: &Ray) -> Option<Entered> {
        let inverse = ray.direction.recip();
        let [first, second] =
            [self.bounds.low, self.bounds.high].map(|corner| (corner - ray.origin) * inverse);
        // A ray within a side of the box gives NaN, which minimum and maximum leave out.
        let axes = [0, 1, 2];
        let near = axes.map(|axis| first[axis].min(second[axis])).into_iter().fold(ray.start, f64::max);
        let far = axes.map(|axis| first[axis].max(second[axis])).into_iter().fold(f64::INFINITY, f64::min);
        (near <= far).then(|| Entered {
            origin: ray.origin + ray.direction * near,
            direction: ray.direction,
            start: ray.start - near,
        })
    }

    /// The nearest surface that was not seen yet and is not a hole.
    pub(super) fn nearest(
        &self,
        ray: &Entered,
        passed: Passed,
        is_hole: impl Fn(&Hit) -> bool,
    ) -> Option<Hit> {
        let mut nearest: Option<Hit> = None;
        self.triangles.along_ray(ray.origin, ray.direction, |place, triangle| {
            let Some(hit) = self.hit(ray, place, triangle) else { return f32::INFINITY };
            let is_nearer =
                nearest.is_none_or(|found| (hit.distance, hit.place) < (found.distance, found.place));
            if !is_nearer || !passed.is_before(&hit, self.same) || is_hole(&hit) {
                return f32::INFINITY;
            }
            nearest = Some(hit);
            (hit.distance.max(0.0) * (1.0 + LIFT)) as f32
        });
        nearest
    }

    fn hit(&self, ray: &Entered, place: usize, triangle: &Triangle) -> Option<Hit> {
        let &Triangle { corners, part, triangle, double_sided } = triangle;
        let [a, b, c] = corners.map(|corner| corner - ray.origin);
        let along = ray.direction;
        let volumes = DVec3::new(along.dot(b.cross(c)), along.dot(c.cross(a)), along.dot(a.cross(b)));
        // Negative where the triangle faces the ray.
        let volume = volumes.element_sum();
        if volume == 0.0 || (volume > 0.0 && !double_sided) {
            return None;
        }
        let is_inside = |own: f64, from: DVec3, to: DVec3| {
            own * volume >= 0.0 || own * own <= self.slack * along.cross(to - from).length_squared()
        };
        if !is_inside(volumes.x, b, c) || !is_inside(volumes.y, c, a) || !is_inside(volumes.z, a, b) {
            return None;
        }
        let inside = (volumes / volume).max(DVec3::ZERO);
        let weights = inside / inside.element_sum();
        let distance = along.dot(a * weights.x + b * weights.y + c * weights.z);
        // False for NaN, too.
        let is_ahead = distance >= ray.start;
        (is_ahead && weights.is_finite()).then_some(Hit {
            distance,
            place: place as u32,
            part,
            triangle,
            weights,
        })
    }
}
