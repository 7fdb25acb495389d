//! Planes of facets.
//!
//! Polygons of one plane neither see nor block each other, so facets that are coplanar up to rounding must get one number,
//! also across surfaces: tiles of a floor, a rug on it, both sides of a sheet.

use std::collections::HashMap;
use std::hash::BuildHasher;
use std::ops::RangeInclusive;
use std::sync::atomic::{AtomicU8, Ordering};

use foldhash::fast::{FixedState, RandomState};
use glam::DVec3;
use kernel::geometry::{PlaneId, area_vector};
use rayon::prelude::*;
use smallvec::SmallVec;

use crate::facet::{Corner, Facet};
use crate::light::{AreaLight, Light};
use crate::model::Surface;

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

/// Gives every facet and every flat light its plane and returns the number of planes. `rounding`: how far the rounding of the
/// file may have moved a point, frame units.
pub(super) fn assign(surfaces: &mut [Surface], lights: &mut [Light], rounding: f64) -> u32 {
    let mut flat: Vec<&mut AreaLight> = lights.iter_mut().filter_map(|light| light.kind.flat_mut()).collect();
    let mut of_lights: Vec<Facet> = flat.iter().map(|light| facet(light)).collect();
    let facets = surfaces.iter_mut().flat_map(|surface| &mut surface.facets);
    let count = assign_facets(facets.chain(&mut of_lights).collect(), rounding);
    flat.iter_mut().zip(of_lights).for_each(|(light, facet)| light.plane = facet.plane);
    count
}

/// Distance from a plane, frame units, within which corners lie in it.
pub(super) fn tolerance(rounding: f64) -> f64 {
    OFFSET_TOLERANCE + (ROUNDINGS * rounding).min(MOST_OFFSET_DOUBT)
}

/// A flat light as a facet: in the plane of a ceiling it is neither blocked by the ceiling nor does it light it.
fn facet(light: &AreaLight) -> Facet {
    let (plane, normal) = (light.plane, light.normal());
    let corners = light.polygon().corners.into_iter().map(|position| Corner { position, normal });
    Facet { plane, normal, corners: corners.collect(), triangles: vec![], is_sealed: false }
}

fn assign_facets(mut facets: Vec<&mut Facet>, rounding: f64) -> u32 {
    let mut planes = Planes::new(tolerance(rounding));
    let doubt = |thickness: f64| (NORMAL_TOLERANCE + ROUNDINGS * rounding / thickness).min(MOST_NORMAL_DOUBT);
    // The facets with the surest normals define the planes.
    let mut order: Vec<(f64, u32)> =
        facets.par_iter().enumerate().map(|(index, facet)| (least_height(facet), index as u32)).collect();
    let company = Company::new(facets.len());
    facets.par_iter().for_each(|facet| company.announce(planes.home(facet)));
    let has_company: Vec<bool> = (&order, &facets)
        .into_par_iter()
        .map(|((thickness, _), facet)| {
            company.find(planes.home(facet), planes.reach(facet, doubt(*thickness)))
        })
        .collect();
    let is_wanted: Vec<bool> = facets.par_iter().map(|facet| company.is_wanted(planes.home(facet))).collect();
    order.par_sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut ids = vec![PlaneId(0); facets.len()];
    for (thickness, index) in order {
        let index = index as usize;
        let found = has_company[index].then(|| planes.find(facets[index], doubt(thickness))).flatten();
        ids[index] = found.unwrap_or_else(|| planes.add(facets[index], is_wanted[index]));
    }
    facets.par_iter_mut().zip(ids).for_each(|(facet, id)| facet.plane = id);
    planes.count
}

/// Area over diameter: about the least height of the facet.
fn least_height(facet: &Facet) -> f64 {
    let corners: SmallVec<[DVec3; 4]> = facet.positions().collect();
    let diameter = corners.iter().map(|corner| corner.distance(corners[0])).fold(f64::MIN_POSITIVE, f64::max);
    area_vector(&corners).length() / diameter
}

struct Plane {
    id: PlaneId,
    normal: DVec3,
    /// Distance from the origin along the normal.
    offset: f64,
}

/// A cell of the grid over normal and offset.
type Cell = [i32; 4];

/// Planes by cells of a grid over normal and offset.
struct Planes {
    count: u32,
    /// Those that another facet may lie in, by their number.
    planes: Vec<Plane>,
    cells: HashMap<Cell, SmallVec<[u32; 2]>, RandomState>,
    offset_tolerance: f64,
    offset_cell: f64,
}

impl Planes {
    fn new(offset_tolerance: f64) -> Self {
        let offset_cell = OFFSET_CELL.max(4.0 * offset_tolerance);
        Self { count: 0, planes: Vec::new(), cells: HashMap::default(), offset_tolerance, offset_cell }
    }

