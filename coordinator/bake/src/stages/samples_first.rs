//! Direct light at some sets of receivers, at the refinement samples first: they tell whether its noise is too much, at a small part of
//! what light at all vertices costs.

use std::collections::HashMap;

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

/// Part of the asked error from which on noise of direct light is too much: the solution would be found to miss the error for it.
const TOO_MUCH: f64 = 0.7;

/// Light at sets of receivers, as sources are added.
pub struct SamplesFirst<'a> {
    sets: &'a [ReceiverSet],
    /// The first set, if they are one.
    samples: Option<&'a SamplePoints>,
    /// Light at each set.
    pub light: Vec<Direct>,
    /// Strength of each source by its key, and variance of its row over the samples, summed over these.
    rows: HashMap<u64, (DVec3, f64)>,
}

impl<'a> SamplesFirst<'a> {
    /// No light yet. The first of the sets is that of the samples, if there are any.
    pub fn new(sets: &'a [ReceiverSet], samples: &'a SamplePoints) -> Self {
        let samples = (samples.count() > 0).then_some(samples);
        Self { sets, samples, light: light::no_light(sets), rows: HashMap::new() }
    }

    /// Adds the light of sources at the samples.
    pub fn add_at_samples(&mut self, cx: &mut Context, sources: &[&LightSource]) -> Result<()> {
        let first = usize::from(self.samples.is_some());
        let rows = &mut self.rows;
        let strengths: HashMap<u64, DVec3> = sources
            .iter()
            .filter_map(|source| Some((source.shooter.as_ref()?.key, source.strength)))
            .collect();
        let look = |_, key, variance| {
            rows.insert(key, (strengths[&key], variance));
        };
        light::add_direct(
            &mut self.light[..first],
            sources.iter().copied(),
            &self.sets[..first],
            cx.client,
            look,
        )
    }

    /// Adds the light of sources at all other sets.
    pub fn add_elsewhere(&mut self, cx: &mut Context, sources: &[&LightSource]) -> Result<()> {
        let first = usize::from(self.samples.is_some());
        let light = &mut self.light[first..];
        light::add_direct(light, sources.iter().copied(), &self.sets[first..], cx.client, |_, _, _| ())
    }

    /// Settings with more rays to sources, of which there are `rays` to a hemisphere, where the noise at the samples is too much for the
    /// asked error; `others` is the mean irradiance from sources that were not added.
    pub fn less_noise(&self, cx: &Context, rays: u32, others: DVec3) -> Option<BakeSettings> {
        let (asked, samples) = (cx.settings.error?, self.samples?);
        let mut samples = samples.clone();
        samples.set_direct(self.light[0].all.clone());
        samples.reflect_evenly(others);
        // In the order of the keys: sums of another order have other bits.
        let mut rows: Vec<(u64, (DVec3, f64))> = self.rows.iter().map(|(key, row)| (*key, *row)).collect();
        rows.sort_unstable_by_key(|(key, _)| *key);
        let noise = samples.noise(rows.into_iter().map(|(_, row)| row), samples.count());
        let noise = noise * INTERPOLATED_NOISE.sqrt();
        let more = f64::from(rays) * more_rays(noise, RAYS_PART * asked);
        let better = cx.settings.clone().with_rays_to_sources(more);
        (noise > TOO_MUCH * asked && better.rays_to_sources() > rays).then_some(better)
    }

    /// Variance of a source's row over the samples, summed over these.
    pub fn variance(&self, source: &LightSource) -> f64 {
        let row = source.shooter.as_ref().and_then(|shooter| self.rows.get(&shooter.key));
        row.map_or(0.0, |(_, variance)| *variance)
    }
}
