//! Polygons in a tree that finds the nearest one.

use glam::DVec3;
use smallvec::SmallVec;

use super::faces;
use crate::geometry::{ConvexPolygon, PlaneId, area_vector};
use crate::triangles::{Fan, PADDING, Ray, Tree, binary_tree, with_lanes};

/// The two sides of a sheet lie in one plane, but may be divided differently into polygons, and the plane's corners are as flat as
/// the numbers of a file. Hits are one that are no farther apart, across the plane, than the clearance; a ray that grazes it is
/// taken to cross it at this cosine at least.
pub(super) const GRAZING: f64 = 1e-2;

/// Part of a triangle's edges by which it reaches beyond them: no ray passes between neighbours by rounding.
const SEAM: f64 = 1e-9;

/// Polygons of a scene, seen from their fronts.
pub struct SeenPolygons {
    /// Triangles of the polygons' fans, in the order of the tree's leaves.
    pub(super) triangles: Vec<Triangle>,
    /// Of each polygon; empty where all are opaque.
    opacities: Vec<f32>,
    tree: Tree,
    /// Distance by which a ray starts anew beyond a transparent occluder.
    pub(super) clearance: f64,
}

pub(super) struct Triangle {
    corner: DVec3,
    edges: [DVec3; 2],
    pub(super) normal: DVec3,
    pub(super) polygon: u32,
    pub(super) plane: PlaneId,
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
    /// Builds the tree. `opacities` has one for each polygon, or none where all are opaque.
    #[must_use]
    pub fn new(polygons: &[ConvexPolygon], opacities: &[f32]) -> Self {
        let (bvh, largest) = binary_tree(polygons);
        let leaves: Vec<&ConvexPolygon> =
            bvh.primitive_indices.iter().map(|index| &polygons[*index as usize]).collect();
        let tree = Tree::new(&bvh, largest as f32, &leaves);
        let triangle = |(leaf, place): &(u32, u32)| {
            let polygon = leaves[*leaf as usize];
            let [corner, a, b] = Fan::triangle(&polygon, *place);
            Triangle {
                corner,
                edges: [a - corner, b - corner],
                normal: area_vector(&polygon.corners).normalize_or_zero(),
                polygon: bvh.primitive_indices[*leaf as usize],
                plane: polygon.plane,
            }
        };
        let triangles = tree.places().iter().map(triangle).collect();
        Self { triangles, opacities: opacities.to_vec(), tree, clearance: largest * PADDING }
    }

    /// Whether all polygons are opaque.
    #[must_use]
    pub fn are_opaque(&self) -> bool {
        self.opacities.is_empty()
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
        let mut met = self.met();
        with_lanes(self.ray([&origin, &direction], from, own, &mut met));
        self.first_of(&met, direction)
    }

    /// A ray, by origin and direction, that notes what it meets farther than `from` and not in the plane `own`.
    pub(super) fn ray<'a>(
        &'a self,
        [origin, direction]: [&'a DVec3; 2],
        from: f64,
        own: PlaneId,
        met: &'a mut Met,
    ) -> Ray<'a, impl FnMut(u32) -> f64> {
        let from = if from > 0.0 { from + self.clearance } else { 0.0 };
        let meet = move |number: u32| {
            let distance = self.triangles[number as usize].distance(*origin, *direction);
            if let Some(distance) = distance.filter(|distance| *distance > from) {
                met.add(number, distance);
            }
            met.end()
        };
        Ray { tree: &self.tree, origin, direction, from, own, meet }
    }

    pub(super) fn met(&self) -> Met {
        Met { hits: SmallVec::new(), nearest: f64::INFINITY, sheet: self.clearance / GRAZING }
    }
}

impl SeenPolygons {
    /// The nearest of what a ray has met, or the front of its sheet where there is one, whatever the order in which they were met.
    pub(super) fn first_of(&self, met: &Met, direction: DVec3) -> Option<Hit> {
        let nearer = |a: &(f64, u32), b: &(f64, u32)| {
            a.0.total_cmp(&b.0).then_with(|| self.polygon(a.1).cmp(&self.polygon(b.1)))
        };
        let nearest = self.hit(*met.hits.iter().min_by(|a, b| nearer(a, b))?, direction);
        if nearest.is_front || met.hits.len() == 1 {
            return Some(nearest);
        }
        let is_front_of_it = |(distance, number): &(f64, u32)| {
            let Triangle { normal, plane, .. } = &self.triangles[*number as usize];
            let cosine = -normal.dot(direction);
            let one_sheet = self.clearance / cosine.max(GRAZING);
            cosine > 0.0 && *plane == nearest.plane && distance - nearest.distance <= one_sheet
        };
        let fronts = met.hits.iter().copied().filter(is_front_of_it);
        Some(fronts.min_by(nearer).map_or(nearest, |front| self.hit(front, direction)))
    }

    fn polygon(&self, number: u32) -> u32 {
        self.triangles[number as usize].polygon
    }

    fn hit(&self, (distance, number): (f64, u32), direction: DVec3) -> Hit {
        let Triangle { normal, polygon, plane, .. } = &self.triangles[number as usize];
        Hit { polygon: *polygon as usize, distance, is_front: faces(*normal, direction), plane: *plane }
    }
}

/// What a ray has met: distances and numbers of triangles, among them the nearest one and those of its sheet.
pub(super) struct Met {
    hits: SmallVec<[(f64, u32); 8]>,
    nearest: f64,
    /// Distances between the sides of a sheet are at most this.
    sheet: f64,
}

impl Met {
    /// Distance beyond which nothing is looked for.
    fn end(&self) -> f64 {
        self.nearest + self.sheet
    }

    fn add(&mut self, number: u32, distance: f64) {
        if distance <= self.end() {
            self.nearest = self.nearest.min(distance);
            self.hits.push((distance, number));
        }
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
    pub(super) fn distance(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
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
