use glam::DVec3;
use kernel::geometry::Bounds;
use kernel::hierarchy::PaddedBox;
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use scene::{Facet, Scene};
use smallvec::SmallVec;

use super::WELD;
use super::silhouettes::Silhouette;
use super::source::Source;

/// Facets in a BVH.
pub struct Receivers<'a> {
    bvh: Bvh2,
    /// Index of the surface and of the facet in it.
    facets: Vec<((usize, usize), &'a Facet)>,
}

impl<'a> Receivers<'a> {
    /// The facets that are large enough for lines of this length.
    pub fn new(scene: &'a Scene, shortest: f64) -> Self {
        let facets =
            scene.surfaces.iter().enumerate().flat_map(|(surface, own)| {
                own.lit_facets().map(move |(index, facet)| ((surface, index), facet))
            });
        let is_large = |facet: &Facet| Bounds::around(facet.positions()).diagonal() >= shortest;
        let facets: Vec<_> = facets.filter(|(_, facet)| is_large(facet)).collect();
        let boxes: Vec<PaddedBox> =
            facets.iter().map(|(_, facet)| PaddedBox::around(facet.positions(), 2.0 * WELD)).collect();
        let bvh = build_bvh2(&boxes, BvhBuildParams::fast_build(), &mut Default::default());
        Self { bvh, facets }
    }

    /// Visits the facets whose boxes meet the shadow of an edge: the part of the plane through the light and the edge that lies
    /// behind the edge.
    pub fn for_each(
        &self,
        source: &Source,
        edge: &Silhouette,
        mut visit: impl FnMut((usize, usize), &'a Facet),
    ) {
        if self.facets.is_empty() {
            return;
        }
        let [from, to] = edge.ends;
        let middle = (from + to) / 2.0;
        // Inward normals of the sides of the shadow, each with a point on it.
        let inward =
            |normal: DVec3, point: DVec3| if normal.dot(middle - point) < 0.0 { -normal } else { normal };
        let across = (to - from).cross(edge.outward);
        let behind = if across.dot(source.towards(middle)) > 0.0 { -across } else { across };
        let sides = [
            (edge.outward, from),
            (-edge.outward, from),
            (behind, from),
            (inward(edge.outward.cross(source.towards(from)), from), from),
            (inward(edge.outward.cross(source.towards(to)), to), to),
        ];
        let sides = sides.map(|(normal, point)| {
            let normal = normal.normalize_or_zero();
            (normal, normal.dot(point) - 4.0 * WELD)
        });
        let misses = |low: DVec3, high: DVec3| {
            let (centre, half) = ((low + high) * 0.5, (high - low) * 0.5);
            sides.iter().any(|(normal, offset)| normal.dot(centre) + normal.abs().dot(half) < *offset)
        };
        let mut stack = SmallVec::<[u32; 64]>::from_slice(&[0]);
        while let Some(index) = stack.pop() {
            let node = &self.bvh.nodes[index as usize];
            let aabb = node.aabb();
            if misses(aabb.min.as_dvec3(), aabb.max.as_dvec3()) {
                continue;
            }
            if !node.is_leaf() {
                stack.extend([node.first_index, node.first_index + 1]);
                continue;
            }
            let first = node.first_index as usize;
            for place in &self.bvh.primitive_indices[first..first + node.prim_count as usize] {
                let (place, facet) = self.facets[*place as usize];
                visit(place, facet);
            }
        }
    }
}
