//! Direct light at some sets of receivers, at the refinement samples first: they tell whether its noise is too much, at a small part of
//! what light at all vertices costs.

use std::collections::BTreeMap;

use glam::DVec3;

use super::light::{self, Direct};
use super::light_source::LightSource;
use super::new_start::RAYS_PART;
use crate::context::Context;
use crate::error::Result;
use crate::error_budget::INTERPOLATED_NOISE;
use crate::jobs::ReceiverSet;
use crate::refinement::SamplePoints;
use crate::settings::{BakeSettings, more_rays};

/// Part of the asked error from which on noise of direct light is too much: it would hide what refinement looks for.
const TOO_MUCH: f64 = 0.5;

/// The same of a start with more rays, which was to have less noise than this: light at all vertices follows, and a new start after that
/// costs much more than one before it.
const STILL_TOO_MUCH: f64 = 0.4;

/// More rays are of no use where they do not bring noise to this part of what it was,
const LEAST_GAIN: f64 = 0.97;

/// from this number per hemisphere on. A small lamp gets its least number of rays with fewer, too, and more of them change nothing yet.
const MANY_RAYS: u32 = 1 << 16;

/// Light at sets of receivers, as sources are added.
pub struct SamplesFirst<'a> {
    sets: &'a [ReceiverSet],
    /// The points of the first set; none where it is none of samples.
    samples: Option<&'a SamplePoints>,
    /// Rays per hemisphere for light sources; none where there can be no more, and the samples need not come first.
    rays: Option<u32>,
    /// Light at each set.
    pub light: Vec<Direct>,
    /// Strength of each source by its key, and variance of its row over the samples, summed over these.
    rows: BTreeMap<u64, (DVec3, f64)>,
}

impl<'a> SamplesFirst<'a> {
    /// No light yet. The first of the sets is that of the samples, if there are any.
    pub fn new(sets: &'a [ReceiverSet], samples: &'a SamplePoints, rays: Option<u32>) -> Self {
        let samples = (samples.count() > 0).then_some(samples);
        Self { sets, samples, rays, light: light::no_light(sets), rows: BTreeMap::new() }
    }

    /// Adds the light of sources at all sets. Where its noise is too much at the samples it returns settings for less, and all other sets
    /// are left without this light. `others` is the mean irradiance from sources that were not added.
    pub fn add(
        &mut self,
        cx: &mut Context,
        sources: &[&LightSource],
        others: DVec3,
    ) -> Result<Option<BakeSettings>> {
        let (Some(samples), Some(rays), Some(asked)) = (self.samples, self.rays, cx.settings.error) else {
            self.add_at(cx, sources, 0..self.sets.len())?;
            return Ok(None);
        };
        self.add_at(cx, sources, 0..1)?;
        let noise = self.noise(samples, others);
        let is_again = cx.work.noise.is_some() || cx.work.noise_at_restart.is_some();
        if is_too_much(noise / asked, is_again) && !cx.work.noise_is_bound {
            let found = cx.work.noise.filter(|(least, _)| noise > LEAST_GAIN * least);
            let (_, fewest) = *cx.work.noise.insert(found.unwrap_or((noise, rays)));
            cx.work.noise_is_bound = found.is_some() && rays >= MANY_RAYS;
            let more = f64::from(rays) * more_rays(noise, RAYS_PART * asked);
            let wanted = if cx.work.noise_is_bound { f64::from(fewest) } else { more };
            let better = cx.settings.clone().with_rays_to_sources(wanted);
            if better.most_rays() != rays {
                tracing::debug!(noise, rays, better.rays_to_sources, "direct light has too much noise");
                return Ok(Some(better));
            }
        }
        self.add_at(cx, sources, 1..self.sets.len())?;
        Ok(None)
    }

    /// Adds the light of sources at some of the sets.
    fn add_at(
        &mut self,
        cx: &mut Context,
        sources: &[&LightSource],
        some: std::ops::Range<usize>,
    ) -> Result<()> {
        let Self { sets, samples, light, rows, .. } = self;
        let of_samples = samples.map(|_| 0);
        let look = |set, source: &LightSource, variance| {
            if let Some(shooter) = source.shooter.as_ref().filter(|_| of_samples == Some(some.start + set)) {
                rows.insert(shooter.key, (source.strength, variance));
            }
        };
        let sources = sources.iter().copied();
        light::add_direct(&mut light[some.clone()], sources, &sets[some.clone()], cx.client, look)
    }

    /// Relative standard error of the light at the samples, where all that is reflected comes back.
    fn noise(&self, samples: &SamplePoints, others: DVec3) -> f64 {
        let mut samples = samples.clone();
        samples.set_direct(self.light[0].all.clone());
        samples.reflect_evenly(others);
        samples.noise(self.rows.values().copied(), samples.count()) * INTERPOLATED_NOISE.sqrt()
    }

    /// Variance of a source's row over the samples, summed over these.
    pub fn variance(&self, source: &LightSource) -> f64 {
        let row = source.shooter.as_ref().and_then(|shooter| self.rows.get(&shooter.key));
        row.map_or(0.0, |(_, variance)| *variance)
    }
}

/// Whether noise is too much, relative to the asked error, in a start that others for less noise came before or not.
fn is_too_much(noise: f64, is_again: bool) -> bool {
    noise > if is_again { STILL_TOO_MUCH } else { TOO_MUCH }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_start_for_less_noise_must_have_less_than_the_first_may() {
        let at = |noise: f64| [false, true].map(|is_again| is_too_much(noise, is_again));
        assert_eq!([0.6, 0.45, 0.35].map(at), [[true, true], [false, true], [false, false]]);
        // Less than that is aimed at.
        assert!(!is_too_much(RAYS_PART, true));
    }
}
