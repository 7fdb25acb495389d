//! The energy balance of a solution.

use glam::DVec3;

use super::solved::Solved;
use crate::context::Context;
use crate::solver::balance::EnergyBalance;

/// A share whose row sums to more than this is enclosed: the rest to 1 is error, not sky.
const ENCLOSED: f64 = 0.999;

/// A scene whose shares see less than this of their hemisphere covered, in the mean, is open.
const OPEN: f64 = 0.99;

impl Solved {
    /// The energy balance.
    pub fn balance(&self, cx: &Context) -> EnergyBalance {
        let square_unit = cx.scene.frame.scale * cx.scene.frame.scale;
        let surfaces = &cx.scene.surfaces;
        let Self { mesh, solution, .. } = self;
        let (mut emitted, mut received, mut absorbed, mut escaped) =
            (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        for (id, patch) in mesh.mesh.leaves() {
            let surface = &surfaces[patch.surface as usize];
            let mean = solution.middles.mean(&mesh.mesh, id, mesh.mesh.mean(id, &solution.irradiance));
            emitted += surface.exitance * patch.area;
            // The rest passes through.
            let material = mesh.patch_materials.of(cx.scene, &mesh.mesh, id);
            absorbed += (material.opacity - material.reflectance) * mean * patch.area;
            let direct = solution.middles.mean_direct(&mesh.mesh, id, mesh.mesh.mean(id, &self.direct));
            received += material.opacity * direct * patch.area;
        }
        for (index, share) in mesh.shares.iter().enumerate() {
            if self.row_sums[index] < ENCLOSED {
                let leaving = mesh.materials[index].exitance + solution.radiosity[index];
                escaped += leaving * share.area * (1.0 - self.row_sums[index]);
            }
        }
        // What falls on the mesh of now: that of the first may have missed where the sun falls in.
        let grown = DVec3::select(
            self.sources.received.cmpgt(DVec3::ZERO),
            received / self.sources.received,
            DVec3::ONE,
        );
        let [from_lights, from_outside] =
            [self.sources.from_lights, self.sources.from_outside].map(|flux| grown * flux * square_unit);
        let [emitted, absorbed, unshot, escaped] =
            [emitted, absorbed, solution.unshot, escaped].map(|flux| flux * square_unit);
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
