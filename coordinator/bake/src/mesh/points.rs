//! Corners of facets and pieces as points: a position and a smoothing group.

use std::hash::BuildHasher;

use foldhash::fast::FixedState;
use foldhash::{HashMap, HashSet};
use glam::{DVec3, IVec3};
use kernel::geometry::PlaneId;
use rayon::prelude::*;

use super::{Vertex, WELD};
use scene::{Corner, Facet};

/// Distinguishes the two directions of a plane. Perpendicular to no likely normal, so that rounding does not decide.
const NO_COMMON_NORMAL: DVec3 = DVec3::new(0.537_7, 0.651_3, 0.535_4);

/// Parts in which points are found, side by side; smoothing groups are dealt out to them, since corners of several are never one.
const PARTS: u8 = 16;

/// Which corners at one position have the same normal: those of one plane and direction, or of one smooth normal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum SmoothingGroup {
    Flat(PlaneId, bool),
    Smooth([i32; 3]),
}

/// Index of a point. A vertex is a point, or a part of one where a contact divides the surface around it.
pub type PointId = u32;

/// A corner that is to become a point, of a piece of a facet or of the facet itself.
#[derive(Debug, Clone, Copy)]
pub struct UnweldedCorner<'a> {
    corner: Corner,
    facet: &'a Facet,
    part: u8,
}

impl<'a> UnweldedCorner<'a> {
    pub fn new(corner: Corner, facet: &'a Facet) -> Self {
        let part = FixedState::default().hash_one(group(&corner, facet)) % u64::from(PARTS);
        Self { corner, facet, part: part as u8 }
    }

    fn vertex(&self) -> Vertex {
        let Corner { position, normal } = self.corner;
        let smooth = normal != self.facet.normal;
        Vertex { position, normal, plane: self.facet.plane, smooth, hovering: None }
    }
}

fn group(corner: &Corner, facet: &Facet) -> SmoothingGroup {
    if corner.normal == facet.normal {
        SmoothingGroup::Flat(facet.plane, facet.normal.dot(NO_COMMON_NORMAL) > 0.0)
    } else {
        SmoothingGroup::Smooth((corner.normal * 1e6).round().as_ivec3().to_array())
    }
}

/// The points of all corners, in the order of the first of each.
pub struct Points {
    /// Each point as a vertex.
    pub vertices: Vec<Vertex>,
    /// The group of each.
    pub groups: Vec<SmoothingGroup>,
    /// The points of each plane.
    pub flat: Vec<(SmoothingGroup, Vec<PointId>)>,
    /// The point of each corner.
    pub of_corners: Vec<PointId>,
}

impl Points {
    /// Welds corners that are the same point.
    #[must_use]
    pub fn new(corners: &[UnweldedCorner]) -> Self {
        let mut of_parts = vec![vec![]; usize::from(PARTS)];
        for (index, corner) in (0..).zip(corners) {
            of_parts[usize::from(corner.part)].push(index);
        }
        let parts: Vec<PartOfPoints> =
            of_parts.par_iter().map(|own| PartOfPoints::new(corners, own)).collect();
        let mut first_of = vec![0; corners.len()];
        for (corner, first) in parts.iter().flat_map(|part| &part.first_of) {
            first_of[*corner as usize] = *first;
        }
        let mut number = vec![0; corners.len()];
        let mut firsts: Vec<&UnweldedCorner> = vec![];
        for (index, corner) in corners.iter().enumerate() {
            if first_of[index] == index as u32 {
                number[index] = firsts.len() as PointId;
                firsts.push(corner);
            }
        }
        let numbered = |first: u32| number[first as usize];
        let flat = parts.into_par_iter().flat_map_iter(|part| {
            part.flat.into_iter().map(|(group, firsts)| (group, firsts.into_iter().map(numbered).collect()))
        });
        Self {
            vertices: firsts.par_iter().map(|first| first.vertex()).collect(),
            groups: firsts.par_iter().map(|first| group(&first.corner, first.facet)).collect(),
            flat: flat.collect(),
            of_corners: first_of.into_par_iter().map(numbered).collect(),
        }
    }
}

