//! Computes rows: pure, the same bits for the same request on every machine.

use shared::geometry::ConvexPolygon;
use shared::protocol::RowStatistics;
use shared::replica::Receiver;
use shared::row::{Sampling, Shooter};

/// A scene replica made ready: occluders behind their BVH.
pub struct Scene {}

impl Scene {
    /// Builds the BVH. The same polygons give the same bits everywhere.
    #[must_use]
    pub fn new(_polygons: &[ConvexPolygon]) -> Self {
        Self {}
    }
}

/// Computes the row of one shooter over these receivers; `first_key` is the key of the first of them.
#[must_use]
pub fn compute_row(
    _scene: &Scene,
    receivers: &[Receiver],
    _first_key: u64,
    _shooter: &Shooter,
    _sampling: &Sampling,
) -> (Vec<f32>, RowStatistics) {
    (vec![0.0; receivers.len()], RowStatistics::default())
}
