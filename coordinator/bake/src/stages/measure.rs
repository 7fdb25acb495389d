//! Measuring the error of the answer, and what follows from it.

use glam::DVec3;
use kernel::geometry::ConvexPolygon;
use kernel::row::{Shape, Shooter};

use super::budget::rounding_error;
use super::checks::{Checks, FIRST};
use super::refine::NOISE_HIDES;
use super::{Bake, BakeError, BakeSettings, ErrorBudget, Phase, light, shooting_mesh};
use crate::mesh::Mesh;
use crate::solver::fit::best_fit;

/// Key of the first leaf as a shooter: above all shares and light sources.
const FIRST_LEAF_KEY: u64 = 1 << 40;

/// Mean square of the weights with which a random point of a triangle takes the noise of its three vertices.
pub(super) const INTERPOLATED_NOISE: f64 = 0.5;

/// Light that is in the wrong place comes back after reflection at about half of its strength: transfer between the surfaces of
/// a room evens out the finer patterns and keeps the coarse ones.
pub(super) const RETURNING: f64 = 0.5;

/// Part of the asked error that the shooters may take after a new start.
const SHOOTERS_PART: f64 = 0.5;

/// Part of the asked error that the rays may take after a new start.
const RAYS_PART: f64 = 0.3;

/// What is left to the interpolation is aimed at with this margin.
const MARGIN: f64 = 0.9;

/// The interpolation must be left this part of the asked error at least: else it would have to pay for others.
const LEAST_REST: f64 = 0.4;

/// Factor of the limit of refinement where the error was found too large and no patch was divided.
const UNSEEN_STEP: f64 = 0.7;

/// Part of the interpolation error that is aimed at, at least, before it is measured again: the finer mesh tells better what the
/// others leave to it, and vertices too many cannot be taken back.
const LONGEST_STEP: f64 = 0.6;

/// Refining, settling and measuring are repeated this often at most.
const MAX_ROUNDS: u32 = 12;

/// Most new starts.
const MAX_RESTARTS: u32 = 3;

impl Bake<'_, '_> {
    /// Refines, settles and measures, until the asked error is met or something else than interpolation is in the way.
    pub(super) fn meet_error(&mut self) -> Result<(), BakeError> {
        let mut limit = MARGIN * self.settings.mesh_error;
        for _ in 0..MAX_ROUNDS {
            let vertices = self.mesh.vertices.len();
            self.refine(limit)?;
            self.settle()?;
            self.measure()?;
            let rest = match self.settings.error {
                Some(asked) => without(asked, self.error.without_receivers()),
                None => self.settings.mesh_error,
            };
            let others_in_the_way = self.settings.error.is_some_and(|asked| rest < LEAST_REST * asked);
            let is_met = self.error.receivers <= rest || self.guides.count() == 0;
            if is_met || others_in_the_way || self.mesh_obstacle.is_some() {
                break;
            }
            // Where the prediction did not see what was found, only a lower limit goes on.
            let is_unchanged = self.mesh.vertices.len() == vertices;
            let step = LONGEST_STEP * self.error.receivers;
            limit = if is_unchanged { limit * UNSEEN_STEP } else { (MARGIN * rest).max(step) };
        }
        Ok(())
    }

    /// Estimates the error of the answer as it stands.
    #[tracing::instrument(skip_all)]
    fn measure(&mut self) -> Result<(), BakeError> {
        self.office.enter(Phase::Measure, self.mesh.vertices.len());
        self.patch_looks.learn(self.scene, &self.mesh);
        let fitted = best_fit(&self.mesh, &self.irradiance);
        let prediction = self.predict();
        // Points of their own: the mesh was refined where the guides found errors, and is better there than elsewhere.
        self.rounds_measured += 1;
        let mut checks =
            Checks::draw(&self.mesh, self.scene, self.settings, prediction.leaves(), self.rounds_measured);
        self.light_checks(&mut checks)?;
        let noise = self.noise();
        let receivers = if checks.count() > 0 {
            receivers_error(&checks, &self.mesh, &fitted, self.mean_reflectance(), noise)
        } else {
            self.found_per_predicted * prediction.relative()
        };
        if prediction.relative() > 0.0 && checks.count() > 0 {
            self.found_per_predicted = (receivers / prediction.relative()).clamp(0.2, 5.0);
        }
        let (gathered, noise_of_leaves) = self.gathered_from_leaves(&checks, &fitted)?;
        let differences = checks.relative(checks.differences(&gathered).into_iter());
        // The same rays meet shares and leaves where they are those of hemispheres.
        let noise_of_both = if self.is_gathered { 0.0 } else { noise.hypot(noise_of_leaves) };
        let shooters =
            without_noise(differences, noise_of_both) / (1.0 - RETURNING * self.mean_reflectance());
        let form_factors = self.office.factor_error() + rounding_error(self.settings.factor_rounding);
        let visibility = noise * INTERPOLATED_NOISE.sqrt();
        let unshot = self.residual / (1.0 - RETURNING * self.mean_reflectance());
        self.error = ErrorBudget::new(unshot, visibility, form_factors, receivers, shooters);
        self.office.set_error(Some(self.error.total));
        self.checks = checks;
        self.end_step("measure");
        Ok(())
    }

