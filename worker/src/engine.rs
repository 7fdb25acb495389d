//! Computes rows: pure, the same bits for the same request on every machine.

use shared::form_factor::PreparedPolygon;
use shared::geometry::ConvexPolygon;
use shared::occluder::Occluder;
use shared::protocol::RowStatistics;
use shared::replica::{Receiver, Receivers};
use shared::row::{Precision, Shape, Shooter};
use shared::visibility::{ReceiverGroups, VisibilityKernel, pair_seed};

/// A scene replica made ready.
pub struct Scene {
    occluder: Occluder,
}

impl Scene {
    /// Builds the BVH. The same polygons give the same bits everywhere.
    #[must_use]
    pub fn new(polygons: &[ConvexPolygon]) -> Self {
        Self { occluder: Occluder::new(polygons) }
    }
}

/// A receiver replica made ready.
pub struct ReceiverSet {
    /// Key of the first receiver.
    pub first_key: u64,
    /// The receivers.
    pub groups: ReceiverGroups,
}

impl ReceiverSet {
    /// Groups the receivers.
    #[must_use]
    pub fn new(receivers: Receivers) -> Self {
        Self { first_key: receivers.first_key, groups: ReceiverGroups::new(receivers.receivers) }
    }
}

/// Computes the row of one shooter over these receivers; `first_key` is the key of the first of them.
#[must_use]
pub fn compute_row(
    scene: &Scene,
    groups: &ReceiverGroups,
    first_key: u64,
    shooter: &Shooter,
    precision: &Precision,
) -> (Vec<f32>, RowStatistics) {
    let mut statistics = RowStatistics::default();
    let receivers = groups.receivers();
    let row = match &shooter.shape {
        Shape::Polygons(polygons) => {
            let mut kernel = VisibilityKernel::new(&scene.occluder, precision);
            let mut factors = vec![0.0; receivers.len()];
            let seed = |index: usize| pair_seed(precision.seed, shooter.key, first_key + index as u64);
            for polygon in polygons.iter().map(PreparedPolygon::new) {
                kernel.add_form_factors(groups, &polygon, seed, &mut factors, &mut statistics);
            }
            factors.into_iter().map(|factor| factor as f32).collect()
        }
        Shape::Point(light) => {
            let weight = |_| 1.0;
            receivers.iter().map(|r| point_light_factor(scene, r, *light, weight, &mut statistics)).collect()
        }
        Shape::PlanarPoint(light) => {
            let weight = |direction: glam::DVec3| 2.0 * direction.y.abs();
            receivers.iter().map(|r| point_light_factor(scene, r, *light, weight, &mut statistics)).collect()
        }
    };
    (row, statistics)
}

/// V w cos / r^2: what a point light of unit intensity, times `weight` of the direction to it, gives a receiver.
fn point_light_factor(
    scene: &Scene,
    receiver: &Receiver,
    light: glam::DVec3,
    weight: impl Fn(glam::DVec3) -> f64,
    statistics: &mut RowStatistics,
) -> f32 {
    statistics.pairs += 1;
    let to_light = light - receiver.position;
    let squared = to_light.length_squared();
    let cosine = receiver.normal.dot(to_light) / squared.sqrt();
    // A light in the receiver's plane, or at the very point, gives nothing.
    if cosine.is_nan() || cosine <= 0.0 {
        return 0.0;
    }
    statistics.factors += 1;
    if !scene.occluder.is_empty() {
        statistics.rays += 1;
        if scene.occluder.blocks(receiver.position, light, [receiver.plane; 2]) {
            statistics.occluded_pairs += 1;
            return 0.0;
        }
    }
    (weight(to_light / squared.sqrt()) * cosine / squared).min(f64::from(f32::MAX)) as f32
}
