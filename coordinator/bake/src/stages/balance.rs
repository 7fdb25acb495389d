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
        let Self { mesh, solution, .. } = self;
        let (mut emitted, mut absorbed, mut escaped) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        let (mut received, mut from_lights, mut from_outside) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        // Of leaves with light in their middle alone it is not known where it comes from: as that of the others.
        let mut in_middles = DVec3::ZERO;
        for (id, patch) in mesh.mesh.leaves() {
            let material = mesh.patch_materials.of(cx.scene, &mesh.mesh, id);
            emitted += material.exitance * patch.area;
            let mean = solution.middles.mean(&mesh.mesh, id, mesh.mesh.mean(id, &solution.irradiance));
            // The rest passes through.
            absorbed += (material.opacity - material.reflectance) * mean * patch.area;
            let of_corners = mesh.mesh.mean(id, &self.direct);
            let all =
                solution.middles.mean_direct(&mesh.mesh, id, of_corners) * material.opacity * patch.area;
            let is_known = of_corners.cmpgt(DVec3::ZERO);
            let part = |light: &[DVec3]| {
                DVec3::select(is_known, all * mesh.mesh.mean(id, light) / of_corners, DVec3::ZERO)
            };
            received += all;
            in_middles += DVec3::select(is_known, DVec3::ZERO, all);
            from_lights += part(&self.from_lights);
            from_outside += part(&self.from_outside);
        }
        for (index, share) in mesh.shares.iter().enumerate() {
            if self.row_sums[index] < ENCLOSED {
                let leaving = mesh.materials[index].exitance + solution.radiosity[index];
                escaped += leaving * share.area * (1.0 - self.row_sums[index]);
            }
        }
        let known = received - in_middles;
        let grown = DVec3::select(known.cmpgt(DVec3::ZERO), received / known, DVec3::ONE);
        let [from_lights, from_outside] = [from_lights, from_outside].map(|flux| grown * flux * square_unit);
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
