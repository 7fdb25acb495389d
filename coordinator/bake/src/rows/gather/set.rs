//! Receivers that take their light from gather points.

use glam::DVec3;
use kernel::replica::Receiver;

use super::interpolation::Interpolation;
use crate::mesh::{ClusterLimits, Surroundings};

/// Width of a vertex's surroundings, relative to the longest edge of the shooters, from which on it gets all rays of a hemisphere.
const WIDE: f64 = 0.125;

/// Least part of the rays that a vertex gets.
const LEAST_PART: f64 = 0.125;

/// Width of clusters whose vertices share a receiver, relative to the scene's extent and the asked error,
const SMALL: f64 = 0.05;

/// but no wider than this part of the extent.
const LARGEST_SMALL: f64 = 0.005;

/// Angle between the normals of such a cluster, in radians, relative to the asked error: a turn changes the light of half of a sky by half
/// as much at most.
const TURN: f64 = 1.5;

/// but no larger than this.
const LARGEST_TURN: f64 = 0.3;

/// How far leaves may be apart that share a receiver, with their width relative to the scene's extent, where this error is asked.
pub fn cluster_limits(error: f64) -> ClusterLimits {
    ClusterLimits { width: (SMALL * error).min(LARGEST_SMALL), angle: (TURN * error).min(LARGEST_TURN) }
}

/// Receivers whose light is that of gather points.
pub struct Set {
    pub receivers: Vec<Receiver>,
    /// Rays of each, if it became a point itself.
    pub rays: Vec<u32>,
    /// Sky view factor of each, where there is an even sky, once it is known.
    pub sky_views: Option<Vec<f64>>,
    /// Empty until the points are placed.
    pub weights: Interpolation,
}

impl Set {
    /// Receivers with at most this number of rays; vertices come with their surroundings. `shooter_edge` is in frame units.
    pub fn new(
        receivers: &[Receiver],
        around: Option<&[Surroundings]>,
        shooter_edge: f64,
        most_rays: u32,
    ) -> Self {
        let rays = match around {
            Some(around) => {
                around.iter().map(|around| rays_of_vertex(around, WIDE * shooter_edge, most_rays)).collect()
            }
            None => vec![most_rays; receivers.len()],
        };
        Self { receivers: receivers.to_vec(), rays, sky_views: None, weights: Interpolation::default() }
    }

    /// Takes light from points with these weights, and these sky view factors.
    pub fn take_from(&mut self, weights: Interpolation, sky_views: &[DVec3]) {
        self.weights = weights;
        self.follow_sky(sky_views);
    }

    /// Takes the sky view factors of the receivers, given those of the points.
    pub fn see_sky(&mut self, own: Vec<f64>, of_points: &[DVec3]) {
        debug_assert!(self.sky_views.is_none(), "weights would follow it twice");
        self.sky_views = Some(own);
        self.follow_sky(of_points);
    }

    fn follow_sky(&mut self, of_points: &[DVec3]) {
        if let Some(own) = &self.sky_views {
            self.weights.follow_sky(own, of_points);
        }
    }
}

/// The fewer rays, the smaller a vertex's surroundings are. Where vertices lie close together, the light of a piece of surface is
/// the mean of many, and so is their noise.
fn rays_of_vertex(around: &Surroundings, wide: f64, all: u32) -> u32 {
    let part = (around.area.sqrt() / wide).clamp(LEAST_PART, 1.0);
    // A power of two has the most even directions.
    ((f64::from(all) * part) as u32).next_power_of_two().min(all)
}
