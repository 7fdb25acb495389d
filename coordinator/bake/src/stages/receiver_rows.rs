//! Bakes of finely tessellated scenes: the rows are those of receivers, by rays.
//!
//! A shooter's row is exact, but what stands between is looked at for every pair, and pairs grow with the square of the mesh. In a
//! scene of a hundred thousand small triangles the answer hardly depends on any one of them: there each receiver sends rays over its
//! hemisphere, and its row tells what they meet. The time is linear in the number of vertices. Turned round, these rows are
//! the same rows of shares that shooting takes; only the leaves of the mesh take the place of the shares around vertices, since
//! a ray meets one of them.
//!
//! Light sources keep their exact rows: a small bright lamp would be found by few rays.

use glam::DVec3;
use kernel::geometry::ConvexPolygon;
use kernel::replica::{Receivers, ScenePolygons};

use super::settings::RowStrategy;
use super::settle::Means;
use super::share_rows::{COARSE, rows_of_hemispheres};
use super::shoot::LEAST_SHOOTING;
use super::{Bake, BakeError, BakeSettings};
use crate::mesh::{Mesh, Patch, PatchId, Surroundings, VertexId, surroundings};
use crate::solver::acceleration::Acceleration;
use scene::{Scene, Side};

/// Facets of a scene from which on rows are those of receivers, unless they are asked for otherwise.
const MANY_FACETS: usize = 5000;

/// Of facets with smooth normals fewer are enough: they stand for curved surfaces, where many small occluders crowd each shaft.
const MANY_SMOOTH_FACETS: usize = 1000;

/// Passes end here even if the accuracy was not reached; the bound is reported.
const MOST_PASSES: u32 = 1000;

/// Whether a scene is baked with the rows of receivers.
pub fn suit(scene: &Scene, settings: &BakeSettings) -> bool {
    match settings.rows {
        RowStrategy::Exact => false,
        RowStrategy::Gather => true,
        RowStrategy::Automatic => {
            let facets = || {
                scene.surfaces.iter().filter(|surface| surface.side == Side::Front).flat_map(|s| &s.facets)
            };
            let smooth = facets().filter(|f| f.corners.iter().any(|corner| corner.normal != f.normal));
            facets().count() >= MANY_FACETS || smooth.count() >= MANY_SMOOTH_FACETS
        }
    }
}

/// Width of a vertex's surroundings, relative to the longest edge of the shooters, from which on it gets all rays of a hemisphere.
const WIDE: f64 = 0.125;

/// Least part of the rays that a vertex gets.
const LEAST_PART: f64 = 0.125;

/// Rays of each vertex of a mesh from `first` on: the fewer, the smaller its surroundings are. Where vertices lie close together, the
/// light of a piece of surface is the mean of many, and so is their noise.
pub fn rays(
    mesh: &Mesh,
    first: VertexId,
    settings: &BakeSettings,
    extent: f64,
) -> impl Fn(usize) -> u32 + use<> {
    let wide = WIDE * settings.shooter_edge * extent;
    let all = settings.rays_per_hemisphere;
    let of = move |around: &Surroundings| {
        let part = (around.area.sqrt() / wide).clamp(LEAST_PART, 1.0);
        // A power of two has the most even directions.
        ((f64::from(all) * part) as u32).next_power_of_two().min(all)
    };
    let rays: Vec<u32> = surroundings(mesh, first).iter().map(of).collect();
    move |vertex| rays[vertex]
}

/// These leaves as rays see them, each with its opacity where one is not opaque.
pub fn seen(scene: &Scene, mesh: &Mesh, leaves: impl Iterator<Item = PatchId>) -> ScenePolygons {
    let mut seen = ScenePolygons::default();
    for id in leaves {
        let patch = mesh.patch(id);
        let surface = &scene.surfaces[patch.surface as usize];
        let corners: Vec<DVec3> = patch.corners.iter().map(|corner| mesh.position(*corner)).collect();
        let opacity = if surface.opacity < 1.0 { surface.mean_opacity(patch.facet, &corners) } else { 1.0 };
        let plane = surface.facets[patch.facet as usize].plane;
        seen.polygons.push(ConvexPolygon { plane, corners });
        seen.opacities.push(opacity.clamp(0.0, 1.0) as f32);
    }
    if seen.opacities.iter().all(|opacity| *opacity == 1.0) {
        seen.opacities.clear();
    }
    seen
}

