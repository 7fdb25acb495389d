//! Which facets of the scene lie in one plane.
//!
//! Polygons of one plane neither see nor block each other, so what is coplanar but for rounding must get one number, also
//! across surfaces: tiles of a floor, a rug on it, both sides of a sheet.

use std::collections::HashMap;
use std::ops::RangeInclusive;

use foldhash::fast::RandomState;
use glam::DVec3;
use rayon::prelude::*;
use shared::geometry::{PlaneId, area_vector};
use smallvec::SmallVec;

use crate::scene::{Facet, Surface};

/// Distance from a plane, frame units, within which corners lie in it: a millionth of the scene.
const OFFSET_TOLERANCE: f64 = 1e-3;

/// Difference of unit normals within which planes are one.
const NORMAL_TOLERANCE: f64 = 1e-6;

/// Most that a facet's normal may be doubted because its corners were rounded. Small facets whose normals are less certain
/// rather get planes of their own.
const MOST_NORMAL_DOUBT: f64 = 2e-5;

/// How many roundings a point may be off.
const ROUNDINGS: f64 = 4.0;

/// Most that rounding may add to the distance within which planes are one, frame units: a ten-thousandth of the scene. A scene far
/// from the origin may have been rounded by more, but what was meant to be apart must stay so.
const MOST_OFFSET_DOUBT: f64 = 0.1;

/// Cells of the search grid: several times what is searched for, so that mostly one cell has to be looked at.
const NORMAL_CELL: f64 = 1.0 / 8192.0;
const OFFSET_CELL: f64 = 0.125;

/// Gives every facet its plane and returns the number of planes. `rounding`: how far the rounding of the
/// file may have moved a point, frame units.
pub(super) fn assign(surfaces: &mut [Surface], rounding: f64) -> u32 {
    let mut facets: Vec<&mut Facet> = surfaces.iter_mut().flat_map(|surface| &mut surface.facets).collect();
    let thickness: Vec<f64> = facets.par_iter().map(|facet| least_height(facet)).collect();
    let mut order: Vec<usize> = (0..facets.len()).collect();
    // The facets with the surest normals define the planes.
    order.par_sort_by(|&a, &b| thickness[b].total_cmp(&thickness[a]).then(a.cmp(&b)));
    let mut planes = Planes::new(ROUNDINGS * rounding);
    for index in order {
        let doubt = (NORMAL_TOLERANCE + ROUNDINGS * rounding / thickness[index]).min(MOST_NORMAL_DOUBT);
        facets[index].plane = planes.find_or_add(facets[index], doubt);
    }
    planes.planes.len() as u32
}

/// Area over diameter: about the least height of the facet.
fn least_height(facet: &Facet) -> f64 {
    let corners: SmallVec<[DVec3; 4]> = facet.corners.iter().map(|corner| corner.position).collect();
    let diameter = corners.iter().map(|corner| corner.distance(corners[0])).fold(f64::MIN_POSITIVE, f64::max);
    area_vector(&corners).length() / diameter
}

struct Plane {
    normal: DVec3,
    /// Distance from the origin along the normal.
    offset: f64,
}

/// Planes by cells of a grid over normal and offset.
struct Planes {
    planes: Vec<Plane>,
    cells: HashMap<[i32; 4], SmallVec<[u32; 2]>, RandomState>,
    offset_tolerance: f64,
    offset_cell: f64,
}

impl Planes {
    fn new(rounding: f64) -> Self {
        let offset_tolerance = OFFSET_TOLERANCE + rounding.min(MOST_OFFSET_DOUBT);
        let offset_cell = OFFSET_CELL.max(4.0 * offset_tolerance);
        Self { planes: Vec::new(), cells: HashMap::default(), offset_tolerance, offset_cell }
    }

    fn find_or_add(&mut self, facet: &Facet, doubt: f64) -> PlaneId {
        let centre =
            facet.corners.iter().map(|corner| corner.position).sum::<DVec3>() / facet.corners.len() as f64;
        let offset = facet.normal.dot(centre);
        let reach = facet.corners.iter().map(|corner| corner.position.length()).fold(0.0, f64::max);
        let offset_doubt = self.offset_tolerance + doubt * reach;
        let found = [1.0, -1.0].into_iter().filter_map(|sign| {
            self.find(
                facet,
                Plane { normal: sign * facet.normal, offset: sign * offset },
                doubt,
                offset_doubt,
            )
        });
        if let Some(id) = found.min() {
            return PlaneId(id);
        }
        let id = self.planes.len() as u32;
        let normal_cell = facet.normal.to_array().map(|axis| cell(axis, NORMAL_CELL));
        let key = [normal_cell[0], normal_cell[1], normal_cell[2], cell(offset, self.offset_cell)];
        self.cells.entry(key).or_default().push(id);
        self.planes.push(Plane { normal: facet.normal, offset });
        PlaneId(id)
    }

    /// The first plane that faces like `like` and holds the facet.
    fn find(&self, facet: &Facet, like: Plane, doubt: f64, offset_doubt: f64) -> Option<u32> {
        let [x, y, z] = like.normal.to_array().map(|axis| cells(axis, doubt, NORMAL_CELL));
        let offsets = cells(like.offset, offset_doubt, self.offset_cell);
        let keys = x.flat_map(|x| {
            let (z, offsets) = (z.clone(), offsets.clone());
            y.clone().flat_map(move |y| {
                let offsets = offsets.clone();
                z.clone().flat_map(move |z| offsets.clone().map(move |offset| [x, y, z, offset]))
            })
        });
        let holds = |id: &u32| {
            let plane = &self.planes[*id as usize];
            plane.normal.distance(like.normal) <= doubt
                && facet.corners.iter().all(|corner| {
                    (plane.normal.dot(corner.position) - plane.offset).abs() <= self.offset_tolerance
                })
        };
        keys.filter_map(|key| self.cells.get(&key)).flatten().copied().filter(holds).min()
    }
}

/// Zero lies in the middle of a cell, so that the planes of boxes do not lie between two.
fn cell(value: f64, size: f64) -> i32 {
    (value / size + 0.5).floor() as i32
}

fn cells(value: f64, doubt: f64, size: f64) -> RangeInclusive<i32> {
    cell(value - doubt, size)..=cell(value + doubt, size)
}
