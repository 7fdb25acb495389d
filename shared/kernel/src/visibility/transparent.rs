//! Transparent occluders: what they leave of a form factor.
//!
//! Opaque occluders are cut out of a polygon exactly; of the rest, transparent ones take a part that differs from ray to ray. It is
//! sampled as a ratio of two sums over the same rays: exact where all of the polygon is seen through the same occluders.

use std::collections::BTreeMap;

use glam::DVec3;
use sobol_burley::sample_4d;

use super::ratio::RayRatio;
use crate::form_factor::{PreparedPolygon, kernel};
use crate::geometry::{Bounds, ConvexPolygon, PlaneId, uniform_point};
use crate::hemisphere::SeenPolygons;
use crate::occluder::{Blocking, Occluder};
use crate::replica::Receiver;

/// Rays that find out whether all of a polygon is seen through the same occluders.
const PROBE_RAYS: u32 = 16;

/// Rays from a receiver to a polygon of which the occluders take different parts.
const RAYS: u32 = 64;

/// Heights over an occluder's plane below this part of the scene's size count as in it.
const IN_PLANE: f64 = 1e-9;

/// The part of a form factor that passes transparent occluders.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transmitted {
    /// The part, from 0 to 1.
    pub fraction: f64,
    /// Variance of the fraction, estimated from two halves of the rays.
    pub variance: f64,
    /// Rays cast.
    pub rays: u32,
}

/// The polygons of a scene that let a part of the light through.
pub struct TransparentOccluders {
    seen: SeenPolygons,
    /// Those of each plane together.
    sheets: Vec<Sheet>,
    /// Box around all of them.
    bounds: Bounds,
}

/// The transparent polygons of one plane.
struct Sheet {
    normal: DVec3,
    /// Height of the plane along the normal.
    height: f64,
    bounds: Bounds,
    /// Heights below this count as in the plane.
    tolerance: f64,
}

impl TransparentOccluders {
    /// Prepares polygons, which all let a part of the light through.
    #[must_use]
    pub fn new(polygons: &[ConvexPolygon], opacities: &[f32]) -> Self {
        let mut by_plane: BTreeMap<PlaneId, Sheet> = BTreeMap::new();
        let mut bounds = Bounds::EMPTY;
        for polygon in polygons {
            let own = Bounds::around(&polygon.corners);
            bounds = bounds.union(own);
            let normal = polygon.normal();
            let height = normal.dot(polygon.corners[0]);
            let tolerance = IN_PLANE * own.largest_coordinate();
            let empty = Sheet { normal, height, bounds: own, tolerance };
            let sheet = by_plane.entry(polygon.plane).or_insert(empty);
            sheet.bounds = sheet.bounds.union(own);
            sheet.tolerance = sheet.tolerance.max(tolerance);
        }
        let sheets = by_plane.into_values().collect();
        Self { seen: SeenPolygons::new(polygons, opacities), sheets, bounds }
    }

    /// Part of the light that passes between two points.
    #[must_use]
    pub fn between(&self, from: DVec3, to: DVec3, planes: [PlaneId; 2]) -> f64 {
        self.seen.transmittance(from, to, planes)
    }

    /// Part of the light from infinitely far that passes to a point, where it travels along a unit vector.
    #[must_use]
    pub fn from_far(&self, point: DVec3, along: DVec3, plane: PlaneId) -> f64 {
        self.seen.transmittance(point, point - along * self.seen.beyond(point), [plane; 2])
    }

    /// Mean part of a polygon's light that passes to a receiver, over what opaque occluders leave of it, weighted as the form factor.
    #[must_use]
    pub fn before(
        &self,
        receiver: &Receiver,
        polygon: &PreparedPolygon,
        occluder: &Occluder,
        seed: u32,
    ) -> Transmitted {
        let Receiver { position, normal, plane } = *receiver;
        if !self.may_stand_between(position, polygon.corners()) {
            return Transmitted { fraction: 1.0, variance: 0.0, rays: 0 };
        }
        let planes = [plane, polygon.plane()];
        let through = |index: u32| {
            let [x, y, ..] = sample_4d(index, 0, seed);
            let target = uniform_point(polygon.corners(), f64::from(x), f64::from(y));
            (target, self.between(position, target, planes))
        };
        let first = through(0).1;
        // Whatever hides some of them, the others pass the same.
        if (1..PROBE_RAYS).all(|index| through(index).1 == first) {
            return Transmitted { fraction: first, variance: 0.0, rays: PROBE_RAYS };
        }
        let (mut ratio, mut blocking) = (RayRatio::default(), Blocking::default());
        for index in 0..RAYS {
            let (target, part) = through(index);
            let weight = kernel(normal, polygon.normal(), target - position);
            if weight > 0.0 && !occluder.blocks_again(position, target, planes, &mut blocking) {
                ratio.add(index >= RAYS / 2, weight, part);
            }
        }
        let rays = 2 * RAYS;
        if let Some((fraction, difference)) = ratio.estimate() {
            return Transmitted { fraction, variance: difference * difference / 4.0, rays };
        }
        // Next to nothing of what is seen was hit: its part of the form factor is small.
        let fraction = ratio.halves().into_iter().find(|half| half.is_finite()).unwrap_or(first);
        Transmitted { fraction, variance: 0.0, rays }
    }

    /// False where none can stand between a point and others: none has them on both sides, or reaches into the box around them.
    fn may_stand_between(&self, point: DVec3, others: &[DVec3]) -> bool {
        let shaft = Bounds::around([point]).union(Bounds::around(others));
        shaft.meets(&self.bounds)
            && self.sheets.iter().any(|sheet| {
                let height = |at: DVec3| sheet.normal.dot(at) - sheet.height;
                let own = height(point);
                shaft.meets(&sheet.bounds)
                    && others.iter().any(|other| {
                        let other = height(*other);
                        (own > sheet.tolerance && other < -sheet.tolerance)
                            || (own < -sheet.tolerance && other > sheet.tolerance)
                    })
            })
    }
}
