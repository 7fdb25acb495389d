use glam::DVec3;
use kernel::replica::Receivers;
use kernel::row::{Row, Shooter};

use super::means::ShareValues;
use super::share_mesh::ShareMesh;
use super::solution::Solution;
use super::table::RowTable;
use crate::context::Context;
use crate::error::Result;
use crate::jobs::{ReceiverSet, RowClient};
use crate::mesh::{Mesh, Share, Surroundings};
use crate::settings::RowStrategy;
use crate::solver::ShareId;
use crate::solver::cache::{ColumnCache, SetId};
use scene::Scene;

/// A row strategy: how the rows of shares over receivers are made, and how light is solved for with them.
pub trait RowSource {
    /// The setting that chooses it.
    fn strategy(&self) -> RowStrategy;

    /// Longest edge of the shooting mesh, relative to the one in the settings.
    fn edge_factor(&self) -> f64;

    /// Deals the surface of the shooting mesh out among shares. `longest_edge` is that of its patches, in frame units.
    fn shares(&self, scene: &Scene, mesh: &Mesh, longest_edge: f64) -> Vec<Share>;

    /// Whether neighbouring light sources share a row.
    fn joins_sources(&self) -> bool;

    /// Publishes what rows are made from, and makes a table for them.
    fn open(&mut self, cx: &mut Context, mesh: &ShareMesh, shooters: Vec<Shooter>) -> RowTable;

    /// Releases what was published.
    fn close(self: Box<Self>, table: RowTable, client: &mut RowClient);

    /// Adds receivers to the table. Vertices come with their surroundings.
    fn add_receivers(
        &self,
        cx: &mut Context,
        table: &mut RowTable,
        receivers: &Receivers,
        around: Option<&[Surroundings]>,
    ) -> Result<SetId>;

    /// Hands over the row of each share over published receivers that are needed only once.
    fn each_over(
        &self,
        cx: &mut Context,
        table: &RowTable,
        receivers: (ReceiverSet, &Receivers),
        take: &mut dyn FnMut(ShareId, &Row),
    ) -> Result<()>;

    /// The same receivers with other rays, where the noise of rows must be measured by a second set.
    fn twins(&self, receivers: &Receivers) -> Option<Receivers>;

    /// How much of its hemisphere each share sees covered, from the same of the vertices of the shooting mesh.
    fn row_sums(&self, mesh: &ShareMesh, at_vertices: &[f64]) -> Vec<f64>;

    /// Where shares take their irradiance from before the mesh is refined. `exposed` tells which vertices see any surface.
    fn first_values(&self, mesh: &ShareMesh, exposed: &[bool]) -> ShareValues;

    /// Radiosity to start the first solution from.
    fn shoot(
        &self,
        cx: &mut Context,
        mesh: &ShareMesh,
        table: &mut RowTable,
        direct: &[DVec3],
    ) -> Result<Vec<DVec3>>;

    /// Solves for the radiosity of the shares, starting from that of `solution`. Clears the irradiance of the solution unless
    /// it is found on the way. `columns` are kept for the next problem with the same values.
    fn solve(
        &self,
        cx: &mut Context,
        table: &mut RowTable,
        problem: &Problem,
        columns: &mut Option<ColumnCache>,
        solution: Solution,
    ) -> Result<Solution>;

    /// Light that receivers get from the leaves of the refined mesh, each with its own mean radiosity.
    fn light_of_leaves(
        &self,
        cx: &mut Context,
        mesh: &ShareMesh,
        receivers: &Receivers,
        irradiance: &[DVec3],
    ) -> Result<LeafLight>;
}

/// What a solution is to solve.
pub struct Problem<'a> {
    /// The mesh with its shares.
    pub mesh: &'a ShareMesh,
    /// Where shares take their irradiance from.
    pub values: &'a ShareValues,
    /// Irradiance of the vertices from the light sources.
    pub direct: &'a [DVec3],
    /// The bound of what is missing, relative to the reflected flux.
    pub tolerance: f64,
}

impl Problem<'_> {
    /// Solves for radiosity and irradiance.
    pub fn solve(
        &self,
        cx: &mut Context,
        source: &dyn RowSource,
        table: &mut RowTable,
        solution: Solution,
    ) -> Result<Solution> {
        let mut solution = source.solve(cx, table, self, &mut None, solution)?;
        if solution.irradiance.is_empty() {
            table.complete(cx, self.mesh, self.direct, &mut solution)?;
        }
        Ok(solution)
    }
}

/// Light that receivers get from leaves.
pub struct LeafLight {
    /// Irradiance of the receivers.
    pub irradiance: Vec<DVec3>,
    /// Radiosity and variance of each row. None where its noise is that of the shares' rows.
    pub rows: Option<Vec<(DVec3, f64)>>,
}

/// The rows of a bake.
pub struct Rows {
    /// Makes them.
    pub source: Box<dyn RowSource>,
    /// Keeps them.
    pub table: RowTable,
}

impl Rows {
    /// Releases all that was published for them.
    pub fn release(self, client: &mut RowClient) {
        self.source.close(self.table, client);
    }
}
