//! The surfaces that block light, behind a BVH.

mod bundle;
mod lanes;
mod packet;
mod segment;
mod shaft;
#[cfg(test)]
mod tests;
mod tree;

use glam::{DVec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::{Boundable, BvhBuildParams};

use crate::geometry::{ConvexPolygon, PlaneId, area_vector};

use self::tree::Tree;

pub use bundle::{Bounds, Bundle};
pub use shaft::{Blockage, Shaft};

/// Boxes are padded by this part of the scene's largest coordinate: rays are rounded to f32 when they meet a box, and must
/// not slip past one that their exact counterpart touches.
const PADDING: f64 = 1e-6;

/// Clearance at the ends of rays, relative to the scene's largest coordinate. Hits are computed in f64 and the planes of both
/// ends do not count, so that rounding is all that it has to cover; a sheet may stand this close to a receiver.
const CLEARANCE: f64 = 1e-11;

/// The occluders of a scene. Built from the same polygons it is the same, bit for bit, everywhere.
pub struct Occluder {
    /// In the order of the BVH's leaves.
    polygons: Vec<OccluderPolygon>,
    bvh: Bvh2,
    /// The same for segments.
    tree: Tree,
    /// Rays start this much after and end this much before their ends: coordinates are not known better.
    clearance: f64,
}

struct OccluderPolygon {
    plane: PlaneId,
    normal: DVec3,
    corners: Vec<DVec3>,
}

impl OccluderPolygon {
    /// Triangles of the fan around the first corner.
    fn triangle_count(&self) -> u32 {
        self.corners.len() as u32 - 2
    }

    fn triangle(&self, place: u32) -> [DVec3; 3] {
        let place = place as usize;
        [self.corners[0], self.corners[place + 1], self.corners[place + 2]]
    }
}

struct PaddedBox(Aabb);

impl Boundable for PaddedBox {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl Occluder {
    /// Builds the BVH over these polygons.
    #[must_use]
    pub fn new(polygons: &[ConvexPolygon]) -> Self {
        let corners = || polygons.iter().flat_map(|polygon| &polygon.corners);
        let largest = corners().map(|corner| corner.abs().max_element()).fold(0.0, f64::max);
        let padding = Vec3A::splat((largest * PADDING) as f32);
        let boxes: Vec<PaddedBox> = polygons
            .iter()
            .map(|polygon| {
                let points: Vec<Vec3A> = polygon.corners.iter().map(|p| p.as_vec3a()).collect();
                let tight = Aabb::from_points(&points);
                PaddedBox(Aabb::new(tight.min - padding, tight.max + padding))
            })
            .collect();
        let bvh = build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut Default::default());
        let polygons: Vec<OccluderPolygon> = bvh
            .primitive_indices
            .iter()
            .map(|index| {
                let polygon = &polygons[*index as usize];
                OccluderPolygon {
                    plane: polygon.plane,
                    normal: area_vector(&polygon.corners).normalize_or_zero(),
                    corners: polygon.corners.clone(),
                }
            })
            .collect();
        let tree = Tree::new(&bvh, largest as f32, &polygons);
        Self { polygons, bvh, tree, clearance: largest * CLEARANCE }
    }

    /// Number of polygons.
    #[must_use]
    pub fn len(&self) -> usize {
        self.polygons.len()
    }

    /// True where nothing can block anything.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.polygons.is_empty()
    }
}
