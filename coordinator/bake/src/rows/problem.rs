use glam::DVec3;

use super::means::ShareValues;
use super::share_mesh::ShareMesh;

/// What a solution is to solve.
pub struct Problem<'a> {
    /// The mesh with its shares.
    pub mesh: &'a ShareMesh,
    /// Where shares take their irradiance from.
    pub values: &'a ShareValues,
    /// Which vertices see any surface.
    pub exposed: &'a [bool],
    /// Irradiance of the vertices from the light sources.
    pub direct: &'a [DVec3],
    /// The bound of what is missing, relative to the reflected flux.
    pub tolerance: f64,
}
