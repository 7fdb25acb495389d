//! Settings for a new start, where no finer mesh meets the error.

use super::Measured;
use crate::context::Context;
use crate::refinement::{Obstacle, room};
use crate::settings::BakeSettings;
use crate::stages::ShootingMesh;

/// Part of the asked error that the shooters may take after a new start.
const SHOOTERS_PART: f64 = 0.5;

/// Part of the asked error that the rays may take after a new start.
const RAYS_PART: f64 = 0.3;

/// Noise that is less than this part of the error found hides little of it: what else refinement did not find, as small bright spots,
/// more rays will not show either.
const HIDING_PART: f64 = 1.0 / 3.0;

/// Most new starts.
const MAX_RESTARTS: u32 = 3;

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
        let better = cx.settings.clone();
        let better = if noise_hides || (rest_is_too_small && error.visibility > error.shooters.max(most)) {
            let factor = (error.visibility / (RAYS_PART * asked)).powf(4.0 / 3.0).max(1.5);
            let rays = self.solved.rows.source.rays(cx.settings);
            better.with_rays(f64::from(rays) * factor)
        } else if rest_is_too_small
            && error.shooters > most
            && (is_last || !self.finer_mesh_helps_shooters(cx.settings))
        {
            // Edges are halved: a factor of more than a half might change nothing.
            let factor = (SHOOTERS_PART * asked / error.shooters).clamp(0.25, 0.5);
            let finer = better.with_shooter_edge(cx.settings.shooter_edge * factor);
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
}
