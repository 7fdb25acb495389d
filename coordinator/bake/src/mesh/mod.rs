//! The radiosity mesh: vertices, and patches that divide about their centroid.
//!
//! | file | what it does |
//! |---|---|
//! | `base` | facets of the scene to first patches |
//! | `line` | lines that become edges |
//! | `contact` | lines where facets stand on others |
//! | `shadow` | lines where the shadows of point lights, spots and the sun end |
//! | `planar` | cuts flat regions along lines, by constrained Delaunay triangulation |
//! | `pieces` | cuts long pieces across |
//! | `points` | which corners are the same point |
//! | `welding` | points to vertices; T-vertices made corners |
//! | `outline` | outlines that pass through a corner twice made simple |
//! | `buried` | divides leaves between corners inside of other bodies |
//! | `subdivision` | divides patches, keeping neighbours within one level of each other |
//! | `leaves_at` | which leaves lie along an edge |
//! | `order` | vertices in spatial order |
//! | `shares` | deals the patches out among their vertices |
//! | `overlay` | lays the shares of one mesh over another |
//! | `triangulation` | the leaves as triangles without cracks |
//! | `locate` | the leaf and the triangle under a point |
//! | `clusters` | leaves of small things that see the same light |
//! | `receivers` | vertices as receivers |
//!
//! Vertices are points with one normal: facets that meet at a crease have separate vertices there. They are only ever
//! added, so indices stay valid and the vertices of a coarse mesh are the first of the refined one.
//!
//! To exchange the mesh, keep [`Mesh`]: patches over vertices, [`Mesh::divide`], shares and [`triangulate`] are all that the
//! rest of the bake uses.

mod base;
mod buried;
mod clusters;
mod contact;
mod leaves_at;
mod line;
mod locate;
mod order;
mod outline;
mod overlay;
mod pieces;
mod planar;
mod points;
mod receivers;
mod shadow;
mod shares;
mod subdivision;
mod triangulation;
mod welding;

use foldhash::HashMap;

use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId};
use rayon::prelude::*;
use scene::Scene;
use smallvec::SmallVec;

use leaves_at::LeavesAt;
use order::FacetPlaces;
pub use order::along_curve;

pub use base::MeshLimits;
pub use buried::divide_buried;
pub use clusters::ClusterLimits;
pub use line::{Contact, distance_to_line};
pub use locate::{Interpolation, interpolation};
pub use overlay::overlap;
pub use receivers::{INWARD, VertexReceivers, receivers, shared_receivers};
pub use shadow::shadow_lines;
pub use shares::{Share, Surroundings, surroundings};
pub use triangulation::triangulate;

/// Positions closer than this, in frame units, are one point; a point this close to an edge lies on it. The frame is 1024 to
/// 2048 units long, where f32 coordinates of the input are 6e-5 to 1.2e-4 apart.
const WELD: f64 = 2e-4;

/// Patches that a thread looks at, at least.
const LEAVES_AT_ONCE: usize = 1024;

/// In scenes with more facets than this a facet is no wall.
const FEW_FACETS: usize = 20_000;

/// Index of a vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct VertexId(pub u32);

impl VertexId {
    /// As an index into arrays over vertices.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Index of a patch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PatchId(pub u32);

impl PatchId {
    /// As an index into arrays over patches.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// A position with one normal.
#[derive(Debug, Clone, Copy)]
pub struct Vertex {
    /// Position in the frame.
    pub position: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Plane of a facet that the vertex belongs to.
    pub plane: PlaneId,
    /// True where the normal is a smooth one, which differs from its facets'.
    pub smooth: bool,
    /// Height over it of an edge that it lies under, if there is one.
    pub hovering: Option<f64>,
}

/// A convex polygon of the mesh, whole or divided.
#[derive(Debug, Clone)]
pub struct Patch {
    /// Index of its surface in the scene.
    pub surface: u32,
    /// Index of its facet within the surface.
    pub facet: u32,
    /// Counter-clockwise seen from the lit side. A divided patch's children stand in the same order, each with its parent's
    /// corner first.
    pub corners: SmallVec<[VertexId; 4]>,
    /// First of its children, which are as many as it has corners.
    pub first_child: Option<PatchId>,
    /// The patch that it is a part of.
    pub parent: Option<PatchId>,
    /// Area in the frame.
    pub area: f64,
}

/// An edge, whichever way it is walked.
type Edge = (VertexId, VertexId);

fn edge(a: VertexId, b: VertexId) -> Edge {
    if a < b { (a, b) } else { (b, a) }
}

/// The mesh of a scene.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// All vertices.
    pub vertices: Vec<Vertex>,
    /// All patches, divided ones too.
    pub patches: Vec<Patch>,
    /// Vertex in the middle of an edge that a divided patch has.
    midpoints: HashMap<Edge, VertexId>,
    /// The whole edge that half an edge came from.
    halves: HashMap<Edge, Edge>,
    /// Undivided patches along an edge; none until a patch is divided.
    leaves_at: Option<LeavesAt>,
    facet_places: FacetPlaces,
    /// Whether lines were asked for that are no contacts.
    pub has_lines: bool,
}

impl Mesh {
    /// The undivided patches, in the order of their ids.
    pub fn leaves(&self) -> impl Iterator<Item = (PatchId, &Patch)> {
        let ids = (0..self.patches.len() as u32).map(PatchId);
        ids.zip(&self.patches).filter(|(_, patch)| patch.first_child.is_none())
    }

