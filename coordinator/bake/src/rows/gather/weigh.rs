//! Which gather points each receiver takes its light from, and points of their own for those that see none.

use foldhash::{HashSet, HashSetExt};
use kernel::replica::{Receiver, Receivers};
use kernel::row::Shooter;

use super::GatherRows;
use super::hemisphere::{View, hemispheres, views};
use super::interpolation::{Interpolation, Weights};
use super::rays;
use crate::context::Context;
use crate::error::Result;

/// Size of the cells of which each gets a point where receivers see none, relative to the scene's extent,
const CELL: f64 = 0.01;

/// how much alike a point must be that a receiver takes for its own,
const LEAST_ALIKE: f64 = 0.05;

/// and how often such points are added.
const ROUNDS: u32 = 3;

/// Rays of a receiver that is alone, relative to those of a gather point.
const ALONE: f64 = 0.25;

/// Key of the first receiver that is alone, above those of gather points.
const ALONE_KEYS: u64 = 1 << 37;

/// Receivers that are weighed between two questions whether the bake is cancelled.
const AT_ONCE: usize = 1 << 16;

impl GatherRows {
    /// Weighs the receivers of all sets. Adds points where they see none that is like them, such as between the things on a shelf: one
    /// for each small cell of space and direction, then for smaller ones.
    pub(super) fn weigh_all(&mut self, cx: &mut Context) -> Result<()> {
        let receivers: Vec<Receiver> =
            self.sets.iter().flat_map(|set| set.receivers.iter().copied()).collect();
        let rays: Vec<u32> = self.sets.iter().flat_map(|set| set.rays.iter().copied()).collect();
        let mut all = self.add_where_none_is_alike(cx, &receivers)?;
        self.give_own(cx, &receivers, &rays, &mut all)?;
        let mut all = all.into_iter();
        let sky_views = self.points.sky_views();
        for set in &mut self.sets {
            set.take_from(Interpolation::new(all.by_ref().take(set.receivers.len())), &sky_views);
        }
        Ok(())
    }

    /// Adds points where these receivers see none that is like them. Returns the weights of all points for them.
    pub(super) fn add_where_none_is_alike(
        &mut self,
        cx: &mut Context,
        receivers: &[Receiver],
    ) -> Result<Vec<Option<Weights>>> {
        let mut all: Vec<Option<Weights>> = vec![None; receivers.len()];
        let mut left: Vec<usize> = (0..receivers.len()).collect();
        let mut size = CELL * cx.extent();
        for round in 0..=ROUNDS {
            let of: Vec<Receiver> = left.iter().map(|index| receivers[*index]).collect();
            // In the end any point that is seen will do.
            let least_alike = if round < ROUNDS { LEAST_ALIKE } else { 0.0 };
            let weights = self.weights(cx, &of, least_alike)?;
            for (index, weights) in left.iter().zip(weights) {
                all[*index] = weights;
            }
            left.retain(|index| all[*index].is_none());
            if round == ROUNDS || left.is_empty() || self.points.shared == 0 {
                break;
            }
            let mut cells = HashSet::new();
            let points: Vec<Receiver> = left
                .iter()
                .map(|index| receivers[*index])
                .filter(|receiver| cells.insert(cell(receiver, size)))
                .collect();
            tracing::debug!(alone = left.len(), points = points.len(), "receivers that see no gather point");
            let rays = vec![rays::of_point(cx.settings); points.len()];
            let (looking, views) = self.views_alone(cx, points, &rays)?;
            self.points.add_shared(looking, views);
            size /= 2.0;
        }
        Ok(all)
    }

    /// Weights of the gather points for some receivers; none where a receiver sees no point that is so much alike.
    fn weights(
        &self,
        cx: &mut Context,
        receivers: &[Receiver],
        least_alike: f64,
    ) -> Result<Vec<Option<Weights>>> {
        let Some(neighbours) = self.neighbours(cx) else { return Ok(vec![None; receivers.len()]) };
        let mut weights = Vec::with_capacity(receivers.len());
        for some in receivers.chunks(AT_ONCE) {
            cx.client.monitor.check()?;
            weights.extend(neighbours.all_weights(some, least_alike));
        }
        Ok(weights)
    }

    /// Weights of the gather points for some receivers. Those that see no point become points themselves.
    pub(super) fn weigh(
        &mut self,
        cx: &mut Context,
        receivers: &[Receiver],
        rays: &[u32],
    ) -> Result<Interpolation> {
        let mut weights = self.weights(cx, receivers, 0.0)?;
        self.give_own(cx, receivers, rays, &mut weights)?;
        Ok(Interpolation::new(weights))
    }

    /// Makes receivers without weights points themselves.
    fn give_own(
        &mut self,
        cx: &mut Context,
        receivers: &[Receiver],
        rays: &[u32],
        weights: &mut [Option<Weights>],
    ) -> Result<()> {
        let alone: Vec<usize> = (0..receivers.len()).filter(|index| weights[*index].is_none()).collect();
        let rays: Vec<u32> = alone.iter().map(|index| rays[*index]).collect();
        let alone: Vec<Receiver> = alone.iter().map(|index| receivers[*index]).collect();
        tracing::debug!(receivers = receivers.len(), alone = alone.len(), "receivers weighed");
        let first = self.points.receivers.len() as u32;
        let (looking, views) = self.views_alone(cx, alone, &rays)?;
        self.points.add_alone(looking, views);
        let without = weights.iter_mut().filter(|weights| weights.is_none());
        for (point, weights) in (first..).zip(without) {
            *weights = Some(vec![(point, 1.0)]);
        }
        Ok(())
    }

    /// What receivers see that no gather point stands for.
    fn views_alone(
        &self,
        cx: &mut Context,
        receivers: Vec<Receiver>,
        rays: &[u32],
    ) -> Result<(Vec<Shooter>, Vec<View>)> {
        let Some(polygons) = self.polygons else { return Ok((vec![], vec![])) };
        let alone = Receivers { first_key: ALONE_KEYS + self.points.receivers.len() as u64, receivers };
        // With points around, few lack them, and small places.
        let part = if self.points.shared > 0 { ALONE } else { 1.0 };
        let looking = hemispheres(&alone, |index| (f64::from(rays[index]) * part) as u32);
        let views = views(cx.client, polygons, &looking)?;
        Ok((looking, views))
    }
}

/// The cell of space that a receiver lies in, and the direction that it faces most.
pub(super) fn cell(receiver: &Receiver, size: f64) -> ([i64; 3], u8) {
    let axis = receiver.normal.abs().max_position();
    let side = axis as u8 * 2 + u8::from(receiver.normal[axis] < 0.0);
    ((receiver.position / size).floor().as_i64vec3().to_array(), side)
}
