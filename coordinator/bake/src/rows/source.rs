use std::borrow::Cow;

use glam::DVec3;
use kernel::replica::{Receiver, Receivers};

use super::local_radiosity::Radiosity;
use super::means::ShareValues;
use super::problem::Problem;
use super::share_mesh::ShareMesh;
use super::solution::Solution;
use super::table::RowTable;
use super::vertices::{COARSE, VertexSets};
use crate::context::Context;
use crate::error::Result;
use crate::jobs::{ReceiverSet, RowClient};
use crate::mesh::{
    ClusterLimits, Mesh, Share, Surroundings, VertexId, VertexReceivers, receivers, shared_receivers,
};
use crate::refinement::SamplePoints;
use crate::settings::{BakeSettings, RowStrategy};
use crate::solver::bounds::add_slab_to_sums;
use crate::solver::cache::{ColumnCache, SetId};
use crate::solver::slab::Slab;

/// A row strategy: how the rows of shares over receivers are made, and how light is solved for with them.
pub trait RowSource: Send {
    /// The setting that chooses it.
    fn strategy(&self) -> RowStrategy;

    /// Longest edge of the shooting mesh, relative to the one in the settings.
    fn edge_factor(&self) -> f64;

    /// Rays of a hemisphere, where it has any.
    fn rays(&self, settings: &BakeSettings) -> u32;

    /// Rays of a gather point, where it has any.
    fn rays_of_point(&self, settings: &BakeSettings) -> u32 {
        self.rays(settings)
    }

    /// Rays per hemisphere for light sources.
    fn rays_to_sources(&self, settings: &BakeSettings) -> u32 {
        self.rays(settings)
    }

    /// Whether light that the answer is measured by is gathered twice: it is where it comes by rays, and costs little.
    fn measures_twice(&self) -> bool;

    /// Deals the surface of the shooting mesh out among shares. `longest_edge` is that of its patches, in frame units.
    fn shares(&self, cx: &Context, mesh: &Mesh, longest_edge: f64) -> Vec<Share>;

    /// Whether neighbouring light sources share a row, and those that are dim and many are gathered with what surfaces reflect.
    fn joins_sources(&self) -> bool;

    /// Publishes what rows are made from, and makes a table for them. The key of a share as a shooter is its index.
    fn open(&mut self, cx: &mut Context, mesh: &ShareMesh) -> RowTable;

    /// Releases what was published, and drops what answers are made from: nothing will be asked any more.
    fn end(&mut self, client: &mut RowClient);

    /// Which leaves of small things share a receiver, with widths relative to the scene's extent. None where a solution takes the rows of
    /// the table for those of the vertices.
    fn clusters(&self, settings: &BakeSettings) -> Option<ClusterLimits>;

    /// Adds receivers to the table. Vertices come with their surroundings.
    fn add_receivers(
        &mut self,
        cx: &mut Context,
        table: &mut RowTable,
        receivers: &Receivers,
        around: Option<&[Surroundings]>,
    ) -> Result<SetId>;

    /// Tells how much of an even sky each receiver of a set sees: its sky view factor. It must be told once, before the set is
    /// asked about, where there is such a sky.
    fn see_sky(&mut self, _: SetId, _: &[f64]) {}

    /// What shares of each of these radiosities give the receivers of some sets, set by set. Their cover is empty unless it is wanted.
    fn gather(
        &mut self,
        cx: &mut Context,
        mesh: &ShareMesh,
        table: &mut RowTable,
        sets: &[SetId],
        radiosities: &[Radiosity],
        wants_cover: bool,
    ) -> Result<Vec<Gathered>>;

    /// The same of published receivers that are asked about only once. Their cover has only the sums.
    fn gather_once(
        &mut self,
        cx: &mut Context,
        mesh: &ShareMesh,
        table: &mut RowTable,
        receivers: (ReceiverSet, &Receivers),
        radiosities: &[Radiosity],
    ) -> Result<Gathered>;

    /// Gets ready for this many receivers, which lie among these, given the radiosity of the shares and what they emit beside the light of
    /// the sources.
    fn expect_many(
        &mut self,
        _: &mut Context,
        _: &ShareMesh,
        _: (usize, &[Receiver]),
        _: (&[DVec3], Option<&[DVec3]>),
    ) -> Result<()> {
        Ok(())
    }

    /// The same of many receivers, whose light may be interpolated as that of vertices is, with their sky view factors where there is an
    /// even sky.
    fn gather_many(
        &mut self,
        cx: &mut Context,
        mesh: &ShareMesh,
        table: &mut RowTable,
        (set, receivers, _): (ReceiverSet, &Receivers, Option<&[f64]>),
        radiosities: &[Radiosity],
    ) -> Result<Gathered> {
        self.gather_once(cx, mesh, table, (set, receivers), radiosities)
    }

    /// Irradiance from shares of this radiosity, interpolated between gather points as that of vertices is, given the sky view
    /// factors of the receivers where there is an even sky; `None` where the strategy does not interpolate.
    fn interpolated(
        &mut self,
        _: &mut Context,
        _: (&Receivers, Option<&[f64]>),
        _: &[DVec3],
    ) -> Result<Option<Vec<DVec3>>> {
        Ok(None)
    }

    /// Adds gather points by the square error that is expected of light between them in each leaf of the refined mesh; all receivers then
    /// take their light from these, too. False where the strategy has none, or as many as it may have.
    fn add_points(&mut self, cx: &mut Context, mesh: &Mesh, expected: &[f64]) -> Result<bool>;

    /// How much of its hemisphere each share sees covered, from the same of the vertices of the shooting mesh.
    fn row_sums(&self, mesh: &ShareMesh, at_vertices: &[f64]) -> Vec<f64>;

