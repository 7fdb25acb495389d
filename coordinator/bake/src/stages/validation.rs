//! Light gathered at validation samples: at more of them where few hold most of the error.

use glam::DVec3;

use super::glow::glow;
use super::irradiance::{Irradiance, Lights, Place, Received, irradiance_at};
use super::solved::Solved;
use crate::context::Context;
use crate::error::Result;
use crate::mesh::PatchId;
use crate::refinement::{Draw, SamplePoints};
use crate::rows::leaving;

/// An error is certain enough where it is at least this part of what was found: its square has a standard error of a third of it.
const CERTAIN: f64 = 0.8;

/// An error that is this part of the asked one at most may be less certain.
const SMALL: f64 = 0.25;

/// Samples are doubled this often at most.
const MOST_DOUBLINGS: usize = 2;

/// Light at samples that the mesh was not refined by.
pub struct Validation {
    pub samples: SamplePoints,
    /// Relative error of the receivers, and what it is at least by its own standard error. None without samples.
    pub receivers: Option<[f64; 2]>,
    /// The errors that the radiosity has where light is interpolated between gather points, each with its leaf.
    pub found_between: Vec<(PatchId, DVec3)>,
}

impl Solved {
    /// Gathers the light of all sources and shares at new samples, drawn by what `expected` tells of each leaf's part of the error, and
    /// compares it with that `fitted` to the vertices. Draws more of them until their error is certain, small, or certainly more than asked,
    /// or they have been doubled often enough.
    pub fn validate(
        &mut self,
        cx: &mut Context,
        fitted: &[DVec3],
        expected: &[(PatchId, f64)],
    ) -> Result<Validation> {
        let (mut samples, mut receivers, mut found_between) = (SamplePoints::default(), None, vec![]);
        let (noise, reflectance) = (self.noise(), self.mean_reflectance());
        for _ in 0..=MOST_DOUBLINGS {
            let draw = Draw {
                round: self.rounds_measured,
                is_twice: self.rows.source.measures_twice(),
                positions_before: samples.positions(),
            };
            let mut drawn = SamplePoints::draw(&self.mesh.mesh, cx.scene, cx.settings, expected, draw);
            if drawn.count() == 0 {
                break;
            }
            found_between.extend(self.light_samples(cx, &mut drawn)?);
            samples.append(drawn);
            let found = samples.interpolation_error(&self.mesh.mesh, fitted, reflectance, noise);
            tracing::debug!(positions = samples.positions(), ?found, "validated");
            receivers = Some(found);
            let [all, at_least] = found;
            let asked = cx.settings.asked_error();
            if at_least >= (CERTAIN * all).min(asked) || all <= SMALL * asked {
                break;
            }
        }
        Ok(Validation { samples, receivers, found_between })
    }

    /// Gathers the light of all sources and shares at sample points. Returns the errors that the radiosity has where light is
    /// interpolated between gather points, each with its leaf.
    fn light_samples(
        &mut self,
        cx: &mut Context,
        samples: &mut SamplePoints,
    ) -> Result<Vec<(PatchId, DVec3)>> {
        let receivers = samples.receivers(samples.count());
        let lights = Lights { sources: &self.sources.all, radiosity: self.solution.radiosity() };
        let Received { light, cover } =
            irradiance_at(cx, &self.mesh, &mut self.rows, Place::Once(&receivers), &[lights])?;
        samples.set_row_sums(&cover.sums);
        let (mut glowing, mut sky_views) = (vec![], None);
        for Irradiance { direct, glow, all } in light {
            samples.set_direct(direct.all);
            samples.set_irradiance(all);
            (glowing, sky_views) = (glow, direct.sky_views);
        }
        // What glows is interpolated between them, too.
        let glow = glow(&self.mesh, &self.sources.all);
        let leaving = leaving(&self.solution.radiosity, glow.as_deref());
        let mut between = self.rows.source.interpolated(cx, (&receivers, sky_views.as_deref()), &leaving)?;
        if let Some(between) = &mut between {
            between.iter_mut().zip(glowing).for_each(|(light, glowing)| *light -= glowing);
        }
        let Some(between) = between else { return Ok(vec![]) };
        let mut measured = samples.clone();
        measured.set_gathered(&between);
        self.measured.push(measured);
        Ok(samples.on_leaves(&self.mesh.mesh, samples.differences(&between)))
    }
}
