//! Leaves that shoot together: what is small against the shooting patches is joined with its neighbours, so that their number
//! follows the error asked and not the number of triangles.

use foldhash::{HashMap, HashMapExt};

use glam::DVec3;
use kernel::geometry::PlaneId;

use super::{Mesh, PatchId, Share};
use crate::disjoint_sets::DisjointSets;

/// Most shares, unless the leaves that are too large to be joined are more.
const MOST_SHARES: usize = 20_000;

/// Leaves wider than this part of a cell are shares of their own.
const WIDE: f64 = 0.5;

/// Growth of the cells where there are too many shares.
const GROWTH: f64 = 1.5;

/// Cells do not grow any more than this many times.
const MOST_GROWTHS: u32 = 32;

/// Where a leaf lies: the surface, the direction that it faces most, and the cell.
type Key = (u32, u8, [i64; 3]);

impl Mesh {
    /// Leaves as shares, in the order of their first leaves. Small neighbours in a cell of this size that face about the same way
    /// are one share. Where these are too many, so are leaves of a cell that do not touch, and the cells grow.
    #[must_use]
    pub fn clustered_shares(&self, size: f64, plane_of: impl Fn(u32, u32) -> PlaneId) -> Vec<Share> {
        let leaves: Vec<PatchId> = self.leaves().map(|(id, _)| id).collect();
        let mut groups = self.touching(&leaves, size);
        let mut size = size;
        for _ in 0..MOST_GROWTHS {
            if groups.iter().max().map_or(0, |last| last + 1) <= MOST_SHARES {
                break;
            }
            groups = self.in_cells(&leaves, size);
            size *= GROWTH;
        }
        let mut shares: Vec<Share> = vec![];
        for (id, group) in leaves.into_iter().zip(groups) {
            let patch = self.patch(id);
            if group == shares.len() {
                shares.push(Share {
                    vertex: patch.corners[0],
                    surface: patch.surface,
                    polygons: vec![],
                    corners: vec![],
                    area: 0.0,
                });
            }
            let share = &mut shares[group];
            share.polygons.push(self.polygon(id, plane_of(patch.surface, patch.facet)));
            share.corners.extend((0..patch.corners.len()).map(|corner| (id, corner)));
            share.area += patch.area;
        }
        shares
    }

    /// The cell of a leaf; none where it is too wide.
    fn cluster_key(&self, id: PatchId, size: f64) -> Option<Key> {
        let patch = self.patch(id);
        let normal: DVec3 = patch.corners.iter().map(|corner| self.vertices[corner.index()].normal).sum();
        let axis = normal.abs().max_position();
        let side = axis as u8 * 2 + u8::from(normal[axis] < 0.0);
        let cell = (self.centre(id) / size).floor().as_i64vec3().to_array();
        (self.size(id) < WIDE * size).then_some((patch.surface, side, cell))
    }

    /// Group of each leaf: those with a common corner and key are one. Numbered in order.
    fn touching(&self, leaves: &[PatchId], size: f64) -> Vec<usize> {
        let mut joined = DisjointSets::new(leaves.len());
        let mut first_at: HashMap<(Key, [u64; 3]), usize> = HashMap::new();
        for (leaf, id) in leaves.iter().enumerate() {
            let Some(key) = self.cluster_key(*id, size) else { continue };
            for corner in &self.patch(*id).corners {
                let place = self.position(*corner).to_array().map(f64::to_bits);
                let other = *first_at.entry((key, place)).or_insert(leaf);
                joined.join(leaf, other);
            }
        }
        numbered((0..leaves.len()).map(|leaf| joined.representative(leaf)))
    }

    /// Group of each leaf: all of a cell and direction are one. Numbered in order.
    fn in_cells(&self, leaves: &[PatchId], size: f64) -> Vec<usize> {
        let mut first_in: HashMap<(u8, [i64; 3]), usize> = HashMap::new();
        let representative = leaves.iter().enumerate().map(|(leaf, id)| match self.cluster_key(*id, size) {
            Some((_, side, cell)) => *first_in.entry((side, cell)).or_insert(leaf),
            None => leaf,
        });
        numbered(representative)
    }
}

/// Numbers groups, given by one of their items, in the order in which they are met.
fn numbered(representatives: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut numbers = HashMap::new();
    let number = |representative| {
        let next = numbers.len();
        *numbers.entry(representative).or_insert(next)
    };
    representatives.map(number).collect()
}
