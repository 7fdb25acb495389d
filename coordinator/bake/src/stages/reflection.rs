//! What shares and patches reflect, emit and take: means over their area, where that varies over their surface.

use glam::DVec3;
use kernel::geometry::area_vector;
use rayon::prelude::*;

use crate::mesh::{Mesh, PatchId, Share};
use scene::{Scene, Surface};

/// Means over a part of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanLook {
    /// Reflectance.
    pub reflectance: DVec3,
    /// Exitance.
    pub exitance: DVec3,
    /// Part of the light that is taken: the other part passes.
    pub opacity: f64,
}

impl MeanLook {
    /// Of a uniform surface.
    fn uniform(surface: &Surface) -> Self {
        Self { reflectance: surface.reflectance, exitance: surface.exitance, opacity: surface.opacity }
    }

    /// Over polygons of facets, as long as they have an area.
    fn over(surface: &Surface, polygons: impl Iterator<Item = (u32, Vec<DVec3>)>) -> Self {
        let (mut area, mut sums) =
            (0.0, Self { reflectance: DVec3::ZERO, exitance: DVec3::ZERO, opacity: 0.0 });
        for (facet, polygon) in polygons {
            let own = area_vector(&polygon).length();
            area += own;
            sums.reflectance += surface.mean_reflectance(facet, &polygon) * own;
            sums.exitance += surface.mean_exitance(facet, &polygon) * own;
            sums.opacity += surface.mean_opacity(facet, &polygon) * own;
        }
        if area == 0.0 {
            return Self::uniform(surface);
        }
        Self {
            reflectance: sums.reflectance / area,
            exitance: sums.exitance / area,
            opacity: sums.opacity / area,
        }
    }
}

/// Means over each share.
pub fn of_shares(scene: &Scene, mesh: &Mesh, shares: &[Share]) -> Vec<MeanLook> {
    let of_share = |share: &Share| {
        let surface = &scene.surfaces[share.surface as usize];
        if surface.appearance.is_none() {
            return MeanLook::uniform(surface);
        }
        let parts = share.corners.chunk_by(|a, b| a.0 == b.0).flat_map(|own| {
            let (id, patch) = (own[0].0, mesh.patch(own[0].0));
            let polygons = if own.len() == patch.corners.len() {
                vec![outline(mesh, id)]
            } else {
                own.iter().map(|(id, corner)| mesh.corner_quad(*id, *corner).to_vec()).collect()
            };
            polygons.into_iter().map(|polygon| (patch.facet, polygon))
        });
        MeanLook::over(surface, parts)
    };
    shares.par_iter().map(of_share).collect()
}

/// Means over patches, once they were asked for.
#[derive(Default)]
pub struct PatchLooks {
    known: Vec<Option<MeanLook>>,
}

impl PatchLooks {
    /// Learns what the leaves of a mesh have.
    pub fn learn(&mut self, scene: &Scene, mesh: &Mesh) {
        self.known.resize(mesh.patches.len(), None);
        let varies = |id: &PatchId| scene.surfaces[mesh.patch(*id).surface as usize].appearance.is_some();
        let unknown: Vec<PatchId> = mesh
            .leaves()
            .map(|(id, _)| id)
            .filter(|id| varies(id) && self.known[id.index()].is_none())
            .collect();
        let found: Vec<(PatchId, MeanLook)> =
            unknown.into_par_iter().map(|id| (id, of_patch(scene, mesh, id))).collect();
        for (id, look) in found {
            self.known[id.index()] = Some(look);
        }
    }

    /// What a patch has in the mean.
    pub fn of(&self, scene: &Scene, mesh: &Mesh, id: PatchId) -> MeanLook {
        let known = self.known.get(id.index()).copied().flatten();
        known.unwrap_or_else(|| of_patch(scene, mesh, id))
    }
}

fn of_patch(scene: &Scene, mesh: &Mesh, id: PatchId) -> MeanLook {
    let patch = mesh.patch(id);
    let surface = &scene.surfaces[patch.surface as usize];
    if surface.appearance.is_none() {
        return MeanLook::uniform(surface);
    }
    MeanLook::over(surface, std::iter::once((patch.facet, outline(mesh, id))))
}

fn outline(mesh: &Mesh, id: PatchId) -> Vec<DVec3> {
    mesh.patch(id).corners.iter().map(|corner| mesh.position(*corner)).collect()
}