    /// Gathers the light of all sources and shares at check points.
    fn light_checks(&mut self, checks: &mut Checks) -> Result<(), BakeError> {
        if checks.count() == 0 {
            return Ok(());
        }
        let receivers = checks.receivers(checks.count());
        let set = self.office.publish_receivers(&receivers);
        checks.set_direct(light::irradiance(&self.sources, set, self.office, |_, _, _| ())?);
        let mut gathered = self.channels.gathering(set.count());
        let radiosity = &self.radiosity;
        self.rows
            .each_over(self.office, set, &receivers, |share, row| gathered.add(row, radiosity[share]))?;
        checks.set_gathered(gathered);
        self.office.release_receivers(set);
        Ok(())
    }

    /// Relative standard error of irradiance at a point, from the rays that sampled visibility.
    pub(super) fn noise(&self) -> f64 {
        let Some(guides) = self.guide_set else { return 0.0 };
        let sources =
            self.sources.iter().map(|source| source.strength).zip(self.guide_variances.iter().copied());
        let shares = self.radiosity.iter().copied().zip(self.rows.variances(guides));
        self.guides.noise(shares.chain(sources), self.guides.count()).hypot(self.ray_noise)
    }

    /// What the leaves of the refined mesh give the first check points, each with its own mean radiosity; and the noise of it.
    fn gathered_from_leaves(
        &mut self,
        checks: &Checks,
        irradiance: &[DVec3],
    ) -> Result<(Vec<DVec3>, f64), BakeError> {
        let count = checks.count().min(FIRST);
        if count == 0 {
            return Ok((vec![], 0.0));
        }
        if self.is_gathered {
            return Ok((self.seen_of_leaves(&checks.receivers(count), irradiance)?, 0.0));
        }
        let (mut shooters, mut radiosities) = (vec![], vec![]);
        for (id, patch) in self.mesh.leaves() {
            let mean = patch.corners.iter().map(|corner| irradiance[corner.index()]).sum::<DVec3>()
                / patch.corners.len() as f64;
            let surface = &self.scene.surfaces[patch.surface as usize];
            let reflected = self.patch_looks.of(self.scene, &self.mesh, id).reflectance * mean;
            if reflected == DVec3::ZERO {
                continue;
            }
            let corners = patch.corners.iter().map(|corner| self.mesh.position(*corner)).collect();
            let polygon = ConvexPolygon { plane: surface.facets[patch.facet as usize].plane, corners };
            shooters.push(Shooter {
                key: FIRST_LEAF_KEY + u64::from(id.0),
                shape: Shape::Polygons(vec![polygon]),
            });
            radiosities.push(reflected);
        }
        let set = self.office.publish_receivers(&checks.receivers(count));
        let mut gathered = self.channels.gathering(count);
        let mut lights = Vec::with_capacity(shooters.len());
        self.office.each_row(&shooters, set, |leaf, row, variance| {
            gathered.add(row, radiosities[leaf]);
            lights.push((radiosities[leaf], variance));
        })?;
        self.office.release_receivers(set);
        Ok((gathered.into_irradiance(), checks.noise(lights.into_iter(), count)))
    }

