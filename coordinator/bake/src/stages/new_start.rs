//! Where a bake is better started anew.

use super::shooting_mesh::ShootingMesh;
use crate::rows::Rows;
use crate::settings::BakeSettings;

/// Part of the asked error that rays may take after a new start.
pub const RAYS_PART: f64 = 0.3;

/// Settings to start with, and the rows that there were, which are to be ended.
pub struct NewStart {
    /// What there was.
    pub rows: Rows,
    /// Settings to start with.
    pub settings: BakeSettings,
    /// The mesh to start with, where these settings have no other.
    pub mesh: Option<ShootingMesh>,
}
