//! The result of a bake: a triangulated, refined mesh with irradiance at every vertex.

use glam::DVec3;

/// The refined mesh of a scene, without cracks: where patches of different size meet, the triangles of the larger one
/// use the vertices of the smaller ones.
#[derive(Debug, Clone, Default)]
pub struct LitMesh {
    /// One per position and smoothing group: facets that meet at a hard edge do not share vertices.
    pub vertices: Vec<LitVertex>,
    /// Triangles of each surface, in the order of [`scene::Scene::surfaces`].
    pub surfaces: Vec<Vec<LitTriangle>>,
    /// The light of groups of sources, on the same vertices.
    pub layers: Vec<LitLayer>,
    /// In previews, unshot radiosity of each vertex, interpolated between the shares, in the unit of [`LitVertex::irradiance`].
    /// Negative where too much was shot. Empty once the bake is done.
    pub unshot: Vec<DVec3>,
    /// Of each vertex, the part of its hemisphere in which nothing stands near; empty where nobody asked for it.
    pub occlusion: Vec<f64>,
    /// Vertices that something which touches them covers, and those of the insides of closed bodies, with the irradiance of what is
    /// seen beside them, in order. Viewers that round would else show dots of their darkness along lit edges. Empty in previews.
    pub covered: Vec<(u32, DVec3)>,
}

impl LitMesh {
    /// The irradiance that viewers are to show at a vertex: its own, or that beside it where it is covered.
    #[must_use]
    pub fn shown_irradiance(&self, vertex: u32) -> DVec3 {
        match self.covered.binary_search_by_key(&vertex, |(covered, _)| *covered) {
            Ok(found) => self.covered[found].1,
            Err(_) => self.vertices[vertex as usize].irradiance,
        }
    }
}

/// The light of some sources alone.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LitLayer {
    /// Name of the group.
    pub name: String,
    /// Names of the sources.
    pub lights: Vec<String>,
    /// Irradiance of each vertex, in the unit of [`LitVertex::irradiance`].
    pub irradiance: Vec<DVec3>,
}

/// A vertex of the refined mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LitVertex {
    /// Position in the frame.
    pub position: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Irradiance, W/m^2 or the scene's light unit, RGB.
    pub irradiance: DVec3,
}

/// A triangle of the refined mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LitTriangle {
    /// Index of the facet within its surface.
    pub facet: u32,
    /// Counter-clockwise seen from the lit side.
    pub vertices: [u32; 3],
}
