//! The surfaces that block light, in a BVH.

mod bodies;
mod boxes;
mod candidates;
mod pyramids;
mod segment;
mod shaft;
mod wide;

use glam::DVec3;
use obvhs::bvh2::Bvh2;
use smallvec::SmallVec;

use crate::form_factor::PreparedPolygon;
use crate::geometry::{ConvexPolygon, PlaneId, area_vector};
use crate::triangles::{Fan, Tree, binary_tree};

pub use bodies::{Body, Edge, convex_bodies};
pub use candidates::{Blocker, CandidateList, Identity};
pub use pyramids::{Pyramids, Reach};
pub use segment::Blocking;
pub use shaft::Shaft;

/// Clearance at the ends of rays, relative to the scene's largest coordinate. Hits are computed in f64 and the planes of both
/// ends do not count, so that rounding is all that it has to cover; a sheet may stand this close to a receiver.
const CLEARANCE: f64 = 1e-11;

/// The occluders of a scene. Built from the same polygons it is the same, bit for bit, everywhere.
pub struct Occluder {
    /// In the order of the BVH's leaves.
    polygons: Vec<OccluderPolygon>,
    bvh: Bvh2,
    bodies: Vec<Body>,
    /// The same for segments.
    tree: Tree,
    /// Rays start this much after and end this much before their ends: coordinates are not known better.
    clearance: f64,
}

/// A polygon that blocks light, from both sides.
#[derive(Debug)]
pub struct OccluderPolygon {
    plane: PlaneId,
    normal: DVec3,
    corners: Vec<DVec3>,
    /// The convex body that it is a face of.
    body: Option<u32>,
}

/// Distances below this part of a polygon's own distance count as nothing: a plane that close to the point is seen edge-on.
const EDGE_ON: f64 = 1e-10;

impl OccluderPolygon {
    /// True where a point is in the polygon's plane, and the polygon blocks nothing of its view.
    fn is_edge_on(&self, point: DVec3) -> bool {
        let to_first = self.corners[0] - point;
        self.normal.dot(to_first).abs() <= EDGE_ON * to_first.length()
    }

    /// True where a segment crosses the polygon, up to rounding.
    fn is_crossed_by(&self, [from, to]: [DVec3; 2]) -> bool {
        let height = |point: DVec3| self.normal.dot(point - self.corners[0]);
        let (above, below) = (height(from), height(to));
        if above * below > 0.0 || above == below {
            return false;
        }
        let crossing = from + (to - from) * (above / (above - below));
        let next = self.corners.iter().cycle().skip(1);
        let is_left = |(a, b): (&DVec3, &DVec3)| {
            self.normal.dot((*b - *a).cross(crossing - *a)) >= -EDGE_ON * (*b - *a).length_squared()
        };
        self.corners.iter().zip(next).all(is_left)
    }
}

impl Fan for OccluderPolygon {
    fn corners(&self) -> &[DVec3] {
        &self.corners
    }

    fn plane(&self) -> PlaneId {
        self.plane
    }
}

impl Occluder {
    /// Builds the BVH over these polygons.
    #[must_use]
    pub fn new(polygons: &[ConvexPolygon]) -> Self {
        let (bvh, largest) = binary_tree(polygons);
        let mut place = vec![0; polygons.len()];
        for (to, from) in bvh.primitive_indices.iter().enumerate() {
            place[*from as usize] = to as u32;
        }
        let faces_of_bodies = convex_bodies(polygons);
        let rounding = bodies::rounding(polygons.iter().flat_map(|polygon| &polygon.corners));
        let mut polygons: Vec<OccluderPolygon> = bvh
            .primitive_indices
            .iter()
            .map(|index| {
                let polygon = &polygons[*index as usize];
                OccluderPolygon {
                    plane: polygon.plane,
                    normal: area_vector(&polygon.corners).normalize_or_zero(),
                    corners: polygon.corners.clone(),
                    body: None,
                }
            })
            .collect();
        let mut bodies = vec![];
        for faces in faces_of_bodies {
            let mut faces: Vec<u32> = faces.into_iter().map(|face| place[face]).collect();
            faces.sort_unstable();
            for face in &faces {
                polygons[*face as usize].body = Some(bodies.len() as u32);
            }
            bodies.push(Body::new(&polygons, faces, rounding));
        }
        let tree = Tree::new(&bvh, largest as f32, &polygons);
        Self { polygons, bvh, bodies, tree, clearance: largest * CLEARANCE }
    }

    /// Number of polygons.
    #[must_use]
    pub fn len(&self) -> usize {
        self.polygons.len()
    }

    /// True where an occluder, one of those with these numbers, stands between all of the pyramids' apexes, the corners of a box around
    /// points in these planes, and all of the polygon at which they are aimed.
    ///
    /// What a convex occluder hides of a point is convex, and so is the set of points from which it hides a point that is not on it:
    /// if it hides the corners of one set from those of another, it hides all from all.
    #[must_use]
    pub fn cuts_off(
        &self,
        numbers: &[u32],
        pyramids: &Pyramids,
        planes: &[PlaneId],
        apexes: &[DVec3],
        polygon: &PreparedPolygon,
    ) -> bool {
        let middle = [apexes.iter().sum::<DVec3>() / apexes.len() as f64, polygon.centre()];
        numbers.iter().any(|number| {
            let face = &self.polygons[*number as usize];
            // What hides all from all hides the middle from the middle.
            if !face.is_crossed_by(middle) {
                return false;
            }
            let is_own = face.plane == polygon.plane() || planes.binary_search(&face.plane).is_ok();
            if !is_own && pyramids.are_cut_off_by(face) {
                return true;
            }
            face.body.is_some_and(|body| {
                let body = &self.bodies[body as usize];
                polygon.corners().iter().all(|corner| body.is_outside(*corner))
                    && pyramids.are_cut_off_by_body(body, polygon)
            })
        })
    }

    /// True where nothing can block anything.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.polygons.is_empty()
    }

    /// Visits the BVH's leaves except where `misses` says so of a box (centre and half extent).
    fn for_each_leaf(
        &self,
        misses: impl Fn(DVec3, DVec3) -> bool,
        mut visit: impl FnMut(std::ops::Range<u32>),
    ) {
        if self.polygons.is_empty() {
            return;
        }
        let mut stack = SmallVec::<[u32; 64]>::from_slice(&[0]);
        while let Some(index) = stack.pop() {
            let node = &self.bvh.nodes[index as usize];
            let (low, high) = (node.aabb().min.as_dvec3(), node.aabb().max.as_dvec3());
            if misses((low + high) * 0.5, (high - low) * 0.5) {
                continue;
            }
            if node.is_leaf() {
                visit(node.first_index..node.first_index + node.prim_count);
            } else {
                stack.extend([node.first_index, node.first_index + 1]);
            }
        }
    }
}