    /// The same on all threads.
    pub fn par_leaves(&self) -> impl ParallelIterator<Item = (PatchId, &Patch)> {
        let patches = self.patches.par_iter().enumerate().with_min_len(LEAVES_AT_ONCE);
        let leaves = patches.filter(|(_, patch)| patch.first_child.is_none());
        leaves.map(|(index, patch)| (PatchId(index as u32), patch))
    }

    /// A patch.
    #[must_use]
    pub fn patch(&self, id: PatchId) -> &Patch {
        &self.patches[id.index()]
    }

    /// A patch as a polygon in the plane of its facet.
    #[must_use]
    pub fn polygon(&self, scene: &Scene, id: PatchId) -> ConvexPolygon {
        let patch = self.patch(id);
        ConvexPolygon { plane: scene.plane(patch.surface, patch.facet), corners: self.corners(id) }
    }

    /// Positions of a patch's corners.
    #[must_use]
    pub fn corners(&self, id: PatchId) -> Vec<DVec3> {
        self.patch(id).corners.iter().map(|corner| self.position(*corner)).collect()
    }

    /// Position of a vertex.
    #[must_use]
    pub fn position(&self, id: VertexId) -> DVec3 {
        self.vertices[id.index()].position
    }

    /// Children of a divided patch, in the order of its corners; none for a leaf.
    pub fn children(&self, id: PatchId) -> impl Iterator<Item = PatchId> + use<> {
        let patch = self.patch(id);
        let count = if patch.first_child.is_some() { patch.corners.len() as u32 } else { 0 };
        let first = patch.first_child.map_or(0, |first| first.0);
        (first..first + count).map(PatchId)
    }

    /// Edges of a patch, in the order of its corners: the edge that leaves each of them.
    pub fn edges(&self, id: PatchId) -> impl Iterator<Item = (VertexId, VertexId)> + '_ {
        let corners = &self.patch(id).corners;
        corners.iter().copied().zip(corners.iter().copied().cycle().skip(1))
    }

    /// Mean of a patch's corners, where it is divided.
    #[must_use]
    pub fn centre(&self, id: PatchId) -> DVec3 {
        let corners = &self.patch(id).corners;
        corners.iter().map(|corner| self.position(*corner)).sum::<DVec3>() / corners.len() as f64
    }

    /// Areas of the triangles that a patch's centre makes with its edges, in their order.
    #[must_use]
    pub fn fan(&self, id: PatchId) -> SmallVec<[f64; 8]> {
        let centre = self.centre(id);
        let area = |(a, b)| (self.position(a) - centre).cross(self.position(b) - centre).length() / 2.0;
        self.edges(id).map(area).collect()
    }

    /// Mean over a patch of what its corners have: linear over each of the triangles around its centre, which has the mean of the
    /// corners. Exact for linear values, whatever the patch's shape.
    #[must_use]
    pub fn mean(&self, id: PatchId, values: &[DVec3]) -> DVec3 {
        let corners = &self.patch(id).corners;
        let at = |i: usize| values[corners[i % corners.len()].index()];
        let centre = (0..corners.len()).map(at).sum::<DVec3>() / corners.len() as f64;
        let fan = self.fan(id);
        let whole: f64 = fan.iter().sum();
        if whole <= 0.0 {
            return centre;
        }
        let sum: DVec3 = fan.iter().enumerate().map(|(i, area)| (at(i) + at(i + 1) + centre) * *area).sum();
        sum / (3.0 * whole)
    }

    /// Longest edge of a patch, or of the square with its diagonal where that is longer: T-vertices may leave a large patch
    /// only short edges.
    #[must_use]
    pub fn size(&self, id: PatchId) -> f64 {
        let edge =
            self.edges(id).map(|(a, b)| self.position(a).distance(self.position(b))).fold(0.0, f64::max);
        let positions = || self.patch(id).corners.iter().map(|corner| self.position(*corner));
        let centre = self.centre(id);
        let reach = positions().map(|corner| corner.distance(centre)).fold(0.0, f64::max);
        edge.max(reach * std::f64::consts::SQRT_2)
    }
}
