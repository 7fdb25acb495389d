//! The energy balance of a solution.

use std::iter::Sum;

use glam::DVec3;
use rayon::prelude::*;

use super::solved::Solved;
use crate::context::Context;
use crate::mesh::PatchId;
use crate::rows::{ShareMesh, Solution};
use crate::solver::balance::EnergyBalance;
use scene::Scene;

/// A share whose row sums to more than this is enclosed: the rest to 1 is error, not sky.
const ENCLOSED: f64 = 0.999;

/// A scene whose shares see less than this of their hemisphere covered, in the mean, is open.
const OPEN: f64 = 0.99;

/// Leaves that a thread takes.
const AT_ONCE: usize = 4096;

/// Fluxes of leaves, in units of the frame.
#[derive(Default)]
struct Fluxes {
    emitted: DVec3,
    absorbed: DVec3,
    /// Straight from the sources.
    received: DVec3,
    /// What of it comes to leaves with light in their middle alone. From where is not known: from where that of the others comes.
    in_middles: DVec3,
    from_lights: DVec3,
    from_outside: DVec3,
}

/// The light of all vertices, and where it comes from.
struct Light<'a> {
    scene: &'a Scene,
    mesh: &'a ShareMesh,
    solution: &'a Solution,
    direct: &'a [DVec3],
    from_lights: &'a [DVec3],
    from_outside: &'a [DVec3],
}

impl Light<'_> {
    fn fluxes_of(&self, id: PatchId) -> Fluxes {
        let (mesh, middles) = (&self.mesh.mesh, &self.solution.middles);
        let material = self.mesh.patch_materials.of(self.scene, mesh, id);
        let area = mesh.patch(id).area;
        let mean = middles.mean(mesh, id, mesh.mean(id, &self.solution.irradiance));
        let of_corners = mesh.mean(id, self.direct);
        let received = middles.mean_direct(mesh, id, of_corners) * material.opacity * area;
        let is_known = of_corners.cmpgt(DVec3::ZERO);
        let part = |light: &[DVec3]| {
            DVec3::select(is_known, received * mesh.mean(id, light) / of_corners, DVec3::ZERO)
        };
        Fluxes {
            emitted: material.exitance * area,
            // The rest passes through.
            absorbed: (material.opacity - material.reflectance) * mean * area,
            received,
            in_middles: DVec3::select(is_known, DVec3::ZERO, received),
            from_lights: part(self.from_lights),
            from_outside: part(self.from_outside),
        }
    }
}

impl Sum for Fluxes {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |sum, one| Self {
            emitted: sum.emitted + one.emitted,
            absorbed: sum.absorbed + one.absorbed,
            received: sum.received + one.received,
            in_middles: sum.in_middles + one.in_middles,
            from_lights: sum.from_lights + one.from_lights,
            from_outside: sum.from_outside + one.from_outside,
        })
    }
}

impl Solved {
    /// The energy balance.
    pub fn balance(&self, cx: &Context) -> EnergyBalance {
        let square_unit = cx.scene.frame.scale * cx.scene.frame.scale;
        let Self { mesh, solution, direct, from_lights, from_outside, .. } = self;
        let light = Light { scene: cx.scene, mesh, solution, direct, from_lights, from_outside };
        let leaves: Vec<PatchId> = mesh.mesh.leaves().map(|(id, _)| id).collect();
        // Sums of parts of one size are the same whatever the number of threads.
        let of_some = |some: &[PatchId]| some.iter().map(|id| light.fluxes_of(*id)).sum::<Fluxes>();
        let parts: Vec<Fluxes> = leaves.par_chunks(AT_ONCE).map(of_some).collect();
        let all: Fluxes = parts.into_iter().sum();
        let mut escaped = DVec3::ZERO;
        for (index, share) in mesh.shares.iter().enumerate() {
            if self.row_sums[index] < ENCLOSED {
                let leaving = mesh.materials[index].exitance + solution.radiosity[index];
                escaped += leaving * share.area * (1.0 - self.row_sums[index]);
            }
        }
        let known = all.received - all.in_middles;
        let grown = DVec3::select(known.cmpgt(DVec3::ZERO), all.received / known, DVec3::ONE);
        let [from_lights, from_outside] =
            [all.from_lights, all.from_outside].map(|flux| grown * flux * square_unit);
        let [emitted, absorbed, unshot, escaped] =
            [all.emitted, all.absorbed, solution.unshot, escaped].map(|flux| flux * square_unit);
        let of_lights: DVec3 = cx.scene.lights.iter().map(|light| light.flux(&cx.scene.frame)).sum();
        let past = if self.is_open() { of_lights - from_lights } else { DVec3::ZERO };
        let emitted = emitted + of_lights + from_outside;
        EnergyBalance::new(emitted, absorbed, unshot, escaped + past.max(DVec3::ZERO))
    }

    /// Returns true when light can leave the scene. Light of a point light that hits no surface has then escaped; in a closed
    /// scene it is an error of the mesh. Shares that see next to nothing lie between surfaces and do not count.
    fn is_open(&self) -> bool {
        let seeing = self.row_sums.iter().zip(&self.mesh.energies).filter(|(sum, _)| **sum > 1.0 - ENCLOSED);
        let (covered, area) =
            seeing.fold((0.0, 0.0), |(c, a), (sum, share)| (c + sum.min(1.0) * share.area, a + share.area));
        covered < OPEN * area
    }
}
