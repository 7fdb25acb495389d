//! The noise of the rays of gather points.

use glam::DVec3;
use kernel::replica::Receivers;
use kernel::row::Shooter;

use super::hemisphere::{View, gathered, hemispheres, views};
use super::points::GatherPoints;
use crate::error::Result;
use crate::jobs::{ReceiverSet, RowClient};
use crate::refinement::{Cap, FIRST, SamplePoints};

/// Gather points whose noise is measured: those at the front, which are a random part of all.
pub const TWINS: usize = FIRST;

/// Keys of gather points that are looked at with other rays.
const KEYS: u64 = 1 << 34;

/// The first gather points with other rays: the difference is noise.
#[derive(Default)]
pub struct Twins {
    points: SamplePoints,
    hemispheres: Vec<Shooter>,
    views: Vec<View>,
}

impl Twins {
    /// Looks from the first of these points at the published polygons.
    pub fn look(
        client: &mut RowClient,
        polygons: ReceiverSet,
        points: SamplePoints,
        rays: u32,
    ) -> Result<Self> {
        let Receivers { first_key, receivers } = points.receivers(TWINS);
        let again = Receivers { first_key: first_key + KEYS, receivers };
        let mut twins = Self { points, hemispheres: hemispheres(&again, |_| rays), views: vec![] };
        twins.look_again(client, polygons)?;
        Ok(twins)
    }

    /// Looks at other polygons, with the same rays.
    pub fn look_again(&mut self, client: &mut RowClient, polygons: ReceiverSet) -> Result<()> {
        self.views = views(client, polygons, &self.hemispheres)?;
        Ok(())
    }

    /// Mean square of the noise of the radiosity at a gather point, under a cap.
    pub fn square_noise(&self, points: &GatherPoints, radiosity: &[DVec3], cap: Cap) -> f64 {
        let light = |view: &View| gathered(view, radiosity);
        let lights: Vec<DVec3> = points.views.iter().take(self.views.len()).map(light).collect();
        let differences: Vec<DVec3> =
            lights.iter().zip(&self.views).map(|(own, again)| *own - light(again)).collect();
        self.points.mean_square_error(&differences, &lights, cap) / 2.0
    }
}