/// The points of some groups, each known by its first corner.
#[derive(Default)]
struct PartOfPoints {
    /// Pairs of a corner and the first corner of its point.
    first_of: Vec<(u32, u32)>,
    found: HashMap<(IVec3, SmoothingGroup), u32>,
    /// Cells that have a point of any group: far fewer than there are points.
    cells: HashSet<IVec3>,
    flat: HashMap<SmoothingGroup, Vec<u32>>,
}

impl PartOfPoints {
    fn new(corners: &[UnweldedCorner], own: &[u32]) -> Self {
        let mut all = Self { first_of: Vec::with_capacity(own.len()), ..Self::default() };
        for index in own.iter().copied() {
            let UnweldedCorner { corner, facet, .. } = &corners[index as usize];
            let group = group(corner, facet);
            let cell = (corner.position / WELD).round().as_ivec3();
            let here = (cell, group);
            let known = all.found.get(&here).copied().or_else(|| all.near(corners, corner.position, here));
            let first = known.unwrap_or_else(|| {
                if let SmoothingGroup::Flat(..) = group {
                    all.flat.entry(group).or_default().push(index);
                }
                all.found.insert(here, index);
                all.cells.insert(cell);
                index
            });
            all.first_of.push((index, first));
        }
        all
    }

    /// A point closer than half the welding distance in a cell beside: rounding may have put the two on either side of a border.
    fn near(
        &self,
        corners: &[UnweldedCorner],
        position: DVec3,
        (cell, group): (IVec3, SmoothingGroup),
    ) -> Option<u32> {
        // The nearer neighbour on each axis: what is half the distance away lies there.
        let offset = position / WELD - cell.as_dvec3();
        let steps = [0, 1, 2].map(|axis| [0, if offset[axis] < 0.0 { -1 } else { 1 }]);
        let beside = steps[0].into_iter().flat_map(|x| {
            steps[1].into_iter().flat_map(move |y| steps[2].into_iter().map(move |z| IVec3::new(x, y, z)))
        });
        beside
            .filter(|step| self.cells.contains(&(cell + step)))
            .filter_map(|step| self.found.get(&(cell + step, group)).copied())
            .find(|first| corners[*first as usize].corner.position.distance(position) < WELD / 2.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::facet;

    /// Corners of several planes and normals, some a hair apart on either side of a cell's border, against one after the other.
    #[test]
    fn points_are_those_of_corners_taken_one_by_one() {
        let facets: Vec<Facet> =
            (0..40).map(|plane| facet(plane, &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])).collect();
        let corner = |index: usize| {
            let facet = &facets[index * 7 % 40];
            let hair = WELD * [0.0, 0.3, -0.3, 0.45, 5.0][index % 5];
            let position = DVec3::new(WELD * (index % 11) as f64 * 4.5 + hair, 1.0, 2.0);
            let tilted = DVec3::new(0.6, 0.0, 0.8);
            UnweldedCorner::new(
                Corner { position, normal: if index.is_multiple_of(3) { tilted } else { facet.normal } },
                facet,
            )
        };
        let corners: Vec<UnweldedCorner> = (0..4000).map(corner).collect();
        let points = Points::new(&corners);
        let all = PartOfPoints::new(&corners, &(0..corners.len() as u32).collect::<Vec<_>>());
        let mut firsts: Vec<u32> = vec![];
        for (index, first) in all.first_of {
            if first == index {
                firsts.push(index);
            }
            let point = firsts.iter().position(|known| *known == first).unwrap();
            assert_eq!(points.of_corners[index as usize], point as u32);
            let (at, own) = (&points.vertices[point], &corners[index as usize].corner);
            assert_eq!(at.position, corners[first as usize].corner.position);
            assert!(at.position.distance(own.position) < 2.0 * WELD && at.normal == own.normal);
        }
        assert_eq!(points.vertices.len(), firsts.len());
        assert!(firsts.len() > 100 && firsts.len() < 3000, "{}", firsts.len());
        let flat: usize = points.flat.iter().map(|(_, ids)| ids.len()).sum();
        assert_eq!(flat, points.vertices.iter().filter(|vertex| !vertex.smooth).count());
    }
}
