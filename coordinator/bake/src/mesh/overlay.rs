//! Shares of one mesh on another: lines that divide the receivers need not divide the shooters.

use foldhash::{HashMap, HashMapExt};

use glam::DVec3;
use kernel::geometry::{Bounds, Corners, PlaneId, area_vector, clip};
use scene::Scene;
use smallvec::SmallVec;

use super::{Mesh, PatchId, Share, VertexId};

/// Overlaps smaller than this part of a leaf or share are rounding.
const SLIVER: f64 = 1e-9;

/// Points this near to the border of a polygon, in frame units, lie on it.
const ON_BORDER: f64 = 1e-9;

/// Surface, plane and cell in space.
type Key = (u32, PlaneId, [i64; 3]);

impl Mesh {
    /// Lays the shares of another mesh of the same facets over this one, in their order. `size` is about that of the leaves.
    #[must_use]
    pub fn overlaid(&self, other: &Self, shares: Vec<Share>, size: f64, scene: &Scene) -> Vec<Share> {
        let mut leaves_in: HashMap<Key, Vec<PatchId>> = HashMap::new();
        for (id, patch) in self.leaves() {
            let plane = scene.plane(patch.surface, patch.facet);
            for cell in cells(&self.corners(id), size) {
                leaves_in.entry((patch.surface, plane, cell)).or_default().push(id);
            }
        }
        let laid_over = |mut share: Share| {
            share.corners.clear();
            for (index, polygon) in share.polygons.iter().enumerate() {
                let in_cell = |cell| leaves_in.get(&(share.surface, polygon.plane, cell));
                let mut near: Vec<PatchId> =
                    cells(&polygon.corners, size).filter_map(in_cell).flatten().copied().collect();
                near.sort_unstable();
                near.dedup();
                let least = SLIVER * polygon.area();
                near.retain(|id| self.is_over(*id, &polygon.corners, least));
                share.overlaps.extend(near.into_iter().map(|id| (id, index)));
            }
            let place = other.position(share.vertex);
            let corners = share.overlaps.iter().flat_map(|(id, _)| &self.patch(*id).corners);
            let distance = |vertex: &VertexId| self.position(*vertex).distance_squared(place);
            share.vertex =
                corners.copied().min_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)))?;
            Some(share)
        };
        shares.into_iter().filter_map(laid_over).collect()
    }

    /// Whether a leaf faces the way that a polygon of its plane does, and has an area in common with it.
    fn is_over(&self, id: PatchId, polygon: &[DVec3], least: f64) -> bool {
        let corners = self.corners(id);
        let common = area_vector(&overlap(polygon, &corners)).length();
        common > least.min(SLIVER * self.patch(id).area)
            && area_vector(&corners).dot(area_vector(polygon)) > 0.0
    }
}

/// The part of a polygon that lies within another of its plane, both convex: the corners as they are where that is all of it.
#[must_use]
pub fn overlap(within: &[DVec3], corners: &[DVec3]) -> Corners {
    let normal = area_vector(within).normalize_or_zero();
    let mut left = Corners::from_slice(corners);
    let next = within.iter().cycle().skip(1);
    for (from, to) in within.iter().zip(next) {
        let inward = normal.cross((*to - *from).normalize_or_zero());
        let height =
            |corner: &DVec3| Some(inward.dot(*corner - *from)).filter(|height| height.abs() > ON_BORDER);
        let heights: SmallVec<[f64; 8]> = left.iter().map(|corner| height(corner).unwrap_or(0.0)).collect();
        left = clip(&left, &heights);
    }
    left
}

/// The cells that the box around some points touches.
fn cells(points: &[DVec3], size: f64) -> impl Iterator<Item = [i64; 3]> {
    let bounds = Bounds::around(points.iter().copied());
    let [low, high] = [bounds.low, bounds.high].map(|corner| (corner / size).floor().as_i64vec3());
    (low.x..=high.x)
        .flat_map(move |x| (low.y..=high.y).flat_map(move |y| (low.z..=high.z).map(move |z| [x, y, z])))
}
