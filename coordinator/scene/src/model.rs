//! The scene between import and export: surfaces of flat convex facets, with reflectance and exitance.
//!
//! Positions are in the *frame*: the scene centred and scaled by a power of two (see [`Frame`]), in f64. Colours are
//! linear RGB.

use std::sync::Arc;

use document::Folder;
use foldhash::HashSet;
use glam::DVec3;
use kernel::geometry::PlaneId;

use crate::appearance::Appearance;
use crate::facet::Facet;
use crate::frame::Frame;
use crate::light::Light;
use crate::report::ImportReport;
use crate::sky::SkyPattern;

/// An imported scene.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The input document, which the exporter copies.
    pub source: SourceDocument,
    /// One per node, primitive and lit side.
    pub surfaces: Vec<Surface>,
    /// Lights that are no surface, one for each node that holds one.
    pub lights: Vec<Light>,
    /// Radiance of the sky, the same from all directions, below the horizon too; zero for none. Under a pattern, its
    /// mean.
    pub sky: DVec3,
    /// How the radiance of the sky differs by direction, relative to its mean.
    pub sky_pattern: Option<Arc<SkyPattern>>,
    /// Transform between the file's coordinates and the frame.
    pub frame: Frame,
    /// Number of planes; plane ids are below it.
    pub plane_count: u32,
    /// Number of vertices: places with one normal, of each lit side.
    pub vertex_count: usize,
    /// Those among them that only sealed facets have.
    pub sealed_vertex_count: usize,
    /// Warnings on what the import changed or left out.
    pub warnings: Vec<String>,
    /// Parts of the file that the bake models or ignores.
    pub import_report: ImportReport,
    /// Triangles dropped because they have no area.
    pub degenerate_triangles: usize,
}

impl Scene {
    /// All surfaces but the back sides of double-sided ones: enough to tell what blocks light, since a facet does so from both
    /// sides.
    pub fn fronts(&self) -> impl Iterator<Item = &Surface> {
        self.surfaces.iter().filter(|surface| surface.side == Side::Front)
    }

    /// Facets of the front sides.
    pub fn front_facets(&self) -> impl Iterator<Item = &Facet> {
        self.fronts().flat_map(|surface| &surface.facets)
    }

    /// The plane of a facet of a surface.
    #[must_use]
    pub fn plane(&self, surface: u32, facet: u32) -> PlaneId {
        self.surfaces[surface as usize].facets[facet as usize].plane
    }
}

/// The glTF as it was read.
#[derive(Debug, Clone)]
pub struct SourceDocument {
    /// The JSON part.
    pub root: gltf::json::Root,
    /// The bytes of every buffer.
    pub buffers: Vec<Vec<u8>>,
    /// Folder of the file; `None` for a document from memory.
    pub folder: Option<Folder>,
    /// Whether the file was compressed by meshoptimizer.
    pub is_meshopt: bool,
}

/// Which side of a primitive's triangles a surface is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Side {
    /// The side that glTF calls front: counter-clockwise.
    Front,
    /// The other side of a `doubleSided` primitive.
    Back,
}

/// One side of one primitive of one node.
#[derive(Debug, Clone)]
pub struct Surface {
    /// Index of the node in the source document.
    pub node: usize,
    /// Index of the primitive within the node's mesh.
    pub primitive: usize,
    /// Which side.
    pub side: Side,
    /// For messages: node name or index, and the primitive.
    pub name: String,
    /// Diffuse reflectance, baseColor x (1 - metallic), in [0, 1): the mean over its area, times its opacity.
    pub reflectance: DVec3,
    /// Emitted exitance, pi x radiance, in W/m^2 or the scene's light unit: the mean over its area, times its opacity.
    pub exitance: DVec3,
    /// Mean opacity, in [0, 1]; the rest of the light passes through.
    pub opacity: f64,
    /// Its textures and vertex colours; `None` if it is uniform.
    pub appearance: Option<Arc<Appearance>>,
    /// Whether the output takes its normals from the file: some lean further from their facets than light follows.
    pub keeps_normals: bool,
    /// Flat convex pieces that cover the surface's triangles without overlap, but for what lies under others in their plane; empty
    /// where all of it does.
    pub facets: Vec<Facet>,
}

impl Surface {
    /// Number of its vertices: corners of facets that have a place and a normal to themselves.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.count_vertices(|_| true)
    }

    /// Number of the vertices that facets which may be lit have.
    pub(crate) fn lit_vertex_count(&self) -> usize {
        self.count_vertices(|facet| !facet.is_sealed)
    }

    /// Its facets that light may reach, with their numbers: all but those inside closed bodies.
    pub fn lit_facets(&self) -> impl Iterator<Item = (usize, &Facet)> {
        self.facets.iter().enumerate().filter(|(_, facet)| !facet.is_sealed)
    }

    fn count_vertices(&self, counts: impl Fn(&Facet) -> bool) -> usize {
        let bits = |vector: DVec3| vector.to_array().map(f64::to_bits);
        let corners = self.facets.iter().filter(|facet| counts(facet)).flat_map(|facet| &facet.corners);
        let distinct: HashSet<_> =
            corners.map(|corner| (bits(corner.position), bits(corner.normal))).collect();
        distinct.len()
    }

    /// Mean reflectance over a polygon of one of its facets, frame positions; the value at a point where only one is given.
    #[must_use]
    pub fn mean_reflectance(&self, facet: u32, polygon: &[DVec3]) -> DVec3 {
        let over = |appearance: &Arc<Appearance>| {
            appearance.reflectance(facet, &self.facets[facet as usize], polygon)
        };
        self.appearance.as_ref().map_or(self.reflectance, over)
    }

    /// Mean exitance over a polygon of one of its facets, frame positions; the value at a point where only one is given.
    #[must_use]
    pub fn mean_exitance(&self, facet: u32, polygon: &[DVec3]) -> DVec3 {
        let over =
            |appearance: &Arc<Appearance>| appearance.exitance(facet, &self.facets[facet as usize], polygon);
        self.appearance.as_ref().map_or(self.exitance, over)
    }

    /// Mean reflectance, exitance and opacity over a polygon of one of its facets, as above.
    #[must_use]
    pub fn mean_material(&self, facet: u32, polygon: &[DVec3]) -> (DVec3, DVec3, f64) {
        let over =
            |appearance: &Arc<Appearance>| appearance.material(facet, &self.facets[facet as usize], polygon);
        self.appearance.as_ref().map_or((self.reflectance, self.exitance, self.opacity), over)
    }

    /// Mean opacity over a polygon of one of its facets, frame positions; the value at a point where only one is given.
    #[must_use]
    pub fn mean_opacity(&self, facet: u32, polygon: &[DVec3]) -> f64 {
        let over =
            |appearance: &Arc<Appearance>| appearance.opacity(facet, &self.facets[facet as usize], polygon);
        self.appearance.as_ref().map_or(self.opacity, over)
    }
}