/// Of the edge of shooters: leaves, whose light is constant, are made finer than shares are, since they cost next to nothing.
const EDGE_FACTOR: f64 = 1.0 / 3.0;

/// Factor of the longest edge of the mesh that light is shot from.
pub fn edge_factor(scene: &Scene, settings: &BakeSettings) -> f64 {
    if suit(scene, settings) { EDGE_FACTOR } else { 1.0 }
}

impl Bake<'_, '_> {
    /// The first solution, good enough to see where the mesh must be refined.
    pub(super) fn start_from_receivers(&mut self) -> Result<(), BakeError> {
        self.look_at_rows(COARSE, |_, _| ())?;
        let means = Means::new(&self.mesh, &self.shares, &self.exposed);
        self.solve_over_receivers(&means, self.settings.threshold.max(LEAST_SHOOTING))?;
        self.end_step("shoot");
        Ok(())
    }

    /// Passes light on between receivers and shares until what is left is under `tolerance`: each share takes the mean of its part of the
    /// mesh, each receiver what its row gives it.
    pub(super) fn solve_over_receivers(&mut self, means: &Means, tolerance: f64) -> Result<(), BakeError> {
        let flux = |radiosity: &[DVec3], areas: &[f64]| -> DVec3 {
            radiosity.iter().zip(areas).map(|(value, area)| *value * *area).sum()
        };
        let areas: Vec<f64> = self.energies.iter().map(|share| share.area).collect();
        let mut acceleration = Acceleration::new(areas.clone());
        for _ in 0..MOST_PASSES {
            self.gather()?;
            self.show();
            self.spent.sweeps += 1;
            let reflected = |(share, mean): (&crate::solver::ShareEnergy, DVec3)| share.reflectance * mean;
            let next: Vec<DVec3> =
                self.energies.iter().zip(means.of(&self.irradiance)).map(reflected).collect();
            let changes: Vec<DVec3> =
                next.iter().zip(&self.radiosity).map(|(new, old)| (*new - *old).abs()).collect();
            let (changed, all) = (flux(&changes, &areas), flux(&next, &areas).element_sum());
            self.unshot = changed;
            self.residual = if all > 0.0 { changed.element_sum() / all } else { 0.0 };
            let before = std::mem::replace(&mut self.radiosity, next);
            let reflectance = self.mean_reflectance();
            self.unshot_bound = self.residual * reflectance / (1.0 - reflectance);
            self.office.set_unshot(self.unshot_bound);
            if self.unshot_bound <= tolerance {
                break;
            }
            self.radiosity = acceleration.next(before, &self.radiosity);
        }
        self.gather()
    }

    /// What the leaves of the refined mesh give receivers, by the rays of their hemispheres, each leaf with its own mean radiosity.
    pub(super) fn seen_of_leaves(
        &mut self,
        receivers: &Receivers,
        irradiance: &[DVec3],
    ) -> Result<Vec<DVec3>, BakeError> {
        let radiosity = |(id, patch): (PatchId, &Patch)| {
            let corners = patch.corners.iter().map(|corner| irradiance[corner.index()]);
            let mean = corners.sum::<DVec3>() / patch.corners.len() as f64;
            self.patch_looks.of(self.scene, &self.mesh, id).reflectance * mean
        };
        let radiosities: Vec<DVec3> = self.mesh.leaves().map(radiosity).collect();
        let seen = seen(self.scene, &self.mesh, self.mesh.leaves().map(|(id, _)| id));
        let set = self.office.publish_polygons(&seen.polygons, &seen.opacities);
        let mut gathered = self.channels.gathering(receivers.receivers.len());
        let rows = rows_of_hemispheres(self.office, set, receivers, |_| self.settings.rays_per_hemisphere)?;
        for (row, radiosity) in rows.iter().zip(radiosities) {
            gathered.add(row, radiosity);
        }
        self.office.release_receivers(set);
        Ok(gathered.into_irradiance())
    }
}
