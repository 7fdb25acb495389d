//! What every stage of a bake has at hand.

use std::time::Instant;

use kernel::geometry::Bounds;

use crate::channels::Channels;
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
    clock: Instant,
}

/// Work that a bake took, earlier attempts included.
#[derive(Debug, Clone, Default)]
pub struct Work {
    /// New starts with other settings.
    pub restarts: u32,
    /// Shots.
    pub shots: u64,
    /// Sweeps.
    pub sweeps: u32,
    /// Rounds of refinement.
    pub rounds: u32,
    /// Seconds of each step.
    pub seconds: Vec<(&'static str, f64)>,
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
        client.set_precision(settings.precision());
        Self { scene, settings, channels: Channels::needed(scene), client, work, clock }
    }

    /// Adds the time since the last step to a step.
    pub fn end_step(&mut self, name: &'static str) {
        let seconds = self.clock.elapsed().as_secs_f64();
        match self.work.seconds.iter_mut().find(|(step, _)| *step == name) {
            Some(step) => step.1 += seconds,
            None => self.work.seconds.push((name, seconds)),
        }
        self.clock = Instant::now();
    }

    /// Largest extent of the facets, in frame units.
    pub fn extent(&self) -> f64 {
        extent(self.scene)
    }
}

/// Largest extent of the facets of a scene, in frame units.
pub fn extent(scene: &Scene) -> f64 {
    let facets = scene.surfaces.iter().flat_map(|surface| &surface.facets);
    Bounds::around(facets.flat_map(Facet::positions)).extent().max_element()
}
