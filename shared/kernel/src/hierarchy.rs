//! Items in a bounding volume hierarchy. Boxes are culled in f32, padded for it; whether and where an item is met is for the
//! caller to compute in f64.

use glam::{DVec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::ray::{Ray, RayHit};
use obvhs::{Boundable, BvhBuildParams};
use smallvec::SmallVec;

use crate::geometry::Bounds;

/// A box in f32, padded for its rounding.
pub struct PaddedBox(Aabb);

impl PaddedBox {
    /// The box around some points rounded to f32, with `padding` on all sides.
    #[must_use]
    pub fn around(points: impl IntoIterator<Item = DVec3>, padding: f64) -> Self {
        let points: SmallVec<[Vec3A; 4]> = points.into_iter().map(|point| point.as_vec3a()).collect();
        let (tight, padding) = (Aabb::from_points(&points), Vec3A::splat(padding as f32));
        Self(Aabb::new(tight.min - padding, tight.max + padding))
    }
}

/// Of a box that is padded already.
impl From<Bounds> for PaddedBox {
    fn from(bounds: Bounds) -> Self {
        Self(Aabb::new(bounds.low.as_vec3a(), bounds.high.as_vec3a()))
    }
}

impl Boundable for PaddedBox {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

/// Items in a BVH. The same items give the same tree everywhere.
pub struct Hierarchy<T> {
    bvh: Bvh2,
    items: Vec<T>,
}

impl<T> Hierarchy<T> {
    /// Builds the BVH.
    #[must_use]
    pub fn new(items: Vec<T>, around: impl Fn(&T) -> PaddedBox) -> Self {
        let boxes: Vec<PaddedBox> = items.iter().map(around).collect();
        let bvh = build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut Default::default());
        let items = in_order(items, &bvh.primitive_indices);
        Self { bvh, items }
    }

    /// The items, in the order of the leaves.
    #[must_use]
    pub fn items(&self) -> &[T] {
        &self.items
    }

    /// Calls `meet` with the place and the item of boxes along a ray, nearer ones first. It returns the distance beyond which nothing
    /// is looked for any more, or infinity where the item does not shorten the ray.
    pub fn along_ray(&self, origin: DVec3, direction: DVec3, mut meet: impl FnMut(usize, &T) -> f32) {
        let ray = Ray::new(origin.as_vec3a(), direction.as_vec3a(), 0.0, f32::INFINITY);
        self.bvh.ray_traverse(ray, &mut RayHit::none(), |_, place| meet(place, &self.items[place]));
    }

    /// True where no item along a ray of this length ends it; `ends` is called in no particular order.
    pub fn is_clear(
        &self,
        origin: DVec3,
        direction: DVec3,
        length: f64,
        mut ends: impl FnMut(&T) -> bool,
    ) -> bool {
        let ray = Ray::new(origin.as_vec3a(), direction.as_vec3a(), 0.0, length as f32);
        self.bvh.ray_traverse_miss(ray, |_, place| if ends(&self.items[place]) { 0.0 } else { f32::INFINITY })
    }

    /// The items whose leaves touch a box.
    #[must_use]
    pub fn touching(&self, bounds: &PaddedBox) -> Vec<&T> {
        let mut found = Vec::new();
        self.bvh.aabb_traverse(bounds.0, |bvh, node| {
            let node = &bvh.nodes[node as usize];
            let (first, count) = (node.first_index as usize, node.prim_count as usize);
            found.extend(&self.items[first..first + count]);
            true
        });
        found
    }
}

/// Sorts items as a BVH's leaves name them, so that neighbours lie together in memory.
pub(crate) fn in_order<T>(items: Vec<T>, order: &[u32]) -> Vec<T> {
    let mut items: Vec<Option<T>> = items.into_iter().map(Some).collect();
    order.iter().filter_map(|index| items[*index as usize].take()).collect()
}
