//! Form factors without occlusion against the 60-digit values of `form_factors.json`.
//!
//! | module | what is held against them |
//! |---|---|
//! | `points` | a point to a polygon: exactly, in the limit at edges, and the fast way that rows take |
//! | `polygons` | a polygon to a polygon |
//! | `coverage` | the tests against the file: no case is left out |

mod coverage;
mod points;
mod polygons;

use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId};
use serde_json::Value;
use tests::cases;
use tests::shapes::Polygon;

/// How far a figure may be from the expected one.
#[derive(Debug, Clone, Copy)]
enum Within {
    /// This part of the expected one.
    Relative(f64),
    /// This much.
    Absolute(f64),
}

impl Within {
    /// Holds a figure against the expected one.
    fn check(self, what: &str, found: f64, expected: f64) {
        let error = (found - expected).abs();
        let limit = match self {
            Self::Relative(part) => part * expected.abs(),
            Self::Absolute(limit) => limit,
        };
        assert!(error <= limit, "{what}: {found:e}, expected {expected:e} within {self:?}, off by {error:e}");
    }
}

fn convex(plane: u32, corners: &[DVec3]) -> ConvexPolygon {
    ConvexPolygon { plane: PlaneId(plane), corners: corners.to_vec() }
}

/// A regular polygon in place of a horizontal disk, its radius this many times the disk's.
fn polygon_for_disk(disk: &Value, corners: u32, radius: f64) -> Polygon {
    let centre = cases::point(&disk["center"]);
    // Counter-clockwise seen from the side of the normal.
    let angle = std::f64::consts::TAU / f64::from(corners) * cases::point(&disk["normal"]).z;
    let radius = radius * disk["radius"].as_f64().unwrap();
    let corner = |i: u32| {
        let (sine, cosine) = (angle * f64::from(i)).sin_cos();
        centre + radius * DVec3::new(cosine, sine, 0.0)
    };
    (0..corners).map(corner).collect()
}

/// Radius of a regular polygon with the area of a disk of radius 1.
fn radius_of_equal_area(corners: u32) -> f64 {
    let angle = std::f64::consts::TAU / f64::from(corners);
    (angle / angle.sin()).sqrt()
}