    /// The cell of a facet's own plane.
    fn home(&self, facet: &Facet) -> Cell {
        let [x, y, z] = facet.normal.to_array().map(|axis| cell(axis, NORMAL_CELL));
        [x, y, z, cell(offset(facet), self.offset_cell)]
    }

    /// The cells of the planes that may hold a facet, facing as it does or the other way.
    fn reach(&self, facet: &Facet, doubt: f64) -> impl Iterator<Item = Cell> + use<> {
        let (normal, offset, offset_cell) = (facet.normal, offset(facet), self.offset_cell);
        let farthest = facet.positions().map(DVec3::length).fold(0.0, f64::max);
        let offset_doubt = self.offset_tolerance + doubt * farthest;
        [1.0, -1.0].into_iter().flat_map(move |sign| {
            let [x, y, z] = (sign * normal).to_array().map(|axis| cells(axis, doubt, NORMAL_CELL));
            let offsets = cells(sign * offset, offset_doubt, offset_cell);
            x.flat_map(move |x| {
                let (z, offsets) = (z.clone(), offsets.clone());
                y.clone().flat_map(move |y| {
                    let offsets = offsets.clone();
                    z.clone().flat_map(move |z| offsets.clone().map(move |offset| [x, y, z, offset]))
                })
            })
        })
    }

    /// The first plane that holds the facet.
    fn find(&self, facet: &Facet, doubt: f64) -> Option<PlaneId> {
        let holds = |plane: &&Plane| {
            let apart = plane.normal.distance(facet.normal).min(plane.normal.distance(-facet.normal));
            apart <= doubt
                && facet.corners.iter().all(|corner| {
                    (plane.normal.dot(corner.position) - plane.offset).abs() <= self.offset_tolerance
                })
        };
        let known = self.reach(facet, doubt).filter_map(|cell| self.cells.get(&cell)).flatten();
        known.map(|index| &self.planes[*index as usize]).filter(holds).map(|plane| plane.id).min()
    }

    /// A facet's own plane, to be found by others if `is_wanted`.
    fn add(&mut self, facet: &Facet, is_wanted: bool) -> PlaneId {
        let id = PlaneId(self.count);
        self.count += 1;
        if is_wanted {
            self.cells.entry(self.home(facet)).or_default().push(self.planes.len() as u32);
            self.planes.push(Plane { id, normal: facet.normal, offset: offset(facet) });
        }
        id
    }
}

/// Distance of a facet's plane from the origin, along its normal.
fn offset(facet: &Facet) -> f64 {
    let sum: DVec3 = facet.positions().sum();
    facet.normal.dot(sum / facet.corners.len() as f64)
}

/// Tells in parallel which facets have a plane to themselves, as most of a curved surface do: these need no search, which goes one after
/// the other. Cells share places of a table; where two meet by chance, a search finds nothing.
struct Company {
    places: Vec<AtomicU8>,
    hasher: FixedState,
}

/// A facet is at home here.
const HOME: u8 = 1;
/// More than one is.
const SHARED: u8 = 2;
/// A facet may lie in the plane of another that is at home here.
const WANTED: u8 = 4;

impl Company {
    fn new(facets: usize) -> Self {
        let count = (4 * facets).next_power_of_two();
        Self { places: (0..count).map(|_| AtomicU8::new(0)).collect(), hasher: FixedState::default() }
    }

    fn place(&self, cell: Cell) -> &AtomicU8 {
        &self.places[self.hasher.hash_one(cell) as usize & (self.places.len() - 1)]
    }

    fn announce(&self, home: Cell) {
        let place = self.place(home);
        if place.fetch_or(HOME, Ordering::Relaxed) & HOME != 0 {
            place.fetch_or(SHARED, Ordering::Relaxed);
        }
    }

    /// Whether another facet is at home within reach; all have been announced.
    fn find(&self, home: Cell, reach: impl Iterator<Item = Cell>) -> bool {
        let own = self.place(home);
        let mut found = false;
        for cell in reach {
            let place = self.place(cell);
            let others = if std::ptr::eq(place, own) { SHARED } else { HOME };
            if place.load(Ordering::Relaxed) & others != 0 {
                place.fetch_or(WANTED, Ordering::Relaxed);
                found = true;
            }
        }
        found
    }

    /// Whether another facet may lie in the plane of one that is at home here; all have looked.
    fn is_wanted(&self, home: Cell) -> bool {
        self.place(home).load(Ordering::Relaxed) & WANTED != 0
    }
}

/// Zero lies in the middle of a cell, so that the planes of boxes do not lie between two.
fn cell(value: f64, size: f64) -> i32 {
    (value / size + 0.5).floor() as i32
}

fn cells(value: f64, doubt: f64, size: f64) -> RangeInclusive<i32> {
    cell(value - doubt, size)..=cell(value + doubt, size)
}
