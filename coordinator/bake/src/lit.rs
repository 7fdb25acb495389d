//! The answer between solver and export: a triangulated, refined mesh with an irradiance at every vertex.

use glam::DVec3;

/// The refined mesh of a whole scene. Without cracks: where patches of different size meet, the triangles of the larger one
/// use the vertices of the smaller ones.
#[derive(Debug, Clone, Default)]
pub struct LitMesh {
    /// One per position and smoothing group: facets that meet at a hard edge do not share vertices.
    pub vertices: Vec<LitVertex>,
    /// Triangles of each surface, in the order of [`scene::Scene::surfaces`].
    pub surfaces: Vec<Vec<LitTriangle>>,
    /// Parts of the light, each by itself, on the same vertices.
    pub layers: Vec<LitLayer>,
    /// Radiosity that is still to be shot, of each vertex, interpolated between the shares, in the unit of [`LitVertex::irradiance`]:
    /// of the present state of a bake under way. Below 0 where too much was shot. Empty once the bake is done.
    pub unshot: Vec<DVec3>,
}

/// The light of some sources alone.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LitLayer {
    /// What its group of lights is called.
    pub name: String,
    /// The sources, in words.
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
