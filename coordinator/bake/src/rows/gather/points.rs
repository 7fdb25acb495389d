//! Gather points: receivers that see the shares by rays, and whose light is interpolated to all others.

use glam::DVec3;
use kernel::occluder::Occluder;
use kernel::replica::Receiver;
use kernel::row::{Shape, Shooter};
use rayon::prelude::*;

use super::hemisphere::{View, covered, gathered, views};
use super::interpolation::Neighbours;
use crate::error::Result;
use crate::jobs::{ReceiverSet, RowClient};
use crate::materials::AveragedMaterial;

/// Receivers with what they see.
#[derive(Default)]
pub struct GatherPoints {
    /// The first of them are the points that others interpolate between; the rest stand for one receiver each.
    pub receivers: Vec<Receiver>,
    /// Of each.
    hemispheres: Vec<Shooter>,
    /// Of each.
    pub views: Vec<View>,
    /// How many others interpolate between.
    pub shared: usize,
    /// How many of these were placed, and not added for receivers that see none.
    pub placed: usize,
}

impl GatherPoints {
    /// Adds points that were placed. None may stand for one receiver yet.
    pub fn add_placed(&mut self, hemispheres: Vec<Shooter>, views: Vec<View>) {
        self.placed += hemispheres.len();
        self.add_shared(hemispheres, views);
    }

    /// Adds points that others interpolate between. None may stand for one receiver yet.
    pub fn add_shared(&mut self, hemispheres: Vec<Shooter>, views: Vec<View>) {
        debug_assert_eq!(self.shared, self.receivers.len(), "points for all come first");
        self.add_alone(hemispheres, views);
        self.shared = self.receivers.len();
    }

    /// Adds points that stand for one receiver each.
    pub fn add_alone(&mut self, hemispheres: Vec<Shooter>, views: Vec<View>) {
        let receiver = |shooter: &Shooter| match &shooter.shape {
            Shape::Hemisphere(hemisphere) => Some(hemisphere.receiver),
            _ => None,
        };
        self.receivers.extend(hemispheres.iter().filter_map(receiver));
        self.hemispheres.extend(hemispheres);
        self.views.extend(views);
    }

    /// Forgets all but the first `count` points.
    pub fn truncate(&mut self, count: usize) {
        self.receivers.truncate(count);
        self.hemispheres.truncate(count);
        self.views.truncate(count);
    }

    /// Looks at other polygons, with the same rays.
    pub fn look_again(&mut self, client: &mut RowClient, polygons: ReceiverSet) -> Result<()> {
        self.views = views(client, polygons, &self.hemispheres)?;
        Ok(())
    }

    /// The points that others interpolate between, sorted. Those that were placed have this number of rays each.
    pub fn neighbours<'a>(&'a self, rays: u32, occluder: &'a Occluder, extent: f64) -> Neighbours<'a> {
        Neighbours::new(&self.receivers[..self.shared], rays, occluder, extent)
    }

    /// Irradiance of all points, where shares have this radiosity.
    pub fn gather(&self, radiosity: &[DVec3]) -> Vec<DVec3> {
        self.views.par_iter().with_min_len(64).map(|view| gathered(view, radiosity)).collect()
    }

    /// Sky view factor of each point.
    pub fn sky_views(&self) -> Vec<DVec3> {
        self.views.iter().map(|view| DVec3::splat(f64::from(view.sky))).collect()
    }

    /// Part of its hemisphere that each point sees covered.
    pub fn covered(&self, materials: &[AveragedMaterial]) -> Vec<DVec3> {
        let covered = |view: &View| DVec3::splat(covered(view, materials));
        self.views.par_iter().with_min_len(64).map(covered).collect()
    }
}
