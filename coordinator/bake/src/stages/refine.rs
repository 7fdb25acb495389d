//! Refining the receiving side of the mesh.

use std::f64::consts::SQRT_2;

use super::measure::without_noise;
use super::receiver_rows;
use super::receivers::receivers;
use super::{Bake, BakeError, Phase, light};
use crate::mesh::{PatchId, VertexId};
use crate::solver::fit::best_fit;
use crate::solver::refinement::MeshError;

/// Why refinement ends where more vertices would only follow the noise.
pub const NOISE_HIDES: &str = "noise of sampled visibility hides it: raise --rays or --exact-occluders";

/// What the prediction makes of the noise of sampled visibility: three vertices of half the variance each, on every level.
const NOISE_SEEN: f64 = 1.1;

/// Part of a leaf's square error that dividing it takes away, at least where light is smooth.
const GAIN: f64 = 0.75;

/// Least part of the square error whose leaves are divided in a round: rounds cost, too.
const LEAST_PER_ROUND: f64 = 0.25;

/// Most of it: what is revealed then tells better where to go on.
const MOST_PER_ROUND: f64 = 0.8;

impl Bake<'_, '_> {
    /// Divides patches where interpolation is wrong, round by round, until its error is expected to be under `limit`.
    #[tracing::instrument(skip_all)]
    pub(super) fn refine(&mut self, limit: f64) -> Result<(), BakeError> {
        let shortest_edge = super::extent(self.scene) * 2.0_f64.powi(-(self.settings.max_level as i32));
        self.mesh_obstacle = None;
        self.divide_long()?;
        loop {
            let prediction = self.predict();
            let noise = NOISE_SEEN * self.noise();
            let error = self.found_per_predicted * without_noise(prediction.relative(), noise);
            if error <= limit {
                break;
            }
            if error <= self.noise() {
                self.mesh_obstacle = Some(NOISE_HIDES);
                break;
            }
            // A divided patch brings up to five vertices, and may make its neighbours divide.
            let room = self.settings.max_vertices.saturating_sub(self.mesh.vertices.len()) / 5;
            if room == 0 {
                self.mesh_obstacle = Some("raise --max-vertices");
                break;
            }
            let may_divide = |id: PatchId| self.mesh.size(id) > shortest_edge;
            let mut worst = prediction.worst_leaves(part_to_divide(error, limit), room, may_divide);
            if worst.is_empty() {
                self.mesh_obstacle = Some("no patch is left that may be divided");
                break;
            }
            let first = VertexId(self.mesh.vertices.len() as u32);
            // Their vertices follow each other in the same order.
            self.mesh.sort_by_place(&mut worst);
            for id in worst {
                self.mesh.divide(id);
            }
            self.spent.rounds += 1;
            self.receive(first)?;
            self.show();
        }
        self.end_step("refine");
        Ok(())
    }

    /// Divides patches until none is longer than was asked for, or there are as many vertices as may be.
    fn divide_long(&mut self) -> Result<(), BakeError> {
        // A patch's diagonals, too, may become edges of triangles.
        let longest = |edge: f64| edge / self.scene.frame.scale / SQRT_2;
        let Some(longest) = self.settings.max_edge.map(longest) else { return Ok(()) };
        loop {
            let leaves = self.mesh.leaves().map(|(id, _)| id);
            let mut long: Vec<PatchId> = leaves.filter(|id| self.mesh.size(*id) > longest).collect();
            long.truncate(self.settings.max_vertices.saturating_sub(self.mesh.vertices.len()) / 5);
            if long.is_empty() {
                return Ok(());
            }
            let first = VertexId(self.mesh.vertices.len() as u32);
            self.mesh.sort_by_place(&mut long);
            for id in long {
                self.mesh.divide(id);
            }
            self.spent.rounds += 1;
            self.receive(first)?;
        }
    }

    /// The error of interpolation as vertices and guiding points tell it.
    pub(super) fn predict(&self) -> MeshError {
        let found = self.guides.compare(&self.mesh, &best_fit(&self.mesh, &self.irradiance));
        MeshError::predict(&self.mesh, &self.irradiance, &self.reflectance, &found)
    }

    /// Irradiance of the vertices from `first` on, from every source and share.
    fn receive(&mut self, first: VertexId) -> Result<(), BakeError> {
        self.office.enter(Phase::Refine, self.mesh.vertices.len());
        let rays = receiver_rows::rays(&self.mesh, first, self.settings, super::extent(self.scene));
        let id = self.rows.add_receivers(self.office, &receivers(&self.mesh, first), rays)?;
        let set = self.rows.set(id);
        self.vertex_sets.push(id);
        let direct = light::irradiance(&self.sources, set, self.office, |_, _, _| ())?;
        let mut gathered = self.channels.gathering(set.count());
        let radiosity = std::mem::take(&mut self.radiosity);
        self.look_at_rows(id, |share, row| gathered.add(row, radiosity[share.index()]))?;
        self.radiosity = radiosity;
        let gathered = gathered.into_irradiance();
        self.irradiance.extend(direct.iter().zip(gathered).map(|(direct, light)| *direct + light));
        self.direct.extend(direct);
        Ok(())
    }
}

/// Part of the square error whose leaves are divided in one round. No more than brings the error under the limit, if dividing
/// takes three quarters of a leaf's square error away; the last rounds then do not go past it.
fn part_to_divide(error: f64, limit: f64) -> f64 {
    let excess = 1.0 - (limit / error).powi(2);
    (excess / GAIN).clamp(LEAST_PER_ROUND, MOST_PER_ROUND)
}
