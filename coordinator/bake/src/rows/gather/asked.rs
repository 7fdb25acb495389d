//! Light of receivers that are asked about once.

use glam::DVec3;
use kernel::replica::{Receiver, Receivers};

use super::GatherRows;
use super::interpolation::Interpolation;
use super::place::FEW_RECEIVERS;
use super::points::GatherPoints;
use super::rays;
use crate::context::Context;
use crate::error::Result;
use crate::rows::local_radiosity::Radiosity;
use crate::rows::share_mesh::ShareMesh;
use crate::rows::source::{Cover, Gathered};

/// Receivers that are asked about once, for each point that is placed for them, at least: else their own rays cost less.
const LEAST_RECEIVERS: usize = 4;

impl GatherRows {
    /// Places points for this many receivers, which lie among some, and whose light is asked for once all is solved, where the vertices
    /// needed none: where these are few, each casts rays of its own. `glow` is what the shares emit beside the light of the sources.
    pub(super) fn place_for_asked(
        &mut self,
        cx: &mut Context,
        mesh: &ShareMesh,
        (count, among): (usize, &[Receiver]),
        (radiosity, glow): (&[DVec3], Option<&[DVec3]>),
    ) -> Result<()> {
        if self.points.shared > 0 || count <= FEW_RECEIVERS {
            return Ok(());
        }
        // Those of the vertices are for them alone.
        let Self { polygons, rounds, has_even_sky, .. } = *self;
        let mut asked = Self { polygons, rounds: rounds + 1, has_even_sky, ..Self::default() };
        asked.place_by_light(cx, mesh, (radiosity.to_vec(), glow), None, count / LEAST_RECEIVERS)?;
        asked.add_where_none_is_alike(cx, among)?;
        self.of_asked = Some(Box::new(asked));
        Ok(())
    }

    /// What the weights of the gather points tell of receivers that are asked about once, given their sky view factors where there is an
    /// even sky. Those that see no point get all rays of one.
    pub(super) fn weigh_once<T>(
        &mut self,
        cx: &mut Context,
        (receivers, sky_views): (&Receivers, Option<&[f64]>),
        tell: impl FnOnce(&Interpolation, &GatherPoints) -> T,
    ) -> Result<T> {
        let points = self.points.receivers.len();
        let rays = vec![rays::of_receiver(cx.settings); receivers.receivers.len()];
        let mut weights = self.weigh(cx, &receivers.receivers, &rays)?;
        if let Some(own) = sky_views {
            weights.follow_sky(own, &self.points.sky_views());
        }
        let told = tell(&weights, &self.points);
        // Those that became points themselves are not asked about again.
        self.points.truncate(points);
        Ok(told)
    }

    /// What shares of these radiosities give receivers that take it from the gather points.
    pub(super) fn gather_weighed(
        &mut self,
        cx: &mut Context,
        mesh: &ShareMesh,
        receivers: (&Receivers, Option<&[f64]>),
        radiosities: &[Radiosity],
    ) -> Result<Gathered> {
        self.weigh_once(cx, receivers, |weights, points| {
            let light =
                radiosities.iter().map(|radiosity| weights.of(&points.gather(radiosity.shares))).collect();
            let sums = weights.of(&points.covered(&mesh.materials)).into_iter();
            let sums = sums.map(|sum| sum.x.clamp(0.0, 1.0)).collect();
            Gathered { light, cover: Cover { sums, ..Cover::default() } }
        })
    }
}
