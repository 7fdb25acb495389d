//! An order of the vertices in which neighbours in space follow each other.
//!
//! Rows are computed and kept for groups of consecutive receivers: the closer together these lie, the more often a whole group is
//! hidden or turned away, and costs next to nothing.

use foldhash::HashMap;

use glam::DVec3;
use rayon::prelude::*;

use super::{Edge, Mesh, PatchId, VertexId, edge};
use scene::{Facet, Scene};

/// Bits of a place along each axis.
const BITS: u32 = 21;

/// The frame reaches half as far.
const REACH: f64 = 2048.0;

/// Sorts by facet, since what lies in one plane faces one way, then by place in it; both along the Morton curve. The last two
/// break ties.
type Key = (u64, u32, u32, u64, u32);

/// Place of each facet along the curve, by surface.
#[derive(Debug, Clone, Default)]
pub struct FacetPlaces(Vec<Vec<u64>>);

impl FacetPlaces {
    /// Finds the place of each facet of a scene.
    pub fn new(scene: &Scene) -> Self {
        let place = |facet: &Facet| {
            let sum: DVec3 = facet.positions().sum();
            along_curve(sum / facet.corners.len() as f64)
        };
        Self(scene.surfaces.iter().map(|surface| surface.facets.par_iter().map(place).collect()).collect())
    }
}

impl Mesh {
    /// Sorts patches so that neighbours in space follow each other.
    pub fn sort_by_place(&self, patches: &mut [PatchId]) {
        patches.sort_by_cached_key(|id| self.key(*id, self.centre(*id), id.0));
    }

    fn key(&self, id: PatchId, position: DVec3, last: u32) -> Key {
        let (surface, facet) = (self.patch(id).surface, self.patch(id).facet);
        (self.facet_places.0[surface as usize][facet as usize], surface, facet, along_curve(position), last)
    }

    /// Renumbers the vertices so that neighbours in space follow each other.
    pub(super) fn order_vertices(&mut self) {
        let mut patch_of: Vec<Option<PatchId>> = vec![None; self.vertices.len()];
        for (id, patch) in self.leaves() {
            for corner in &patch.corners {
                patch_of[corner.index()].get_or_insert(id);
            }
        }
        let mut order: Vec<u32> = (0..self.vertices.len() as u32).collect();
        order.par_sort_by_cached_key(|vertex| {
            let position = self.vertices[*vertex as usize].position;
            patch_of[*vertex as usize].map(|id| self.key(id, position, *vertex))
        });
        let mut renamed = vec![VertexId(0); order.len()];
        for (new, old) in (0..).map(VertexId).zip(&order) {
            renamed[*old as usize] = new;
        }
        let vertex = |old: VertexId| renamed[old.index()];
        let whole = |(a, b): Edge| edge(vertex(a), vertex(b));
        self.vertices = order.iter().map(|old| self.vertices[*old as usize]).collect();
        for patch in &mut self.patches {
            patch.corners.iter_mut().for_each(|corner| *corner = vertex(*corner));
        }
        self.midpoints = renamed_edges(&mut self.midpoints, whole, vertex);
        self.halves = renamed_edges(&mut self.halves, whole, whole);
        self.leaves_at = None;
    }
}

fn renamed_edges<T>(
    edges: &mut HashMap<Edge, T>,
    rename: impl Fn(Edge) -> Edge,
    rename_value: impl Fn(T) -> T,
) -> HashMap<Edge, T> {
    edges.drain().map(|(edge, value)| (rename(edge), rename_value(value))).collect()
}

/// Morton code of a point: the interleaved bits of its coordinates.
pub fn along_curve(point: DVec3) -> u64 {
    let cells = f64::from(1 << BITS);
    let cell = ((point / (2.0 * REACH) + 0.5) * cells).clamp(DVec3::ZERO, DVec3::splat(cells - 1.0));
    let [x, y, z] = cell.to_array().map(|coordinate| coordinate as u64);
    (0..BITS).fold(0, |curve, bit| {
        let bits = (x >> bit & 1) | (y >> bit & 1) << 1 | (z >> bit & 1) << 2;
        curve | bits << (3 * bit)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_goes_through_one_octant_after_the_other() {
        let octant = |x: f64, y: f64, z: f64| along_curve(DVec3::new(x, y, z)) >> (3 * (BITS - 1));
        assert_eq!(octant(-1.0, -1.0, -1.0), 0);
        assert_eq!(octant(1.0, -1.0, -1.0), 1);
        assert_eq!(octant(-1.0, 1.0, -1.0), 2);
        assert_eq!(octant(1.0, 1.0, 1.0), 7);
        assert!(along_curve(DVec3::splat(1e9)) < 1 << 63);
        assert_eq!(along_curve(DVec3::splat(-1e9)), 0);
    }
}
