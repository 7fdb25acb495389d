//! Convex bodies among the occluders: boxes, prisms, spheres. Their outline blocks what their faces block, in one piece and
//! once, where the faces in front and those behind would each be cut out by themselves.

use foldhash::{HashMap, HashMapExt};
use glam::DVec3;

use super::OccluderPolygon;
use crate::geometry::{Bounds, ConvexPolygon, position_bits};

/// Corners this far from where they should be, relative to the scene's largest coordinate, are rounding: files hold f32.
const ROUNDING: f64 = 1e-6;

/// Bodies smaller than this, in units of that rounding, are left as faces.
const LEAST_SIZE: f64 = 1e3;

/// Bodies with more faces are left as faces: their outline would take longer to find than the few faces in a shaft.
const MOST_FACES: usize = 512;

/// A closed convex body.
#[derive(Debug)]
pub struct Body {
    /// Its polygons, in ascending order.
    pub faces: Vec<u32>,
    /// Its corners, each once.
    pub corners: Vec<DVec3>,
    /// Its edges.
    pub edges: Vec<Edge>,
    /// Points less than this over all faces may lie on the body.
    pub rounding: f64,
}

/// An edge of a body, between two faces.
#[derive(Debug, Clone, Copy)]
pub struct Edge {
    /// Where it starts, counter-clockwise around the left face.
    pub from: DVec3,
    /// Where it ends.
    pub to: DVec3,
    /// The plane of the face on its left.
    pub left: Side,
    /// The plane of the face on its right.
    pub right: Side,
}

/// The plane of a face: outside where normal . x > offset.
#[derive(Debug, Clone, Copy)]
pub struct Side {
    /// Unit normal.
    pub normal: DVec3,
    /// Offset along the normal.
    pub offset: f64,
}

impl Side {
    fn of(normal: DVec3, corners: &[DVec3]) -> Self {
        Self { normal, offset: normal.dot(corners[0]) }
    }

    /// Height of a point over the plane.
    #[must_use]
    pub fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset
    }
}

impl Body {
    /// Builds the body that these polygons, as [`convex_bodies`] found them, enclose.
    pub(super) fn new(polygons: &[OccluderPolygon], faces: Vec<u32>, rounding: f64) -> Self {
        let mut sides = HashMap::new();
        for face in &faces {
            let polygon = &polygons[*face as usize];
            let side = Side::of(polygon.normal, &polygon.corners);
            for (from, to) in directed_edges(&polygon.corners) {
                sides.insert((position_bits(from), position_bits(to)), side);
            }
        }
        let mut edges = vec![];
        let mut corners = vec![];
        for face in &faces {
            let polygon = &polygons[*face as usize];
            for (from, to) in directed_edges(&polygon.corners) {
                let pair = (
                    sides.get(&(position_bits(from), position_bits(to))),
                    sides.get(&(position_bits(to), position_bits(from))),
                );
                if let (Some(left), Some(right)) = pair
                    && position_bits(from) < position_bits(to)
                {
                    edges.push(Edge { from, to, left: *left, right: *right });
                }
                corners.push(from);
            }
        }
        corners.sort_unstable_by_key(|corner| position_bits(*corner));
        corners.dedup();
        Self { faces, corners, edges, rounding }
    }

    /// True where a point sees the front of a face. In the plane of two faces at once, up to rounding, it is in line with their
    /// edge, and the plane through both would be any: such faces are not seen.
    #[must_use]
    pub fn sees(&self, side: &Side, point: DVec3) -> bool {
        side.height(point) > self.rounding
    }

    /// True where a point is outside beyond doubt: it sees a face.
    #[must_use]
    pub fn is_outside(&self, point: DVec3) -> bool {
        self.edges.iter().any(|edge| self.sees(&edge.left, point) || self.sees(&edge.right, point))
    }
}

/// The closed convex bodies among some polygons, each by the numbers of its faces in ascending order. Faces meet at edges with
/// the same ends, to the last bit, and show their fronts outwards.
#[must_use]
pub fn convex_bodies(polygons: &[ConvexPolygon]) -> Vec<Vec<usize>> {
    let rounding = rounding(polygons.iter().flat_map(|polygon| &polygon.corners));
    // Of each directed edge the face on its left; none where there is more than one.
    let mut left = HashMap::new();
    for (index, polygon) in polygons.iter().enumerate() {
        for (from, to) in directed_edges(&polygon.corners) {
            left.entry((position_bits(from), position_bits(to)))
                .and_modify(|face| *face = None)
                .or_insert(Some(index));
        }
    }
    let mut is_seen = vec![false; polygons.len()];
    let mut bodies = vec![];
    for start in 0..polygons.len() {
        if is_seen[start] {
            continue;
        }
        is_seen[start] = true;
        let mut faces = vec![start];
        let mut is_closed = true;
        let mut next = 0;
        while let Some(face) = faces.get(next) {
            for (from, to) in directed_edges(&polygons[*face].corners) {
                let own = left.get(&(position_bits(from), position_bits(to))).copied().flatten();
                match left.get(&(position_bits(to), position_bits(from))).copied().flatten() {
                    Some(other) if own.is_some() => {
                        if !std::mem::replace(&mut is_seen[other], true) {
                            faces.push(other);
                        }
                    }
                    _ => is_closed = false,
                }
            }
            next += 1;
        }
        faces.sort_unstable();
        if is_closed && faces.len() <= MOST_FACES && is_convex(polygons, &faces, rounding) {
            bodies.push(faces);
        }
    }
    bodies
}

/// What counts as rounding among these points.
pub(super) fn rounding<'p>(points: impl Iterator<Item = &'p DVec3>) -> f64 {
    points.map(|point| point.abs().max_element()).fold(0.0, f64::max) * ROUNDING
}

fn is_convex(polygons: &[ConvexPolygon], faces: &[usize], rounding: f64) -> bool {
    let corners = || faces.iter().flat_map(|face| &polygons[*face].corners);
    Bounds::around(corners()).extent().max_element() > LEAST_SIZE * rounding
        && faces.iter().all(|face| {
            let side = Side::of(polygons[*face].normal(), &polygons[*face].corners);
            side.normal != DVec3::ZERO && corners().all(|corner| side.height(*corner) <= rounding)
        })
        // A sheet with two sides is as flat as its rounding.
        && faces.iter().any(|face| {
            let side = Side::of(polygons[*face].normal(), &polygons[*face].corners);
            corners().any(|corner| side.height(*corner) < -LEAST_SIZE * rounding)
        })
}

fn directed_edges(corners: &[DVec3]) -> impl Iterator<Item = (DVec3, DVec3)> {
    corners.iter().copied().zip(corners.iter().copied().cycle().skip(1))
}
