//! Settings for a new start, where no finer mesh meets the error.

use super::Measured;
use crate::context::Context;
use crate::error_budget::INTERPOLATED_NOISE;
use crate::refinement::{Obstacle, room};
use crate::settings::{BakeSettings, more_rays};
use crate::stages::ShootingMesh;
use crate::stages::new_start::RAYS_PART;
use crate::stages::solved::Noises;

/// Part of the asked error that the shooters may take after a new start.
const SHOOTERS_PART: f64 = 0.5;

/// Most new starts.
const MAX_RESTARTS: u32 = 3;

/// A new start for less noise has this times as many rays, at least.
const LEAST_MORE_RAYS: f64 = 1.5;

/// More rays that left more than this part of the noise do not go where it comes from, and yet more would not. [`LEAST_MORE_RAYS`] are
/// to leave three quarters.
const MOST_NOISE_LEFT: f64 = 0.8;

/// Noise that is less than this part of the error found hides little of it: what else refinement did not find, as small bright spots,
/// more rays will not show either.
const HIDING_PART: f64 = 1.0 / 3.0;

impl Measured {
    /// Settings that should meet the asked error where these did not; `None` when it is met, or cannot be. A new start costs as much
    /// as all before it: it is made where all but the interpolation certainly exceeds what was asked. Measured at some thousand
    /// points, of which few may hold most of it, chance would decide else. A finer mesh is tried first, unless this round is the last.
    pub(super) fn better_settings(&self, cx: &Context, is_last: bool) -> Option<BakeSettings> {
        let asked = cx.settings.error?;
        if self.error.total <= asked || cx.work.restarts >= MAX_RESTARTS {
            return None;
        }
        let error = &self.error;
        // No new start has more vertices or gather points. Less noise shows whether more are needed.
        let noise_hides = self.obstacle == Some(Obstacle::Noise)
            && error.visibility > HIDING_PART * error.receivers
            && error.receivers >= error.shooters;
        let has_room = room(&self.solved.mesh.mesh, cx.settings.most_vertices(cx.scene)) > 0;
        if !has_room && !noise_hides && error.receivers > asked {
            return None;
        }
        let certainly = error.with_shooters(error.shooters.min(self.shooters_at_least));
        let rest_is_too_small = certainly.without_receivers() > asked;
        let most = error.unshot.max(error.form_factors);
        let is_noisy = noise_hides || (rest_is_too_small && error.visibility > error.shooters.max(most));
        let better = if is_noisy && rays_help(cx.work.noise_at_restart, error.visibility) {
            self.with_less_noise(cx, RAYS_PART * asked)
        } else if rest_is_too_small
            && error.shooters > most.max(error.visibility)
            && (is_last || !self.finer_mesh_helps_shooters(cx.settings))
        {
            // Edges are halved: a factor of more than a half might change nothing.
            let factor = (SHOOTERS_PART * asked / error.shooters).clamp(0.25, 0.5);
            let finer = cx.settings.clone().with_shooter_edge(cx.settings.shooter_edge * factor);
            let same = BakeSettings { rows: self.solved.rows.source.strategy(), ..finer.clone() };
            let mesh = ShootingMesh::new(cx.scene, &same).mesh;
            let vertices = mesh.vertices.len();
            let now = self.solved.rows.table.vertices.coarse_count();
            if vertices <= now || vertices > finer.most_vertices(cx.scene) {
                return None;
            }
            finer
        } else {
            return None;
        };
        (better != *cx.settings).then_some(better)
    }

    /// Settings whose rays should leave this noise: those to light sources and those of hemispheres, each if it has more.
    fn with_less_noise(&self, cx: &Context, noise: f64) -> BakeSettings {
        let settings = cx.settings;
        let source = &self.solved.rows.source;
        let Noises { of_rows, of_hemispheres } = self.solved.noises();
        let [to_sources, of_hemisphere] =
            [of_rows, of_hemispheres].map(|own| more_rays(own * INTERPOLATED_NOISE.sqrt(), noise));
        let rays = f64::from(source.rays(settings));
        if !source.joins_sources() {
            return settings.clone().with_rays(rays * to_sources.max(LEAST_MORE_RAYS));
        }
        let to_sources = if cx.work.noise_is_bound { 0.0 } else { to_sources };
        if to_sources == 0.0 && of_hemisphere < 1.0 {
            return settings.clone();
        }
        let most = to_sources.max(of_hemisphere);
        let [to_sources, of_hemisphere] = [to_sources, of_hemisphere]
            .map(|factor| if factor == most { factor.max(LEAST_MORE_RAYS) } else { factor });
        let mut better = settings.clone();
        if of_hemisphere >= LEAST_MORE_RAYS {
            better = better.with_rays(rays * of_hemisphere);
        }
        if to_sources >= LEAST_MORE_RAYS {
            better = better.with_rays_to_sources(f64::from(source.rays_to_sources(settings)) * to_sources);
        }
        better
    }
}

/// Whether more rays bring less noise, given what there was before the last new start for that, if there was one, and what there is now.
fn rays_help(before: Option<f64>, now: f64) -> bool {
    before.is_none_or(|before| now <= MOST_NOISE_LEFT * before)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_that_left_the_noise_as_it_was_help_no_more() {
        assert!(rays_help(None, 0.3));
        assert!(rays_help(Some(0.3), 0.22));
        assert!(!rays_help(Some(0.3), 0.26));
    }
}
