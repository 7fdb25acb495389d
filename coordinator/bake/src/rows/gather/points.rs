//! Gather points: receivers that see the shares by rays, and whose light is interpolated to all others.

use glam::DVec3;
use kernel::occluder::Occluder;
use kernel::replica::Receiver;
use rayon::prelude::*;

use super::hemisphere::{View, covered, gathered};
use super::interpolation::Neighbours;

/// Receivers with what they see.
#[derive(Default)]
pub struct GatherPoints {
    /// The first of them are the points that others interpolate between; the rest stand for one receiver each.
    pub receivers: Vec<Receiver>,
    /// Of each.
    pub views: Vec<View>,
    /// How many others interpolate between.
    pub shared: usize,
}

impl GatherPoints {
    /// Adds points that others interpolate between. None may stand for one receiver yet.
    pub fn add_shared(&mut self, receivers: &[Receiver], views: Vec<View>) {
        debug_assert_eq!(self.shared, self.receivers.len(), "points for all come first");
        self.receivers.extend_from_slice(receivers);
        self.views.extend(views);
        self.shared = self.receivers.len();
    }

    /// Adds points that stand for one receiver each.
    pub fn add_alone(&mut self, receivers: &[Receiver], views: Vec<View>) {
        self.receivers.extend_from_slice(receivers);
        self.views.extend(views);
    }

    /// The points that others interpolate between, sorted.
    pub fn neighbours<'a>(&'a self, occluder: &'a Occluder, extent: f64) -> Neighbours<'a> {
        Neighbours::new(&self.receivers[..self.shared], occluder, extent)
    }

    /// Irradiance of all points, where shares have this radiosity.
    pub fn gather(&self, radiosity: &[DVec3]) -> Vec<DVec3> {
        self.views.par_iter().with_min_len(64).map(|view| gathered(view, radiosity)).collect()
    }

    /// Part of its hemisphere that each point sees covered.
    pub fn covered(&self) -> Vec<DVec3> {
        self.views.par_iter().with_min_len(64).map(|view| DVec3::splat(covered(view))).collect()
    }
}
