use kernel::row::Precision;
use scene::Scene;
use serde::Serialize;

use crate::light_parts::{LightGroup, LightPart};

/// How the rows of form factors are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RowStrategy {
    /// The one that is predicted to cost less: [`Exact`](Self::Exact) for few polygons or small errors.
    #[default]
    Automatic,
    /// Shooter rows: visibility pair by pair, exact where few occluders lie between.
    Exact,
    /// Hemisphere rows: rays from each receiver. Time is linear in the number of vertices, with noise.
    Gather,
}

/// How good a picture of the baked scene is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Quality {
    /// To see where light falls.
    Draft,
    /// To work with.
    #[default]
    Preview,
    /// To publish.
    Final,
}

impl Quality {
    /// Relative L2 error of the radiosity, and contrast of errors.
    const fn errors(self) -> (f64, f64) {
        match self {
            Self::Draft => (0.1, 0.3),
            Self::Preview => (0.05, 0.15),
            Self::Final => (0.01, 0.005),
        }
    }
}

/// The settings of a bake.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BakeSettings {
    /// Target for the relative L2 error of the radiosity. The bake starts from the settings below, and refines the mesh or
    /// begins again with finer shooters or more rays until its estimate meets the target.
    pub error: Option<f64>,
    /// The quality that `error` and `contrast` were chosen for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quality: Option<Quality>,
    /// Contrast of errors at which refinement ends, beside `error` or `mesh_error`: root mean square over the surfaces of the error
    /// relative to the light at its place. An aim, less strict than the others: noise and the number of vertices come before it.
    /// Exact rows aim at .45 of `error` where this is more.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contrast: Option<f64>,
    /// How form factors are computed.
    pub rows: RowStrategy,
    /// Longest edge of a shooting patch, relative to the scene's extent.
    pub shooter_edge: f64,
    /// Interpolation error at which refinement ends: relative L2 of the radiosity.
    pub mesh_error: f64,
    /// No triangle of the answer has a longer edge than this, in the file's units, as far as there are vertices for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_edge: Option<f64>,
    /// Refinement also ends at this number of vertices [default: [`BakeSettings::LEAST_MAX_VERTICES`], or twice those of the scene].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_vertices: Option<usize>,
    /// Memory for rows in MiB: those that do not fit are made again when they are needed. No part of the answer, and so not
    /// written beside it.
    #[serde(skip)]
    pub row_cache: usize,
    /// Most divisions of a patch.
    pub max_level: u32,
    /// The solution ends when rho / (1 - rho) x unshot flux is under this part of the reflected flux.
    pub threshold: f64,
    /// Shot n is chosen from the state after shot n - window. Part of the answer: the same whatever the workers.
    pub window: usize,
    /// [`Precision::exact_occluders`].
    pub exact_occluders: u32,
    /// [`Precision::rays_per_hemisphere`].
    pub rays_per_hemisphere: u32,
    /// Rays per hemisphere for light sources, where they are more than [`Self::rays_per_hemisphere`]: of those that share rows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rays_to_sources: Option<u32>,
    /// [`Precision::minimum_rays`].
    pub minimum_rays: u32,
    /// [`Precision::maximum_rays`].
    pub maximum_rays: u32,
    /// [`Precision::form_factor_error`].
    pub form_factor_error: f64,
    /// [`Precision::factor_rounding`].
    pub factor_rounding: f64,
    /// Least number of validation samples: random points at which the error is measured; scenes with many patches get more. At 0
    /// the error of the mesh is predicted from the vertices alone.
    pub validation_samples: usize,
    /// Seed of all rays and of the validation samples.
    pub seed: u64,
    /// Which part of the light the output has.
    #[serde(skip_serializing_if = "LightPart::is_all")]
    pub only: LightPart,
    /// Light sources whose light is wanted by itself as well.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub groups: Vec<LightGroup>,
    /// Keep the light of each source for relighting, if it takes at most this many bytes. Does not affect the result.
    #[serde(skip)]
    pub keep_light: Option<u64>,
    /// Drop the vertices of the output that its light does not need. Has no effect with `max_edge`.
    #[serde(skip_serializing)]
    pub simplify: bool,
    /// Weigh point lights by the cosine of an imaginary horizontal plane instead of evenly by solid angle.
    pub planar_point_lights: bool,
}

/// Contrast that is aimed at over the error asked for. A third as much doubles the vertices of a room with even light.
const CONTRAST: f64 = 3.0;

/// Coarsest shooting patches that an error is met with: half of a room's length.
const COARSEST_SHOOTERS: f64 = 0.4;

/// Finest ones: fifty to the length of a room, some ten thousand shares.
const FINEST_SHOOTERS: f64 = 0.02;

/// Rays to a hemisphere for a relative L2 error of the radiosity: the noise of n Owen-scrambled rays falls as n^(-3/4).
#[must_use]
pub fn rays_for(error: f64) -> f64 {
    2048.0 * more_rays(0.01, error)
}

/// How many times as many rays bring a noise down to an error.
#[must_use]
pub fn more_rays(noise: f64, error: f64) -> f64 {
    (noise / error).powf(4.0 / 3.0)
}

