//! Exact rows: those of shooters, with visibility computed pair by pair, exactly where little stands between. Solved for by
//! shooting, then by sweeps.

use glam::DVec3;
use kernel::replica::Receivers;
use kernel::row::{Shape, Shooter};

use super::factors::{Factors, solved};
use super::local_radiosity::Radiosity;
use super::means::ShareValues;
use super::near::NearShares;
use super::problem::Problem;
use super::share_mesh::ShareMesh;
use super::shoot;
use super::solution::Solution;
use super::source::{Cover, Gathered, LeafLight, RowSource};
use super::table::RowTable;
use crate::channels::{Channels, Gathering};
use crate::context::Context;
use crate::error::Result;
use crate::jobs::{ReceiverSet, RowClient};
use crate::mesh::{ClusterLimits, Mesh, Share, Surroundings};
use crate::refinement::SamplePoints;
use crate::settings::{BakeSettings, RowStrategy};
use crate::solver::bounds::add_to_sums;
use crate::solver::cache::{ColumnCache, SetId};
use crate::solver::slab::Slab;
use crate::solver::{ShareEnergy, ShareId};

/// Shadow lines are for receivers. Shares end at them too, where light jumps, unless they would be more than this many times those
/// of the mesh without lines: then these shoot.
const MOST_BY_LINES: f64 = 1.25;

/// Key of the first leaf as a shooter: above all shares and light sources.
const FIRST_LEAF_KEY: u64 = 1 << 40;

/// The exact strategy.
pub struct ExactRows;

impl RowSource for ExactRows {
    fn strategy(&self) -> RowStrategy {
        RowStrategy::Exact
    }

    fn edge_factor(&self) -> f64 {
        1.0
    }

    fn rays(&self, settings: &BakeSettings) -> u32 {
        settings.rays_per_hemisphere
    }

    fn measures_twice(&self) -> bool {
        false
    }

    fn shares(&self, cx: &Context, mesh: &Mesh, longest_edge: f64) -> Vec<Share> {
        let own = mesh.shares(cx.scene);
        if !mesh.has_lines {
            return own;
        }
        let without = Mesh::new(cx.scene, cx.extent(), longest_edge, cx.settings.max_level, &[]);
        let shares = without.shares(cx.scene);
        if own.len() as f64 <= MOST_BY_LINES * shares.len() as f64 {
            return own;
        }
        mesh.overlaid(&without, shares, longest_edge, cx.scene)
    }

    fn joins_sources(&self) -> bool {
        false
    }

    fn open(&mut self, cx: &mut Context, mesh: &ShareMesh) -> RowTable {
        let shooter =
            |(key, share): (u64, &Share)| Shooter { key, shape: Shape::Polygons(share.polygons.clone()) };
        let shooters = (0..).zip(&mesh.shares).map(shooter).collect();
        RowTable::new(shooters, cx.settings.row_cache.saturating_mul(1 << 20))
    }

    fn end(&mut self, _: &mut RowClient) {}

    /// Rows and means are over the vertices themselves.
    fn clusters(&self, _: &BakeSettings) -> Option<ClusterLimits> {
        None
    }

    fn add_receivers(
        &mut self,
        cx: &mut Context,
        table: &mut RowTable,
        receivers: &Receivers,
        _: Option<&[Surroundings]>,
    ) -> Result<SetId> {
        Ok(table.add_set(cx.client.publish_receivers(receivers), Some(&receivers.receivers)))
    }

    fn gather(
        &mut self,
        cx: &mut Context,
        mesh: &ShareMesh,
        table: &mut RowTable,
        sets: &[SetId],
        radiosities: &[Radiosity],
        wants_cover: bool,
    ) -> Result<Vec<Gathered>> {
        let empty = |set: &SetId| Cover::of(if wants_cover { table.set(*set).count() } else { 0 });
        let mut covers: Vec<Cover> = sets.iter().map(empty).collect();
        let look = |set: usize, shares: &[ShareId], slab: &Slab| {
            if wants_cover {
                covers[set].add(slab, |row| mesh.materials[shares[row].index()].opacity);
            }
        };
        let light = table.gather_each(cx, &mesh.mesh, sets, radiosities, look)?;
        let mut by_set: Vec<Gathered> =
            covers.into_iter().map(|cover| Gathered { light: vec![], cover }).collect();
        for light in light {
            by_set.iter_mut().zip(light).for_each(|(gathered, light)| gathered.light.push(light));
        }
        Ok(by_set)
    }

    fn gather_once(
        &mut self,
        cx: &mut Context,
        mesh: &ShareMesh,
        table: &mut RowTable,
        (set, receivers): (ReceiverSet, &Receivers),
        radiosities: &[Radiosity],
    ) -> Result<Gathered> {
        let mut light: Vec<Gathering> =
            radiosities.iter().map(|_| cx.channels.gathering(set.count())).collect();
        let mut sums = vec![0.0; set.count()];
        let mut near = NearShares::default();
        cx.client.each_row(table.shooters(), &[set], |_, share, row, _| {
            light
                .iter_mut()
                .zip(radiosities)
                .for_each(|(light, radiosity)| light.add(row, radiosity.wholes()[share]));
            near.add(ShareId(share as u32), row);
            add_to_sums(row, mesh.materials[share].opacity, &mut sums);
        })?;
        near.sort();
        let mut light: Vec<Vec<DVec3>> = light.into_iter().map(Gathering::into_irradiance).collect();
        for (light, radiosity) in light.iter_mut().zip(radiosities) {
            if let Some(local) = radiosity.local {
                near.add_light(&mut cx.client.monitor, &mesh.mesh, &receivers.receivers, local, light)?;
            }
        }
        Ok(Gathered { light, cover: Cover { sums, ..Cover::default() } })
    }

