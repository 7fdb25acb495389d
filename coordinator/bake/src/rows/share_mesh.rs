use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::context::Context;
use crate::materials::{self, AveragedMaterial, PatchMaterials};
use crate::mesh::{Mesh, PatchId, Share};
use crate::preview::preview;
use crate::solver::ShareEnergy;
use crate::solver::rooms::sum;
use scene::Scene;

/// Shares that a thread takes at a time.
const SHARES_AT_ONCE: usize = 4096;

/// The mesh, and its surface dealt out among shares that shoot.
pub struct ShareMesh {
    /// Its vertices receive.
    pub mesh: Mesh,
    /// They tile the mesh, and stay as they are when it is refined, until its leaves become the shares.
    pub shares: Vec<Share>,
    /// Averaged over each share.
    pub materials: Vec<AveragedMaterial>,
    /// Averaged over patches.
    pub patch_materials: PatchMaterials,
    /// The shares as the solver sees them.
    pub energies: Vec<ShareEnergy>,
}

impl ShareMesh {
    /// Averages the materials of the shares.
    pub fn new(scene: &Scene, mesh: Mesh, shares: Vec<Share>) -> Self {
        let patch_materials = PatchMaterials::default();
        let mut all = Self { mesh, shares: vec![], materials: vec![], patch_materials, energies: vec![] };
        all.deal_out(scene, shares);
        all
    }

    /// Deals the surface out among other shares.
    pub fn deal_out(&mut self, scene: &Scene, shares: Vec<Share>) {
        self.materials = materials::of_shares(scene, &self.mesh, &shares);
        let energy = |(share, material): (&Share, &AveragedMaterial)| ShareEnergy {
            receiver: share.vertex.index(),
            area: share.area,
            reflectance: material.reflectance,
        };
        self.energies = shares.iter().zip(&self.materials).map(energy).collect();
        self.shares = shares;
    }

    /// Radiosity that the shares reflect, where this irradiance falls on them.
    pub fn reflected(&self, incident: &[DVec3]) -> Vec<DVec3> {
        let all = self.energies.par_iter().zip(incident).with_min_len(SHARES_AT_ONCE);
        all.map(|(share, incident)| share.reflectance * *incident).collect()
    }

    /// Whether the shares were made on another mesh: then no vertex stands for one.
    pub fn is_overlaid(&self) -> bool {
        self.shares.iter().any(|share| share.corners.is_empty())
    }

    /// Radiosity that a leaf reflects, from the irradiance at its corners.
    pub fn leaf_radiosity(&self, scene: &Scene, id: PatchId, irradiance: &[DVec3]) -> DVec3 {
        let material = self.patch_materials.of(scene, &self.mesh, id);
        material.reflectance * self.mesh.mean(id, irradiance)
    }

    /// Reflected flux over incident flux, where the shares have this radiosity.
    pub fn mean_reflectance(&self, radiosity: &[DVec3]) -> f64 {
        let of_share = |share: usize| {
            let ShareEnergy { area, reflectance, .. } = self.energies[share];
            let lit = reflectance.cmpgt(DVec3::ZERO);
            let incident = DVec3::select(lit, radiosity[share] / reflectance, DVec3::ZERO);
            DVec2::new(radiosity[share].element_sum(), incident.element_sum()) * area
        };
        let DVec2 { x: reflected, y: incident } = sum(self.energies.len(), of_share);
        if incident > 0.0 { reflected / incident } else { 0.0 }
    }

    /// Radiosity that each share should still shoot, where it gets this irradiance and has shot so much.
    pub fn unshot(&self, irradiance: &[DVec3], shot: &[DVec3]) -> Vec<DVec3> {
        let states = self.energies.iter().zip(irradiance).zip(shot);
        states.map(|((share, irradiance), shot)| share.reflectance * *irradiance - *shot).collect()
    }

    /// Hands a preview to the observer, if it wants one: of the irradiance at the vertices and the unshot radiosity of the
    /// shares.
    pub fn preview(
        &self,
        cx: &mut Context,
        direct: &[DVec3],
        state: impl FnOnce() -> (Vec<DVec3>, Vec<DVec3>),
    ) {
        let (scene, part) = (cx.scene, cx.settings.only);
        cx.client.monitor.preview(|| {
            let (irradiance, unshot) = state();
            preview(scene, &self.mesh, &self.shares, (&irradiance, direct), &unshot, part)
        });
    }
}