fn whole_rays(rays: f64) -> u32 {
    rays.round().clamp(4.0, 262_144.0) as u32
}

impl BakeSettings {
    /// Vertices that a bake may have where none are asked for.
    pub const LEAST_MAX_VERTICES: usize = 200_000;

    /// Most vertices of the file.
    #[must_use]
    pub fn vertices_of_file(&self, scene: &Scene) -> usize {
        self.max_vertices.unwrap_or_else(|| Self::LEAST_MAX_VERTICES.max(2 * scene.vertex_count))
    }

    /// Size of the largest patches that are never divided, in the unit of the scene's extent.
    #[must_use]
    pub fn shortest_edge(&self, extent: f64) -> f64 {
        extent * 2.0_f64.powi(-(self.max_level as i32))
    }

    /// Most vertices of the mesh: of those of the file, some are of facets that are no part of it.
    #[must_use]
    pub fn most_vertices(&self, scene: &Scene) -> usize {
        self.vertices_of_file(scene).saturating_sub(scene.sealed_vertex_count)
    }

    /// The error asked for, or else that of the mesh.
    #[must_use]
    pub fn asked_error(&self) -> f64 {
        self.error.unwrap_or(self.mesh_error)
    }

    /// Settings to start from for a relative L2 error of the radiosity.
    ///
    /// The error of the mesh is shared out among receivers and shooters. That of the shooters was measured to be 2 to 6 %
    /// of the radiosity times their relative edge, in rooms; where a scene asks for finer ones, the bake finds out.
    #[must_use]
    pub fn for_error(error: f64) -> Self {
        Self {
            error: Some(error),
            contrast: Some(CONTRAST * error),
            shooter_edge: (11.0 * error).clamp(FINEST_SHOOTERS, COARSEST_SHOOTERS),
            mesh_error: 0.8 * error,
            threshold: 0.01 * error,
            ..Self::default()
        }
        .with_rays(rays_for(error))
    }

    /// Settings to start from for a picture of this quality.
    #[must_use]
    pub fn for_quality(quality: Quality) -> Self {
        let (error, contrast) = quality.errors();
        Self { quality: Some(quality), contrast: Some(contrast), ..Self::for_error(error) }
    }

    /// The same with so many rays to a hemisphere; a quarter of them at most for one pair.
    #[must_use]
    pub fn with_rays(self, rays_per_hemisphere: f64) -> Self {
        let rays = whole_rays(rays_per_hemisphere);
        let maximum_rays = (rays / 4).next_power_of_two().clamp(4, 1 << 16);
        Self { rays_per_hemisphere: rays, maximum_rays, ..self }
    }

    /// The same with this number of rays per hemisphere for light sources, if it is larger.
    #[must_use]
    pub fn with_rays_to_sources(self, rays_per_hemisphere: f64) -> Self {
        Self { rays_to_sources: Some(whole_rays(rays_per_hemisphere)), ..self }
    }

    /// Rays per hemisphere for light sources.
    #[must_use]
    pub fn most_rays(&self) -> u32 {
        self.rays_to_sources.unwrap_or(0).max(self.rays_per_hemisphere)
    }

    /// The same with another longest edge of the shooting patches.
    #[must_use]
    pub fn with_shooter_edge(self, edge: f64) -> Self {
        Self { shooter_edge: edge.clamp(FINEST_SHOOTERS, COARSEST_SHOOTERS), ..self }
    }

    /// Whether vertices of the output are dropped: its edges would become longer than `max_edge`.
    #[must_use]
    pub fn simplifies(&self) -> bool {
        self.simplify && self.max_edge.is_none()
    }

    /// Accuracy of the rows.
    #[must_use]
    pub fn precision(&self) -> Precision {
        Precision {
            rays_per_hemisphere: self.rays_per_hemisphere,
            minimum_rays: self.minimum_rays,
            maximum_rays: self.maximum_rays,
            seed: self.seed,
            exact_occluders: self.exact_occluders,
            form_factor_error: self.form_factor_error,
            factor_rounding: self.factor_rounding,
        }
    }
}

impl Default for BakeSettings {
    fn default() -> Self {
        let precision = Precision::DEFAULT;
        Self {
            error: None,
            quality: None,
            contrast: None,
            rows: RowStrategy::Automatic,
            shooter_edge: 0.15,
            mesh_error: 0.005,
            max_edge: None,
            max_vertices: None,
            row_cache: 2048,
            max_level: 12,
            threshold: 1e-6,
            window: 256,
            exact_occluders: precision.exact_occluders,
            rays_per_hemisphere: precision.rays_per_hemisphere,
            rays_to_sources: None,
            minimum_rays: precision.minimum_rays,
            maximum_rays: precision.maximum_rays,
            form_factor_error: precision.form_factor_error,
            factor_rounding: precision.factor_rounding,
            validation_samples: 256,
            seed: precision.seed,
            only: LightPart::All,
            groups: vec![],
            keep_light: None,
            simplify: true,
            planar_point_lights: false,
        }
    }
}
