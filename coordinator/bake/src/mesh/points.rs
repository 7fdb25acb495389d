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

/// Parts in which points are found, side by side; smoothing groups are dealt out to them.
const PARTS: u8 = 16;

/// Which corners at one position have the same normal: those of one plane and direction, or of one smooth normal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum SmoothingGroup {
    Flat(PlaneId, bool),
    Smooth([i32; 3]),
}

/// Index of a point. A vertex is a point, or a part of one where a contact divides the surface around it.
pub type PointId = u32;

/// A corner that is to become a point.
#[derive(Debug, Clone, Copy)]
pub struct Spot {
    position: DVec3,
    normal: DVec3,
    plane: PlaneId,
    group: SmoothingGroup,
    cell: IVec3,
    part: u8,
}

impl Spot {
    /// The corner of a piece of a facet, or of the facet itself.
    pub fn new(corner: &Corner, facet: &Facet) -> Self {
        let Corner { position, normal } = *corner;
        let group = if normal == facet.normal {
            SmoothingGroup::Flat(facet.plane, facet.normal.dot(NO_COMMON_NORMAL) > 0.0)
        } else {
            SmoothingGroup::Smooth((normal * 1e6).round().as_ivec3().to_array())
        };
        let cell = (position / WELD).round().as_ivec3();
        let part = (FixedState::default().hash_one(group) % u64::from(PARTS)) as u8;
        Self { position, normal, plane: facet.plane, group, cell, part }
    }
}

/// The points of all spots, in the order of the first of each.
pub struct Points {
    /// Each point as a vertex.
    pub vertices: Vec<Vertex>,
    /// The group of each.
    pub groups: Vec<SmoothingGroup>,
    /// The points of each plane.
    pub flat: Vec<(SmoothingGroup, Vec<PointId>)>,
    /// The point of each spot.
    pub of_spots: Vec<PointId>,
}

impl Points {
    /// Welds spots that are the same point.
    #[must_use]
    pub fn new(spots: &[Spot]) -> Self {
        let mut of_parts = vec![vec![]; usize::from(PARTS)];
        for (index, spot) in (0..).zip(spots) {
            of_parts[usize::from(spot.part)].push(index);
        }
        let parts: Vec<PartOfPoints> = of_parts.par_iter().map(|own| PartOfPoints::new(spots, own)).collect();
        let mut first_of = vec![0; spots.len()];
        for (spot, first) in parts.iter().flat_map(|part| &part.first_of) {
            first_of[*spot as usize] = *first;
        }
        let mut number = vec![0; spots.len()];
        let mut firsts: Vec<&Spot> = vec![];
        for (index, spot) in spots.iter().enumerate() {
            if first_of[index] == index as u32 {
                number[index] = firsts.len() as PointId;
                firsts.push(spot);
            }
        }
        let vertex = |spot: &&Spot| Vertex {
            position: spot.position,
            normal: spot.normal,
            plane: spot.plane,
            smooth: matches!(spot.group, SmoothingGroup::Smooth(_)),
            hovering: None,
        };
        let numbered = |first: u32| number[first as usize];
        let flat = parts.into_par_iter().flat_map_iter(|part| {
            part.flat.into_iter().map(|(group, firsts)| (group, firsts.into_iter().map(numbered).collect()))
        });
        Self {
            vertices: firsts.par_iter().map(vertex).collect(),
            groups: firsts.par_iter().map(|spot| spot.group).collect(),
            flat: flat.collect(),
            of_spots: first_of.into_par_iter().map(numbered).collect(),
        }
    }
}

/// The points of some groups, each known by its first spot.
#[derive(Default)]
struct PartOfPoints {
    /// Pairs of a spot and the first spot of its point.
    first_of: Vec<(u32, u32)>,
    found: HashMap<(IVec3, SmoothingGroup), u32>,
    /// Cells that have a point of any group: far fewer than there are points.
    cells: HashSet<IVec3>,
    flat: HashMap<SmoothingGroup, Vec<u32>>,
}

impl PartOfPoints {
    fn new(spots: &[Spot], own: &[u32]) -> Self {
        let mut all = Self { first_of: Vec::with_capacity(own.len()), ..Self::default() };
        for (index, spot) in own.iter().map(|index| (*index, &spots[*index as usize])) {
            let here = (spot.cell, spot.group);
            let known = all.found.get(&here).copied().or_else(|| all.near(spots, spot));
            let first = known.unwrap_or_else(|| {
                if let SmoothingGroup::Flat(..) = spot.group {
                    all.flat.entry(spot.group).or_default().push(index);
                }
                all.found.insert(here, index);
                all.cells.insert(spot.cell);
                index
            });
            all.first_of.push((index, first));
        }
        all
    }

    /// A point closer than half the welding distance in a cell beside: rounding may have put the two on either side of a border.
    fn near(&self, spots: &[Spot], spot: &Spot) -> Option<u32> {
        let Spot { position, cell, group, .. } = *spot;
        // The nearer neighbour on each axis: what is half the distance away lies there.
        let offset = position / WELD - cell.as_dvec3();
        let steps = [0, 1, 2].map(|axis| [0, if offset[axis] < 0.0 { -1 } else { 1 }]);
        let beside = steps[0].into_iter().flat_map(|x| {
            steps[1].into_iter().flat_map(move |y| steps[2].into_iter().map(move |z| IVec3::new(x, y, z)))
        });
        beside
            .filter(|step| self.cells.contains(&(cell + step)))
            .filter_map(|step| self.found.get(&(cell + step, group)).copied())
            .find(|first| spots[*first as usize].position.distance(position) < WELD / 2.0)
    }
}
