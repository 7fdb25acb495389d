//! What every stage of a bake has at hand.

use std::time::Instant;

use kernel::geometry::Bounds;
use kernel::row::Precision;

use crate::channels::Channels;
use crate::error_budget::most_rounding;
use crate::jobs::RowClient;
use crate::settings::BakeSettings;
use scene::{Facet, Scene};

/// One attempt at a bake.
pub struct Context<'a, 'b> {
    /// The scene.
    pub scene: &'a Scene,
    /// The settings of this attempt.
    pub settings: &'a BakeSettings,
    /// Channels that the scene needs.
    pub channels: Channels,
    /// Makes rows.
    pub client: &'a mut RowClient<'b>,
    /// Work done so far.
    pub work: Work,
    extent: f64,
    clock: Instant,
}

/// Work that a bake took, earlier attempts included.
#[derive(Debug, Clone, Default)]
pub struct Work {
    /// New starts with other settings, but for those as soon as direct light was looked at.
    pub restarts: u32,
    /// The least noise of direct light that was found to be too much, with the fewest rays per hemisphere for light sources that bring it.
    pub noise: Option<(f64, u32)>,
    /// Noise of the last solution that was given up for less of it.
    pub noise_at_restart: Option<f64>,
    /// Whether more rays to light sources are of no use.
    pub noise_is_bound: bool,
    /// Shots.
    pub shots: u64,
    /// Sweeps.
    pub sweeps: u32,
    /// Rounds of refinement.
    pub rounds: u32,
    /// Seconds of each step.
    pub seconds: Vec<(&'static str, f64)>,
    /// Of these, the coordinator's own while the workers had nothing to compute.
    pub own_seconds: Vec<(&'static str, f64)>,
}

impl<'a, 'b> Context<'a, 'b> {
    /// Starts an attempt, whose first step began at `clock`.
    pub fn new(
        scene: &'a Scene,
        settings: &'a BakeSettings,
        client: &'a mut RowClient<'b>,
        work: Work,
        clock: Instant,
    ) -> Self {
        let (channels, extent) = (Channels::needed(scene), extent(scene));
        let mut cx = Self { scene, settings, channels, client, work, extent, clock };
        cx.set_precision(settings.precision());
        cx
    }

    /// Sets the precision of rows submitted from now on. What rounding adds to a row comes back 1 / (1 - rho) times, so factors are
    /// rounded by less than is allowed where that would show in the error asked for.
    pub fn set_precision(&mut self, precision: Precision) {
        let reflectances = self.scene.surfaces.iter().map(|surface| surface.reflectance.max_element());
        let most = most_rounding(self.settings.asked_error(), reflectances.fold(0.0, f64::max));
        let factor_rounding = precision.factor_rounding.min(most);
        self.client.set_precision(Precision { factor_rounding, ..precision });
    }

    /// Adds the time since the last step to a step.
    pub fn end_step(&mut self, name: &'static str) {
        let seconds = self.clock.elapsed().as_secs_f64();
        self.clock = Instant::now();
        add(&mut self.work.seconds, name, seconds);
        add(&mut self.work.own_seconds, name, self.client.end_step());
    }

    /// Largest extent of the facets, in frame units.
    pub fn extent(&self) -> f64 {
        self.extent
    }

    /// Patches no longer than this are not divided, in frame units.
    pub fn shortest_edge(&self) -> f64 {
        self.settings.shortest_edge(self.extent)
    }
}

/// Adds seconds to a step.
fn add(steps: &mut Vec<(&'static str, f64)>, name: &'static str, seconds: f64) {
    match steps.iter_mut().find(|(step, _)| *step == name) {
        Some(step) => step.1 += seconds,
        None => steps.push((name, seconds)),
    }
}

/// Largest extent of the facets of a scene, in frame units.
pub fn extent(scene: &Scene) -> f64 {
    let facets = scene.surfaces.iter().flat_map(|surface| &surface.facets);
    Bounds::around(facets.flat_map(Facet::positions)).extent().max_element()
}
