//! Which points lie inside of walls: those that see backs of surfaces.

use std::f64::consts::PI;

use glam::DVec3;
use kernel::geometry::PlaneId;
use kernel::hemisphere::SeenPolygons;
use scene::{Scene, Side};

/// Rays over the sphere about a point.
const RAYS: u32 = 96;

/// Part of them that meet backs from which on a point is inside: one that stands free sees few, of sheets that are lit from one side.
const MOST_BACKS: f64 = 0.25;

/// Part of them that may meet something else than backs where these are lit, too: then only the dark tells.
const MOST_OTHERS: f64 = 0.05;

/// Golden angle, by which directions that follow each other are turned.
const TURN: f64 = PI * (3.0 - 2.236_067_977_499_79);

/// Where a point lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Among surfaces that face it.
    Open,
    /// Behind surfaces that are lit from behind, too: inside of something, if it is dark there.
    BehindLitBacks,
    /// Behind surfaces.
    Inside,
}

/// The surfaces of a scene, from both sides.
pub struct Walls {
    seen: SeenPolygons,
    is_back: Vec<bool>,
}

impl Walls {
    pub fn new(scene: &Scene) -> Self {
        let facets =
            || scene.surfaces.iter().flat_map(|own| own.facets.iter().map(move |facet| (own.side, facet)));
        let polygons: Vec<_> = facets().map(|(_, facet)| facet.polygon()).collect();
        let is_back = facets().map(|(side, _)| side == Side::Back).collect();
        Self { seen: SeenPolygons::new(&polygons, &[]), is_back }
    }

    /// Where a point of the frame lies.
    pub fn place(&self, point: DVec3) -> Place {
        let (mut backs, mut lit_backs) = (0, 0);
        for ray in 0..RAYS {
            let z = 1.0 - (2.0 * f64::from(ray) + 1.0) / f64::from(RAYS);
            let (sine, cosine) = (f64::from(ray) * TURN).sin_cos();
            let across = (1.0 - z * z).sqrt();
            let direction = DVec3::new(across * cosine, across * sine, z);
            match self.seen.nearest(point, direction, 0.0, PlaneId::NONE) {
                Some(hit) if !hit.is_front => backs += 1,
                Some(hit) if self.is_back[hit.polygon] => lit_backs += 1,
                _ => {}
            }
        }
        let part = |count: u32| f64::from(count) / f64::from(RAYS);
        if part(backs) > MOST_BACKS {
            Place::Inside
        } else if part(backs + lit_backs) >= 1.0 - MOST_OTHERS {
            Place::BehindLitBacks
        } else {
            Place::Open
        }
    }
}
