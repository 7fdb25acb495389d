//! Materials averaged over shares and patches, where textures vary over them.

use glam::DVec3;
use kernel::geometry::area_vector;
use rayon::prelude::*;

use crate::mesh::{Mesh, PatchId, Share, overlap};
use scene::{Scene, Surface};

/// A material averaged over a part of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AveragedMaterial {
    /// Reflectance.
    pub reflectance: DVec3,
    /// Exitance.
    pub exitance: DVec3,
    /// Part of the light that is stopped: the rest passes.
    pub opacity: f64,
}

impl AveragedMaterial {
    /// The material of a uniform surface.
    fn uniform(surface: &Surface) -> Self {
        Self { reflectance: surface.reflectance, exitance: surface.exitance, opacity: surface.opacity }
    }

    /// The mean of materials over these areas; `None` where there is no area.
    fn mean(parts: impl Iterator<Item = (Self, f64)>) -> Option<Self> {
        let (mut area, mut sums) =
            (0.0, Self { reflectance: DVec3::ZERO, exitance: DVec3::ZERO, opacity: 0.0 });
        for (part, own) in parts {
            area += own;
            sums.reflectance += part.reflectance * own;
            sums.exitance += part.exitance * own;
            sums.opacity += part.opacity * own;
        }
        (area > 0.0).then(|| Self {
            reflectance: sums.reflectance / area,
            exitance: sums.exitance / area,
            opacity: sums.opacity / area,
        })
    }

    /// Averages over a polygon of a facet, with its area.
    fn over(surface: &Surface, facet: u32, polygon: &[DVec3]) -> (Self, f64) {
        let (reflectance, exitance, opacity) = surface.mean_material(facet, polygon);
        (Self { reflectance, exitance, opacity }, area_vector(polygon).length())
    }
}

/// Averages over each share.
pub fn of_shares(scene: &Scene, mesh: &Mesh, shares: &[Share]) -> Vec<AveragedMaterial> {
    let surface_of = |id: PatchId| &scene.surfaces[mesh.patch(id).surface as usize];
    let of_share = |share: &Share| {
        let surface = &scene.surfaces[share.surface as usize];
        let is_like = |other: &Surface| {
            other.appearance.is_none()
                && AveragedMaterial::uniform(other) == AveragedMaterial::uniform(surface)
        };
        let mut leaves = share.corners.iter().chain(&share.overlaps);
        if leaves.all(|(id, _)| is_like(surface_of(*id))) {
            return AveragedMaterial::uniform(surface);
        }
        let parts = share.corners.chunk_by(|a, b| a.0 == b.0).flat_map(|own| {
            let (id, patch) = (own[0].0, mesh.patch(own[0].0));
            let polygons = if own.len() == patch.corners.len() {
                vec![mesh.corners(id)]
            } else {
                own.iter().map(|(id, corner)| mesh.corner_quad(*id, *corner).to_vec()).collect()
            };
            polygons
                .into_iter()
                .map(move |polygon| AveragedMaterial::over(surface_of(id), patch.facet, &polygon))
        });
        let covered = share.overlaps.iter().map(|(id, polygon)| {
            let part = overlap(&share.polygons[*polygon].corners, &mesh.corners(*id));
            AveragedMaterial::over(surface_of(*id), mesh.patch(*id).facet, &part)
        });
        AveragedMaterial::mean(parts.chain(covered)).unwrap_or(AveragedMaterial::uniform(surface))
    };
    shares.par_iter().map(of_share).collect()
}

/// Averages over patches, as far as they were computed.
#[derive(Default)]
pub struct PatchMaterials {
    known: Vec<Option<AveragedMaterial>>,
}

impl PatchMaterials {
    /// Computes those of all leaves of a mesh.
    pub fn update(&mut self, scene: &Scene, mesh: &Mesh) {
        self.known.resize(mesh.patches.len(), None);
        let varies = |id: &PatchId| scene.surfaces[mesh.patch(*id).surface as usize].appearance.is_some();
        let unknown: Vec<PatchId> = mesh
            .leaves()
            .map(|(id, _)| id)
            .filter(|id| varies(id) && self.known[id.index()].is_none())
            .collect();
        let found: Vec<(PatchId, AveragedMaterial)> =
            unknown.into_par_iter().map(|id| (id, of_patch(scene, mesh, id))).collect();
        for (id, material) in found {
            self.known[id.index()] = Some(material);
        }
    }

    /// Returns the average over a patch.
    pub fn of(&self, scene: &Scene, mesh: &Mesh, id: PatchId) -> AveragedMaterial {
        let known = self.known.get(id.index()).copied().flatten();
        known.unwrap_or_else(|| of_patch(scene, mesh, id))
    }
}

fn of_patch(scene: &Scene, mesh: &Mesh, id: PatchId) -> AveragedMaterial {
    let patch = mesh.patch(id);
    let surface = &scene.surfaces[patch.surface as usize];
    if surface.appearance.is_none() {
        return AveragedMaterial::uniform(surface);
    }
    AveragedMaterial::over(surface, patch.facet, &mesh.corners(id)).0
}
