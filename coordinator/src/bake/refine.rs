//! Refining the receiving side of the mesh.

use glam::DVec3;
use shared::row::Shooter;

use super::{Bake, BakeError, Phase, light};
use crate::mesh::{PatchId, VertexId};
use crate::solver::add_row;
use crate::solver::refinement::MeshError;

impl Bake<'_> {
    /// Divides patches where interpolation is wrong, round by round, until the predicted error is under the wanted one.
    pub(super) fn refine(&mut self) -> Result<(), BakeError> {
        let sources = self.sources.iter().map(|source| source.shooter.clone());
        let shooters: Vec<Shooter> = sources.chain(self.shooters.iter().cloned()).collect();
        let shortest_edge = super::extent(self.scene) * 2.0_f64.powi(-(self.settings.max_level as i32));
        loop {
            let error = MeshError::predict(&self.mesh, &self.irradiance, &self.reflectance);
            self.mesh_error = error.relative();
            let limit = self.settings.max_vertices.min(self.settings.row_limit(self.shares.len()));
            // A divided patch brings up to five vertices, and may make its neighbours divide.
            let room = limit.saturating_sub(self.mesh.vertices.len()) / 5;
            let may_divide = |id: PatchId| self.mesh.size(id) > shortest_edge;
            let mut worst = error.worst_leaves(self.settings.mesh_error, room, may_divide);
            if worst.is_empty() {
                break;
            }
            let first = VertexId(self.mesh.vertices.len() as u32);
            // By place rather than by error: rows are cheaper when neighbours among the receivers are neighbours in space.
            worst.sort_unstable();
            for id in worst {
                self.mesh.divide(id);
            }
            self.rounds += 1;
            self.receive(first, &shooters)?;
        }
        self.end_step("refine");
        Ok(())
    }

    /// Irradiance of the vertices from `first` on, from every source and share.
    fn receive(&mut self, first: VertexId, shooters: &[Shooter]) -> Result<(), BakeError> {
        self.office.enter(Phase::Refine, self.mesh.vertices.len());
        let set = self.office.publish_receivers(&self.mesh, first);
        let mut rows = self.office.rows(shooters, set)?;
        self.office.release_receivers(set);
        let from_shares = rows.split_off(self.sources.len());
        let count = self.mesh.vertices.len();
        self.direct.resize(count, DVec3::ZERO);
        light::add(&mut self.direct, &self.sources, &rows);
        self.irradiance.extend_from_slice(&self.direct[first.index()..]);
        for ((row, more), radiosity) in self.rows.iter_mut().zip(from_shares).zip(&self.radiosity) {
            add_row(&mut self.irradiance[first.index()..], &more, *radiosity);
            row.extend_from_slice(&more);
        }
        Ok(())
    }
}