    fn add_points(&mut self, _: &mut Context, _: &Mesh, _: &[f64]) -> Result<bool> {
        Ok(false)
    }

    fn row_sums(&self, mesh: &ShareMesh, at_vertices: &[f64]) -> Vec<f64> {
        self.first_values(mesh, &vec![true; at_vertices.len()]).of(&mesh.energies, at_vertices)
    }

    fn first_values(&self, mesh: &ShareMesh, exposed: &[bool]) -> ShareValues {
        if mesh.is_overlaid() { ShareValues::means(mesh, exposed) } else { ShareValues::AtVertices }
    }

    fn shoot(
        &mut self,
        cx: &mut Context,
        mesh: &ShareMesh,
        table: &mut RowTable,
        direct: &[DVec3],
        _: Option<&[DVec3]>,
    ) -> Result<Vec<DVec3>> {
        match cx.channels {
            Channels::One(colour) => shoot::shoot::<f64>(cx, mesh, table, direct, colour),
            Channels::Three => shoot::shoot::<DVec3>(cx, mesh, table, direct, DVec3::ONE),
        }
    }

    fn solve(
        &mut self,
        cx: &mut Context,
        table: &mut RowTable,
        problem: &Problem,
        columns: &mut Option<ColumnCache>,
        solution: Solution,
    ) -> Result<Solution> {
        let (means, energies, direct) = match problem.values {
            ShareValues::AtVertices => (None, problem.mesh.energies.clone(), problem.direct.to_vec()),
            ShareValues::Means(means) => {
                // Each share receives its own mean.
                let itself = |(receiver, share): (usize, &ShareEnergy)| ShareEnergy { receiver, ..*share };
                let energies = problem.mesh.energies.iter().enumerate().map(itself).collect();
                (Some(means), energies, means.of(problem.direct))
            }
        };
        // Sweeps go over the columns again and again, over the rows they are computed from once: columns come first.
        let bytes = if means.is_some() { table.coarse_bytes + table.coarse_bytes / 4 } else { 0 };
        let reserved = table.cache().reserve(bytes);
        let vertices: Vec<SetId> = table.vertices.sets().collect();
        let bounds = table.bounds.clone();
        let mut transfer = Factors {
            bounds: &bounds,
            client: cx.client,
            means,
            sets: &vertices,
            columns: columns.take().unwrap_or_else(|| ColumnCache::new(reserved, energies.len())),
            table,
        };
        let (guess, tolerance) = (&solution.radiosity, problem.tolerance);
        let solved = match cx.channels {
            Channels::One(colour) => {
                solved::<f64>(&energies, &mut transfer, colour, &direct, guess, tolerance)?
            }
            Channels::Three => {
                solved::<DVec3>(&energies, &mut transfer, DVec3::ONE, &direct, guess, tolerance)?
            }
        };
        let Factors { table, columns: made, .. } = transfer;
        table.most_bytes = table.most_bytes.max(made.bytes() + table.cache().bytes());
        table.cache().reserve(0);
        *columns = Some(made);
        cx.work.sweeps += solved.sweeps;
        cx.client.monitor.set_unshot(solved.missing);
        Ok(Solution {
            radiosity: solved.radiosity,
            irradiance: vec![],
            unshot: solved.unshot,
            unshot_bound: solved.missing,
            residual: solved.residual,
            ..solution
        })
    }

    fn ray_noise(&self, _: &[DVec3], _: f64) -> f64 {
        0.0
    }

    fn follow_mesh(&mut self, _: &mut Context, _: &mut ShareMesh) -> Result<()> {
        Ok(())
    }

    fn leaves_cost_rows(&self) -> bool {
        true
    }

    fn light_of_leaves(
        &self,
        cx: &mut Context,
        mesh: &ShareMesh,
        receivers: &Receivers,
        (irradiance, ..): (&[DVec3], &[bool], &SamplePoints),
    ) -> Result<LeafLight> {
        let (mut shooters, mut radiosities) = (vec![], vec![]);
        for (id, _) in mesh.mesh.leaves() {
            let reflected = mesh.leaf_radiosity(cx.scene, id, irradiance);
            if reflected == DVec3::ZERO {
                continue;
            }
            let shape = Shape::Polygons(vec![mesh.mesh.polygon(cx.scene, id)]);
            shooters.push(Shooter { key: FIRST_LEAF_KEY + u64::from(id.0), shape });
            radiosities.push(reflected);
        }
        let set = cx.client.publish_receivers(receivers);
        let mut gathered = cx.channels.gathering(receivers.receivers.len());
        let mut rows = Vec::with_capacity(shooters.len());
        cx.client.each_row(&shooters, &[set], |_, leaf, row, variance| {
            gathered.add(row, radiosities[leaf]);
            rows.push((radiosities[leaf], variance));
        })?;
        cx.client.release(set);
        Ok(LeafLight { irradiance: gathered.into_irradiance(), rows: Some(rows) })
    }
}
