//! Kept light: what relighting needs of a finished bake.

use std::collections::HashSet;

use glam::{DVec3, Vec3};
use kernel::replica::Digest;

use super::RelightError;
use crate::error_budget::ErrorBudget;
use crate::mesh::{Mesh, PatchId};
use crate::refinement::SamplePoints;
use crate::settings::{BakeSettings, RowStrategy};
use crate::stages::ShootingMesh;
use scene::Scene;

/// Kept light: what relighting needs of a finished bake.
#[derive(Debug, Clone, PartialEq)]
pub struct KeptLight {
    /// Of the scene.
    pub(super) scene: Digest,
    /// Radiance of its sky.
    pub(super) sky: DVec3,
    /// How the mesh of the shares was made.
    pub(super) shooting: MeshSettings,
    /// Patches that were divided since, in order.
    pub(super) divided: Vec<PatchId>,
    /// Vertices of the mesh.
    pub(super) vertices: usize,
    /// The light of each light source.
    pub(super) parts: Vec<KeptPart>,
    /// Where the error was measured.
    pub(super) validation: SamplePoints,
    /// Reflected flux over incident flux.
    pub(super) reflectance: f64,
    /// Of the finished bake.
    pub(super) error: ErrorBudget,
    /// Drop the vertices of the output that its light does not need.
    pub(super) simplify: bool,
}

/// What the shooting mesh depends on beside the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MeshSettings {
    /// Longest edge, relative to the scene's extent.
    pub(super) edge: f64,
    /// Patches are divided this often at most.
    pub(super) max_level: u32,
    /// Most vertices.
    pub(super) max_vertices: usize,
    /// The error by which shadow lines were chosen.
    pub(super) line_error: f64,
    /// Whether rows were gathered.
    pub(super) is_gathered: bool,
}

/// The light of all sources of the same names.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct KeptPart {
    /// Of nodes and materials, or of the sky.
    pub(super) names: Vec<String>,
    /// Its light is kept as that of a sky of unit radiance.
    pub(super) is_sky: bool,
    /// Factor that gives its light as baked.
    pub(super) as_baked: DVec3,
    /// Irradiance of the vertices, straight from the sources.
    pub(super) direct: Vec<Vec3>,
    /// Irradiance of the vertices, in all.
    pub(super) irradiance: Vec<Vec3>,
    /// Irradiance of the validation samples, in all.
    pub(super) gathered: Vec<DVec3>,
    /// Standard error from rays for a factor of 1, relative to the whole light of the bake.
    pub(super) noise: f64,
    /// Residual flux of the solution, relative to its reflected flux.
    pub(super) residual: f64,
}

impl KeptLight {
    /// Radiance of the sky that the scene was baked with.
    #[must_use]
    pub fn sky(&self) -> DVec3 {
        self.sky
    }

    /// Names of the lights that can be changed.
    #[must_use]
    pub fn lights(&self) -> Vec<&str> {
        let mut seen = HashSet::new();
        let names = self.parts.iter().flat_map(|part| &part.names).map(String::as_str);
        names.filter(|name| seen.insert(*name)).collect()
    }

    /// The mesh of the finished bake.
    pub(super) fn mesh(&self, scene: &Scene) -> Result<Mesh, RelightError> {
        let MeshSettings { edge, max_level, max_vertices, line_error, is_gathered } = self.shooting;
        let settings = BakeSettings {
            mesh_error: line_error,
            rows: if is_gathered { RowStrategy::Gather } else { RowStrategy::Exact },
            shooter_edge: edge,
            max_level,
            max_vertices: Some(max_vertices),
            ..BakeSettings::default()
        };
        let other = || RelightError::Damaged("its mesh is not one of the scene".into());
        let ShootingMesh { mut mesh, .. } = ShootingMesh::new(scene, &settings);
        for id in &self.divided {
            // Neighbours of a divided patch may have been divided with it.
            if mesh.patches.len() <= id.index() || mesh.vertices.len() > self.vertices {
                return Err(other());
            }
            mesh.divide(*id);
        }
        if mesh.vertices.len() != self.vertices || !self.validation.lie_on(&mesh) {
            return Err(other());
        }
        Ok(mesh)
    }

    /// Sum over some parts, each multiplied by its factor.
    pub(super) fn sum<'a>(
        &'a self,
        factors: &[DVec3],
        counts: impl Fn(&KeptPart) -> bool,
        of: impl Fn(&'a KeptPart) -> &'a Vec<Vec3>,
    ) -> Vec<DVec3> {
        let mut sums = vec![DVec3::ZERO; self.vertices];
        for (part, factor) in self.parts.iter().zip(factors).filter(|(part, _)| counts(part)) {
            for (sum, value) in sums.iter_mut().zip(of(part)) {
                *sum += value.as_dvec3() * *factor;
            }
        }
        sums
    }

    /// The validation samples with the light of all parts, each multiplied by its factor.
    pub(super) fn validation_lit_by(&self, factors: &[DVec3]) -> SamplePoints {
        let mut sums = vec![DVec3::ZERO; self.validation.count()];
        for (part, factor) in self.parts.iter().zip(factors) {
            sums.iter_mut().zip(&part.gathered).for_each(|(sum, value)| *sum += *value * *factor);
        }
        let mut lit = self.validation.clone();
        // That of other light is not known: of each part all is kept together.
        lit.set_direct(vec![]);
        lit.set_irradiance(sums);
        lit
    }
}
