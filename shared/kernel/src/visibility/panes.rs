//! What panes that stop a part of the light leave of a form factor.
//!
//! What stops all light is cut out of a polygon exactly; of the rest, panes take a part that differs from ray to ray. It is sampled, as
//! the ratio of two sums over the same rays, so that it is exact where all of the polygon is seen through the same panes.

use std::collections::BTreeMap;

use glam::DVec3;
use sobol_burley::sample_4d;

use crate::form_factor::PreparedPolygon;
use crate::geometry::{ConvexPolygon, PlaneId, uniform_point};
use crate::hemisphere::SeenPolygons;
use crate::occluder::Occluder;
use crate::replica::Receiver;

/// Rays that find out whether all of a polygon is seen through the same panes.
const PROBE_RAYS: u32 = 16;

/// Rays from a receiver to a polygon of which panes take different parts.
const PANE_RAYS: u32 = 64;

/// What panes leave.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dimmed {
    /// Part of the form factor that passes.
    pub fraction: f64,
    /// Variance of the fraction, estimated from two halves of the rays.
    pub variance: f64,
    /// Rays cast.
    pub rays: u32,
}

/// Heights over a pane's plane below this part of the scene's size count as in it.
const IN_PLANE: f64 = 1e-9;

/// The polygons of a scene that let a part of the light through.
pub struct Panes {
    seen: SeenPolygons,
    /// Those of each plane together.
    sheets: Vec<Sheet>,
    /// Around all of them.
    bounds: [DVec3; 2],
}

/// What lies in one plane.
struct Sheet {
    normal: DVec3,
    /// Height of the plane along the normal.
    height: f64,
    bounds: [DVec3; 2],
    /// Heights below this count as in the plane.
    tolerance: f64,
}

/// A receiver and a polygon that it sees something of.
pub struct View<'a> {
    /// The receiver.
    pub receiver: &'a Receiver,
    /// The polygon.
    pub polygon: &'a PreparedPolygon,
}

impl Panes {
    /// Of these polygons, which all let a part of the light through.
    #[must_use]
    pub fn new(polygons: &[ConvexPolygon], opacities: &[f32]) -> Self {
        let mut by_plane: BTreeMap<PlaneId, Sheet> = BTreeMap::new();
        let mut bounds = NOTHING;
        for polygon in polygons {
            let own = around(NOTHING, &polygon.corners);
            bounds = around(bounds, &own);
            let normal = polygon.normal();
            let height = normal.dot(polygon.corners[0]);
            let tolerance = IN_PLANE * own[0].abs().max(own[1].abs()).max_element();
            let sheet =
                by_plane.entry(polygon.plane).or_insert(Sheet { normal, height, bounds: NOTHING, tolerance });
            sheet.bounds = around(sheet.bounds, &own);
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

    /// Mean part of the light of a polygon that passes to a receiver, over what occluders leave of it, weighted as the form factor is;
    /// with what it took.
    #[must_use]
    pub fn before(&self, view: &View, occluder: &Occluder, seed: u32) -> Dimmed {
        let View { receiver: Receiver { position, normal, plane }, polygon } = *view;
        if !self.may_stand_between(*position, polygon.corners()) {
            return Dimmed { fraction: 1.0, variance: 0.0, rays: 0 };
        }
        let planes = [*plane, polygon.plane()];
        let through = |index: u32| {
            let [x, y, ..] = sample_4d(index, 0, seed);
            let target = uniform_point(polygon.corners(), f64::from(x), f64::from(y));
            (target, self.between(*position, target, planes))
        };
        let first = through(0).1;
        // Whatever hides some of them, the others pass the same.
        if (1..PROBE_RAYS).all(|index| through(index).1 == first) {
            return Dimmed { fraction: first, variance: 0.0, rays: PROBE_RAYS };
        }
        // Of each half of the rays, which are nets of their own.
        let (mut passed, mut seen) = ([0.0; 2], [0.0; 2]);
        for index in 0..PANE_RAYS {
            let (target, part) = through(index);
            let to = target - *position;
            let squared = to.length_squared();
            let weight = normal.dot(to) * -polygon.normal().dot(to) / (squared * squared);
            if weight > 0.0 && !occluder.blocks(*position, target, planes) {
                let half = usize::from(index >= PANE_RAYS / 2);
                seen[half] += weight;
                passed[half] += weight * part;
            }
        }
        let rays = 2 * PANE_RAYS;
        let [a, b] = [0, 1].map(|half| passed[half] / seen[half]);
        if a.is_finite() && b.is_finite() {
            let fraction = (passed[0] + passed[1]) / (seen[0] + seen[1]);
            return Dimmed { fraction, variance: (a - b) * (a - b) / 4.0, rays };
        }
        // Next to nothing of what is seen was hit: its part of the form factor is small.
        let fraction = [a, b].into_iter().find(|half| half.is_finite()).unwrap_or(first);
        Dimmed { fraction, variance: 0.0, rays }
    }

    /// False where no pane can stand between a point and points: none has them on both sides, or reaches into the box around them.
    fn may_stand_between(&self, point: DVec3, others: &[DVec3]) -> bool {
        let shaft = around([point; 2], others);
        let meets = |bounds: &[DVec3; 2]| bounds[0].cmple(shaft[1]).all() && shaft[0].cmple(bounds[1]).all();
        meets(&self.bounds)
            && self.sheets.iter().any(|sheet| {
                let height = |at: DVec3| sheet.normal.dot(at) - sheet.height;
                let own = height(point);
                meets(&sheet.bounds)
                    && others.iter().any(|other| {
                        let other = height(*other);
                        (own > sheet.tolerance && other < -sheet.tolerance)
                            || (own < -sheet.tolerance && other > sheet.tolerance)
                    })
            })
    }
}

/// A box around nothing.
const NOTHING: [DVec3; 2] = [DVec3::INFINITY, DVec3::NEG_INFINITY];

/// The box around another and points.
fn around([low, high]: [DVec3; 2], points: &[DVec3]) -> [DVec3; 2] {
    points.iter().fold([low, high], |[low, high], point| [low.min(*point), high.max(*point)])
}
