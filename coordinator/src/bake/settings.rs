use serde::Serialize;

/// The knobs of a bake.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BakeSettings {
    /// Longest edge of a shooting patch, relative to the scene's extent.
    pub shooter_edge: f64,
    /// Interpolation error at which refinement ends: relative L2 of the radiosity.
    pub mesh_error: f64,
    /// Refinement also ends at this number of vertices.
    pub max_vertices: usize,
    /// Rows are kept in memory, 4 bytes for each pair of share and vertex; refinement also ends when they take this many MiB.
    pub row_memory: usize,
    /// Patches are divided this often at most.
    pub max_level: u32,
    /// Shooting ends when rho / (1 - rho) x unshot flux is under this part of the reflected flux.
    pub threshold: f64,
    /// Shot n is chosen from the state after shot n - window. Part of the answer: the same whatever the workers.
    pub window: usize,
    /// Rays that a receiver spends on a hemisphere of shafts too crowded to be cut exactly.
    pub rays_per_hemisphere: u32,
    /// Least rays for such a pair; a power of two.
    pub minimum_rays: u32,
    /// Most rays for such a pair; a power of two.
    pub maximum_rays: u32,
    /// Seed of all rays.
    pub seed: u64,
    /// Weigh point lights by the cosine of an imaginary horizontal plane instead of evenly by solid angle.
    pub planar_point_lights: bool,
}

impl BakeSettings {
    /// Most vertices for which the rows of so many shares fit in memory, with the factors between shares beside them.
    #[must_use]
    pub fn row_limit(&self, shares: usize) -> usize {
        ((self.row_memory << 20) / (4 * shares.max(1))).saturating_sub(shares)
    }
}

impl Default for BakeSettings {
    fn default() -> Self {
        Self {
            shooter_edge: 0.15,
            mesh_error: 0.01,
            max_vertices: 200_000,
            row_memory: 8192,
            max_level: 12,
            threshold: 1e-3,
            window: 32,
            rays_per_hemisphere: 1024,
            minimum_rays: 4,
            maximum_rays: 256,
            seed: 0,
            planar_point_lights: false,
        }
    }
}