    /// Where shares take their irradiance from before the mesh is refined. `exposed` tells which vertices see any surface.
    fn first_values(&self, mesh: &ShareMesh, exposed: &[bool]) -> ShareValues;

    /// Radiosity to start the first solution from. `glow` is what shares emit beside the direct light; none where sources are not
    /// [joined](Self::joins_sources).
    fn shoot(
        &mut self,
        cx: &mut Context,
        mesh: &ShareMesh,
        table: &mut RowTable,
        direct: &[DVec3],
        glow: Option<&[DVec3]>,
    ) -> Result<Vec<DVec3>>;

    /// Solves for the radiosity of the shares, starting from that of `solution`. Clears the irradiance of the solution unless
    /// it is found on the way. `columns` are kept for the next problem with the same values.
    fn solve(
        &mut self,
        cx: &mut Context,
        table: &mut RowTable,
        problem: &Problem,
        columns: &mut Option<ColumnCache>,
        solution: Solution,
    ) -> Result<Solution>;

    /// Relative standard error of the irradiance at a point from the rays of hemispheres, of shares with this radiosity, exitance
    /// included, where irradiance is of this level.
    fn ray_noise(&self, leaving: &[DVec3], level: f64) -> f64;

    /// Makes the leaves of the refined mesh the shares, where [these cost no rows](Self::leaves_cost_rows).
    fn follow_mesh(&mut self, cx: &mut Context, mesh: &mut ShareMesh) -> Result<()>;

    /// Whether a share more, or [`Self::light_of_leaves`], takes a row for each leaf.
    fn leaves_cost_rows(&self) -> bool;

    /// Light that receivers get from the leaves of the refined mesh, each with its own mean radiosity, given the irradiance of the
    /// vertices, whether each sees any surface, and the middles.
    fn light_of_leaves(
        &self,
        cx: &mut Context,
        mesh: &ShareMesh,
        receivers: &Receivers,
        light: (&[DVec3], &[bool], &SamplePoints),
    ) -> Result<LeafLight>;
}

/// What receivers get from shares.
#[derive(Default)]
pub struct Gathered {
    /// Irradiance of the receivers, by the radiosities that were given.
    pub light: Vec<Vec<DVec3>>,
    /// What the receivers see.
    pub cover: Cover,
}

/// How much of their hemispheres receivers see covered.
#[derive(Default)]
pub struct Cover {
    /// Sum of the form factors of each.
    pub sums: Vec<f64>,
    /// Whether each sees any surface, or the sky.
    pub exposed: Vec<bool>,
    /// Bytes of the rows.
    pub bytes: usize,
}

impl Cover {
    /// Nothing seen by this number of receivers.
    pub fn of(receivers: usize) -> Self {
        Self { sums: vec![0.0; receivers], exposed: vec![false; receivers], bytes: 0 }
    }

    /// Adds the rows of some shares, given the opacity of each.
    pub fn add(&mut self, slab: &Slab, opacity: impl Fn(usize) -> f64 + Sync) {
        self.bytes += slab.rows().iter().map(|row| row.bytes()).sum::<usize>();
        slab.add(&mut self.exposed, |_, part, mask, _| {
            part.iter_mut().enumerate().for_each(|(i, exposed)| *exposed |= mask >> i & 1 == 1);
        });
        add_slab_to_sums(slab, opacity, &mut self.sums);
    }
}

/// What leaves shares that reflect and glow so much.
pub fn leaving<'a>(radiosity: &'a [DVec3], glow: Option<&[DVec3]>) -> Cow<'a, [DVec3]> {
    glow.map_or(Cow::Borrowed(radiosity), |glow| {
        radiosity.iter().zip(glow).map(|(reflected, emitted)| *reflected + *emitted).collect()
    })
}

impl Problem<'_> {
    /// Solves for radiosity and irradiance.
    pub fn solve(
        &self,
        cx: &mut Context,
        source: &mut dyn RowSource,
        table: &mut RowTable,
        solution: Solution,
    ) -> Result<Solution> {
        let mut solution = source.solve(cx, table, self, &mut None, solution)?;
        if solution.irradiance.is_empty() {
            table.complete(cx, self, &mut solution)?;
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
    /// Adds the vertices of the shooting mesh: before all others.
    pub fn add_coarse(&mut self, cx: &mut Context, mesh: &Mesh) -> Result<()> {
        let Self { source, table } = self;
        let limits = source.clusters(cx.settings);
        let limits = limits.map(|limits| ClusterLimits { width: limits.width * cx.extent(), ..limits });
        let (VertexReceivers { receivers, around }, of_vertices) = shared_receivers(mesh, limits);
        let (vertices, count) = (mesh.vertices.len(), receivers.receivers.len());
        tracing::debug!(vertices, receivers = count, "vertices share receivers");
        let set = source.add_receivers(cx, table, &receivers, Some(&around))?;
        debug_assert_eq!(set, COARSE, "they come first");
        table.vertices = VertexSets::new(mesh.vertices.len(), of_vertices);
        Ok(())
    }

    /// Adds the vertices of a mesh from `first` on.
    pub fn add_vertices(&mut self, cx: &mut Context, mesh: &Mesh, first: VertexId) -> Result<SetId> {
        let VertexReceivers { receivers, around } = receivers(mesh, first);
        let set = self.source.add_receivers(cx, &mut self.table, &receivers, Some(&around))?;
        self.table.vertices.push(set);
        Ok(set)
    }

    /// Releases all that was published for them, and drops what answers are made from: nothing will be asked any more.
    pub fn end(&mut self, client: &mut RowClient) {
        self.source.end(client);
        self.table.end(client);
    }
}
