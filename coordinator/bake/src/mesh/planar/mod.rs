//! Flat regions of a surface, cut along lines into convex pieces.
//!
//! | file | what it does |
//! |---|---|
//! | `region` | facets of one plane that hang together |
//! | `arrangement` | borders and lines, cut where they meet |
//! | `grading` | points that let triangles grow with the distance from what is small |
//! | `triangles` | constrained Delaunay triangles of all these |
//! | `quads` | pairs of triangles as quadrilaterals |
//!
//! A line is an edge of the pieces for as long as it runs, and no longer: the triangles around it grow with the distance, so that
//! a small thing on a large wall costs few vertices.

mod arrangement;
mod grading;
mod quads;
mod region;
mod triangles;

use glam::{DVec2, DVec3};
use smallvec::SmallVec;

use super::line::Contact;
use arrangement::Arrangement;
use scene::{Corner, Facet};

pub use region::{Region, regions};

/// Most facets of a region that is cut along lines.
const MOST_FACETS: usize = 4096;

/// A convex piece of a facet.
pub struct Piece {
    /// Index of the facet within its surface.
    pub facet: u32,
    /// Counter-clockwise.
    pub corners: Vec<Corner>,
    /// Lines that some of its edges lie on.
    pub lines: Vec<Contact>,
}

/// Coordinates in a plane.
struct Axes {
    origin: DVec3,
    x: DVec3,
    y: DVec3,
}

impl Axes {
    fn new(facet: &Facet) -> Self {
        let normal = facet.normal;
        let origin = facet.corners[0].position;
        // Along a side, so that the squares of the grading lie along borders.
        let next = facet.positions().cycle().skip(1);
        let longest = facet
            .positions()
            .zip(next)
            .map(|(from, to)| to - from)
            .fold(DVec3::ZERO, |a, b| if b.length_squared() > a.length_squared() { b } else { a });
        let along = longest - normal * normal.dot(longest);
        let x = along.try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
        Self { origin, x, y: normal.cross(x) }
    }

    fn flat(&self, point: DVec3) -> DVec2 {
        let way = point - self.origin;
        DVec2::new(self.x.dot(way), self.y.dot(way))
    }

    fn raised(&self, point: DVec2) -> DVec3 {
        self.origin + self.x * point.x + self.y * point.y
    }
}

/// Cuts a region along lines. Triangles grow from `finest` on, or from the length of segments. `None` where the region cannot be
/// triangulated: its facets then stay as they are.
pub fn pieces(facets: &[(u32, &Facet)], lines: &[Contact], finest: f64) -> Option<Vec<Piece>> {
    if facets.len() > MOST_FACETS {
        return None;
    }
    let axes = Axes::new(facets.first()?.1);
    let arrangement = Arrangement::new(facets, lines, &axes)?;
    let triangulation = triangles::triangulate(&arrangement, facets, &axes, finest)?;
    let corner = |point: DVec2, known: Option<u32>, facet: &Facet| {
        let position = known
            .and_then(|known| arrangement.positions[known as usize])
            .unwrap_or_else(|| axes.raised(point));
        Corner { position, normal: normal_at(facet, position) }
    };
    let on_lines = |corners: &[Corner]| -> Vec<Contact> {
        let next = corners.iter().cycle().skip(1);
        let middles: SmallVec<[DVec3; 4]> =
            corners.iter().zip(next).map(|(a, b)| (a.position + b.position) / 2.0).collect();
        let touched = |line: &&Contact| {
            middles.iter().any(|middle| super::line::distance_to_line(*middle, line) < super::WELD)
        };
        lines.iter().filter(touched).copied().collect()
    };
    let by_facet = |facet: u32| facets.iter().find(|(index, _)| *index == facet).map(|found| found.1);
    let mut pieces = vec![];
    for polygon in quads::paired(&triangulation) {
        let facet = by_facet(polygon.facet)?;
        let corners: Vec<Corner> = polygon
            .corners
            .iter()
            .map(|vertex| {
                let (point, known) = triangulation.vertices[*vertex as usize];
                corner(point, known, facet)
            })
            .collect();
        let lines = if polygon.is_at_border { on_lines(&corners) } else { vec![] };
        pieces.push(Piece { facet: polygon.facet, corners, lines });
    }
    Some(pieces)
}

/// The normal at a point of a facet: linear over a fan of triangles.
fn normal_at(facet: &Facet, point: DVec3) -> DVec3 {
    if facet.corners.iter().all(|corner| corner.normal == facet.normal) {
        return facet.normal;
    }
    if let Some(corner) = facet.corners.iter().find(|corner| corner.position == point) {
        return corner.normal;
    }
    let weights = |k: usize| {
        let [a, b, c] = [0, k, k + 1].map(|i| facet.corners[i].position);
        let area = (b - a).cross(c - a).dot(facet.normal);
        let part = |from: DVec3, to: DVec3| (to - from).cross(point - from).dot(facet.normal) / area;
        [part(b, c), part(c, a), part(a, b)]
    };
    let least = |weights: &[f64; 3]| weights.iter().copied().fold(f64::INFINITY, f64::min);
    let best = (1..facet.corners.len() - 1)
        .map(|k| (k, weights(k)))
        .filter(|(_, weights)| least(weights).is_finite())
        .reduce(|a, b| if least(&b.1) > least(&a.1) { b } else { a });
    let Some((k, weights)) = best else { return facet.normal };
    let corners = [0, k, k + 1].map(|i| facet.corners[i].normal);
    let sum: DVec3 = corners.iter().zip(weights).map(|(normal, weight)| *normal * weight.max(0.0)).sum();
    sum.normalize_or(facet.normal)
}
