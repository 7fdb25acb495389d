//! Primitives of nodes, and the same as facets in the frame.

use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::primitives::Geometry;
use super::triangles::{self, TriangleMesh};
use super::{averaged, facets};
use crate::appearance::Pattern;
use crate::facet::Facet;
use crate::frame::Frame;
use crate::model::{Side, Surface};

/// A primitive of a node, before the frame is known.
pub struct PlacedPrimitive {
    pub node: usize,
    pub primitive: usize,
    pub name: String,
    pub world: DAffine3,
    pub geometry: Geometry,
    /// World positions of the vertices, if they were welded.
    pub welded: Option<Vec<DVec3>>,
    pub pattern: Arc<Pattern>,
    pub double_sided: bool,
}

/// A primitive as facets in the frame.
pub struct FlatPrimitive {
    pub name: String,
    /// The front, and the back if it is lit; empty if no triangle has an area.
    pub surfaces: Vec<Surface>,
    /// Whether its node has a scale of zero.
    pub is_squeezed: bool,
    /// How far the rounding of the file's coordinates may have moved a point, frame units.
    pub rounding: f64,
    pub degenerate: usize,
    pub duplicates: usize,
}

impl FlatPrimitive {
    /// Puts a primitive into the frame.
    pub fn new(placed: PlacedPrimitive, frame: &Frame, weld: Option<f64>) -> Self {
        let welded = placed.welded.as_deref().zip(weld);
        let mesh = TriangleMesh::new(&placed.geometry, &placed.world, frame, welded);
        let facets = facets::build(&mesh, &placed.geometry.attributes);
        let TriangleMesh { rounding, leans_far, degenerate, duplicates, .. } = mesh;
        let surfaces = if facets.is_empty() { Vec::new() } else { placed.surfaces(facets, leans_far) };
        let is_squeezed = placed.world.matrix3.determinant() == 0.0;
        Self { name: placed.name, surfaces, is_squeezed, rounding, degenerate, duplicates }
    }
}

impl PlacedPrimitive {
    /// World positions of all triangles' corners.
    pub fn corners(&self) -> impl Iterator<Item = DVec3> {
        let corners = self.geometry.triangles.iter().flatten();
        corners.map(|&vertex| match &self.welded {
            Some(positions) => positions[vertex as usize],
            None => triangles::to_world(&self.world, self.geometry.positions[vertex as usize]),
        })
    }

    /// The surface of these front facets, and that of their backs if the material is double sided.
    fn surfaces(&self, front: Vec<Facet>, keeps_normals: bool) -> Vec<Surface> {
        let material = averaged::averaged(&self.pattern, &self.geometry, &front);
        let surface = |side, facets| Surface {
            node: self.node,
            primitive: self.primitive,
            side,
            name: self.name.clone(),
            reflectance: material.reflectance,
            exitance: material.exitance,
            opacity: material.opacity,
            appearance: material.appearance.clone(),
            keeps_normals,
            facets,
        };
        let back = self.double_sided.then(|| front.iter().map(facets::turn).collect());
        let front = surface(Side::Front, front);
        [Some(front), back.map(|facets| surface(Side::Back, facets))].into_iter().flatten().collect()
    }
}
