//! Sampling visibility with rays, for shafts with too many occluders to cut.

use glam::DVec3;
use sobol_burley::sample_4d;

use super::ratio::RayRatio;
use crate::form_factor::{PreparedPolygon, kernel};
use crate::geometry::{Corners, PlaneId, uniform_point};
use crate::messages::RowStatistics;
use crate::occluder::{Blocking, Occluder};
use crate::row::Precision;

/// Number of rays after which a pair that is wholly visible or wholly hidden so far gets no more. Stopping on both keeps the
/// estimate nearly unbiased; stopping on hidden pairs only would darken.
const PROBE_RAYS: u32 = 8;

/// Pairs with more rays than this matter too much to be stopped early.
const MAX_STOPPED_RAYS: u32 = 32;

/// Seed of a pair's rays.
#[must_use]
pub fn pair_seed(scene_seed: u64, shooter: u64, receiver: u64) -> u32 {
    // The finaliser of SplitMix64 (Steele, Lea, Flood 2014), which spreads consecutive keys over all bits.
    let mix = |mut value: u64| {
        value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        value ^ (value >> 31)
    };
    let golden = 0x9e37_79b9_7f4a_7c15_u64;
    mix(mix(mix(scene_seed.wrapping_add(golden)) ^ shooter.wrapping_add(golden)) ^ receiver) as u32
}

/// A pair's rays: its form factor's part of the hemisphere's, a power of two.
pub fn ray_count(factor: f64, precision: &Precision) -> u32 {
    let share = (factor * f64::from(precision.rays_per_hemisphere)).ceil() as u32;
    share.min(precision.maximum_rays).next_power_of_two().max(precision.minimum_rays)
}

/// The visible part of a form factor whose unoccluded value is known, by rays.
pub fn sampled_factor(
    occluder: &Occluder,
    precision: &Precision,
    (position, normal, plane): (DVec3, DVec3, PlaneId),
    polygon: &PreparedPolygon,
    unoccluded: f64,
    seed: u32,
    statistics: &mut RowStatistics,
) -> f64 {
    statistics.sampled_pairs += 1;
    let planes = [plane, polygon.plane()];
    let mut blocking = Blocking::default();
    let blocked = |target: DVec3| occluder.blocks_again(position, position + target, planes, &mut blocking);
    let corners = polygon.corners_above(position, normal);
    let rays = ray_count(unoccluded, precision);
    let sample = sample_visibility(&corners, normal, polygon.normal(), rays, seed, blocked);
    statistics.rays += u64::from(sample.rays);
    statistics.sampling_variance += unoccluded * unoccluded * sample.variance;
    unoccluded * sample.fraction
}

/// An estimate of visibility.
pub struct VisibilitySample {
    /// Part of the form factor that arrives.
    pub fraction: f64,
    /// Variance of the fraction, estimated from two halves of the rays.
    pub variance: f64,
    /// Rays cast.
    pub rays: u32,
}

/// Estimates the part of a polygon's form factor that is visible from the origin.
///
/// Targets are uniform over the area (Owen-scrambled Sobol' points) and each ray weighs its kernel cos cos / r^2: the ratio of
/// weighted sums tends to the visible part of the form factor, where a plain ratio of hits would tend to that of the area.
pub fn sample_visibility(
    corners: &Corners,
    normal: DVec3,
    polygon_normal: DVec3,
    rays: u32,
    seed: u32,
    mut blocked: impl FnMut(DVec3) -> bool,
) -> VisibilitySample {
    let mut ratio = RayRatio::default();
    let (mut hits, mut count) = (0, 0);
    for index in 0..rays {
        let [x, y, ..] = sample_4d(index, 0, seed);
        let target = uniform_point(corners, f64::from(x), f64::from(y));
        let weight = kernel(normal, polygon_normal, target);
        // Rounding can put a target a hair under the horizon.
        if weight > 0.0 {
            let is_blocked = blocked(target);
            count += 1;
            hits += u32::from(is_blocked);
            ratio.add(index >= rays / 2, weight, if is_blocked { 0.0 } else { 1.0 });
        }
        let undecided = hits > 0 && hits < count;
        if index + 1 == PROBE_RAYS && rays <= MAX_STOPPED_RAYS && !undecided {
            break;
        }
    }
    // Rays that were stopped, or a single one, have no second half; they all agreed.
    let (fraction, difference) = ratio.estimate().unwrap_or_else(|| {
        let (arrived, cast) = ratio.sums();
        (if cast > 0.0 { arrived / cast } else { 0.0 }, 0.0)
    });
    VisibilitySample { fraction, variance: difference * difference / 4.0, rays: count }
}