    /// Reflected flux over incident flux.
    pub(super) fn mean_reflectance(&self) -> f64 {
        let (mut reflected, mut incident) = (0.0, 0.0);
        for (share, radiosity) in self.energies.iter().zip(&self.radiosity) {
            reflected += radiosity.element_sum() * share.area;
            let lit = share.reflectance.cmpgt(DVec3::ZERO);
            incident +=
                DVec3::select(lit, *radiosity / share.reflectance, DVec3::ZERO).element_sum() * share.area;
        }
        if incident > 0.0 { reflected / incident } else { 0.0 }
    }

    /// Settings that should meet the asked error where these did not; `None` when it is met, or cannot be.
    pub(super) fn better_settings(&self) -> Option<BakeSettings> {
        let asked = self.settings.error?;
        if self.error.total <= asked || self.spent.restarts >= MAX_RESTARTS {
            return None;
        }
        let error = &self.error;
        let rest_is_too_small = error.without_receivers() > asked * (1.0 - LEAST_REST * LEAST_REST).sqrt();
        let noise_hides = self.mesh_obstacle == Some(NOISE_HIDES);
        let most = error.unshot.max(error.form_factors);
        let better = self.settings.clone();
        let better = if noise_hides || (rest_is_too_small && error.visibility > error.shooters.max(most)) {
            let factor = (error.visibility / (RAYS_PART * asked)).powf(4.0 / 3.0).max(1.5);
            better.with_rays(f64::from(self.settings.rays_per_hemisphere) * factor)
        } else if rest_is_too_small && error.shooters > most {
            // Edges are halved: a factor of more than a half might change nothing.
            let factor = (SHOOTERS_PART * asked / error.shooters).clamp(0.25, 0.5);
            let finer = better.with_shooter_edge(self.settings.shooter_edge * factor);
            let vertices = shooting_mesh(self.scene, &finer).vertices.len();
            if vertices > finer.max_vertices {
                return None;
            }
            finer
        } else {
            return None;
        };
        (better != *self.settings).then_some(better)
    }

    /// Why the asked error is not met, in words for the user.
    pub(super) fn obstacle(&self) -> Option<String> {
        if self.settings.error.is_some() && self.guides.count() == 0 {
            return Some(
                "the error asked for was predicted, not measured: give --validation-samples".to_owned(),
            );
        }
        let asked = self.settings.error.unwrap_or(self.settings.mesh_error);
        let estimate = if self.settings.error.is_some() { self.error.total } else { self.error.receivers };
        if estimate <= asked {
            return None;
        }
        let error = &self.error;
        let parts = [
            (error.receivers, self.mesh_obstacle.map_or("interpolation between the vertices".to_owned(), |cure| format!("interpolation between the vertices: {cure}"))),
            (error.shooters, "the size of the shooting patches: raise --max-vertices, or give a finer --shooter-edge with --mesh-error".to_owned()),
            (error.visibility, "sampled visibility: raise --rays or --exact-occluders".to_owned()),
            (error.form_factors, "the arithmetic of form factors: lower --form-factor-error and --factor-rounding".to_owned()),
            (error.unshot, "unshot light: lower --threshold".to_owned()),
        ];
        let (_, part) = if self.settings.error.is_some() {
            parts.into_iter().reduce(|a, b| if b.0 > a.0 { b } else { a })?
        } else {
            parts.into_iter().next()?
        };
        Some(format!(
            "an error of {:.2} % was asked for and {:.2} % is estimated: in the way stands {part}",
            100.0 * asked,
            100.0 * estimate
        ))
    }
}

/// The error of interpolation that check points find, where the mean reflectance and the relative noise of the light are these.
pub(super) fn receivers_error(
    checks: &Checks,
    mesh: &Mesh,
    fitted: &[DVec3],
    reflectance: f64,
    noise: f64,
) -> f64 {
    let errors: Vec<DVec3> = checks.compare(mesh, fitted).into_iter().map(|(_, error)| error).collect();
    let mixed = checks.relative(checks.with_level(&errors, reflectance).into_iter());
    // The gathered light is noisy too.
    without_noise(mixed, noise * (1.0 + INTERPOLATED_NOISE).sqrt())
}

/// What is left of a measured error without its noise. The noise is itself an estimate, often too high: no more than three
/// quarters of the square are taken for it.
pub fn without_noise(measured: f64, noise: f64) -> f64 {
    without(measured, noise).max(measured / 2.0)
}

/// What is left of an error when an independent one is taken out.
fn without(all: f64, other: f64) -> f64 {
    (all * all - other * other).max(0.0).sqrt()
}
