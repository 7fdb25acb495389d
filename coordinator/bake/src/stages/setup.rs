//! The shooting mesh, its shares and the light sources.

use glam::DVec3;

use super::light;
use super::light_source::LightSource;
use super::shooting_mesh::ShootingMesh;
use crate::context::Context;
use crate::error::{BakeError, Result};
use crate::mesh::PatchId;
use crate::refinement::{Draw, SamplePoints};
use crate::rows::{Rows, ShareMesh};

/// Longest edge of the smallest leaves whose middles are looked at, relative to that of the largest.
const LEAST_MIDDLE: f64 = 0.125;

/// Key of the first middle of a leaf as a receiver, above those of all samples and gather points.
const FIRST_MIDDLE: u64 = 1 << 38;

/// A bake before any light.
pub struct Setup {
    pub mesh: ShareMesh,
    /// Longest edge of its patches, in frame units.
    pub longest_edge: f64,
    pub rows: Rows,
    pub sources: Vec<LightSource>,
    /// Points that guide refinement.
    pub samples: SamplePoints,
    /// Middles of large leaves.
    pub middles: SamplePoints,
}

impl Setup {
    /// Deals a shooting mesh out among shares, and publishes its vertices as receivers.
    pub fn new(cx: &mut Context, shooting: ShootingMesh) -> Result<Self> {
        let ShootingMesh { mesh, longest_edge, mut source } = shooting;
        cx.client.monitor.check()?;
        cx.client.monitor.set_error(None);
        let (scene, settings) = (cx.scene, cx.settings);
        if mesh.patches.is_empty() {
            return Err(BakeError::EmptyMesh);
        }
        let shares = source.shares(cx, &mesh, longest_edge);
        let mesh = ShareMesh::new(scene, mesh, shares);
        let first_key = mesh.shares.len() as u64;
        let sources = light::sources(scene, &mesh.mesh, settings, first_key, source.joins_sources());
        let table = source.open(cx, &mesh);
        let mut rows = Rows { source, table };
        rows.add_coarse(cx, &mesh.mesh)?;
        let samples = SamplePoints::draw(&mesh.mesh, scene, settings, &[], Draw::default());
        let middles = if rows.source.leaves_cost_rows() {
            SamplePoints::default()
        } else {
            let least = LEAST_MIDDLE * longest_edge;
            let reflects =
                |id: PatchId| scene.surfaces[mesh.mesh.patch(id).surface as usize].reflectance != DVec3::ZERO;
            let leaves = mesh.mesh.leaves().map(|(id, _)| id);
            let leaves: Vec<PatchId> =
                leaves.filter(|id| mesh.mesh.size(*id) > least && reflects(*id)).collect();
            SamplePoints::middles(&mesh.mesh, scene, &leaves, FIRST_MIDDLE)
        };
        cx.end_step("mesh");
        Ok(Self { mesh, longest_edge, rows, sources, samples, middles })
    }
}
