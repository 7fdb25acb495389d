//! Hemisphere rows, for finely tessellated scenes: those of receivers, made with rays.
//!
//! A shooter's row is exact, but looks for occluders of every pair, and pairs grow with the square of the mesh. In a scene of a
//! hundred thousand small triangles the light hardly depends on any one of them: there each receiver sends rays over its
//! hemisphere, and its row tells what they meet. The time is linear in the number of vertices. Transposed, these rows are
//! rows of shares as exact ones are; only the leaves of the mesh take the place of the shares around vertices, since
//! a ray meets one of them.
//!
//! Light sources keep their exact rows: a small bright lamp would be found by few rays.

use glam::DVec3;
use kernel::geometry::ConvexPolygon;
use kernel::replica::{Receiver, Receivers, ScenePolygons};
use kernel::row::{Hemisphere, Row, Shape, Shooter};

use super::means::ShareValues;
use super::share_mesh::ShareMesh;
use super::solution::Solution;
use super::source::{LeafLight, Problem, RowSource};
use super::table::RowTable;
use crate::context::Context;
use crate::error::Result;
use crate::jobs::{ReceiverSet, RowClient};
use crate::mesh::{Mesh, PatchId, Share, Surroundings};
use crate::settings::RowStrategy;
use crate::solver::ShareId;
use crate::solver::acceleration::Acceleration;
use crate::solver::cache::{ColumnCache, SetId};
use scene::Scene;

/// Passes end here even if the accuracy was not reached; the bound is reported.
const MOST_PASSES: u32 = 1000;

/// Factor of the edge of shooters: leaves, whose light is constant, are made finer than shares are, since they cost next to nothing.
const EDGE_FACTOR: f64 = 1.0 / 3.0;

/// Size of the cells in which small leaves shoot together, relative to the longest edge of the shooters.
const CELL: f64 = 0.125;

/// Keys of the samples' twins, above those of the samples.
const TWIN_KEYS: u64 = 1 << 34;

/// Width of a vertex's surroundings, relative to the longest edge of the shooters, from which on it gets all rays of a hemisphere.
const WIDE: f64 = 0.125;

/// Least part of the rays that a vertex gets.
const LEAST_PART: f64 = 0.125;

/// The gathering strategy.
#[derive(Default)]
pub struct GatherRows {
    /// The polygons of the shares, once they are published.
    polygons: Option<ReceiverSet>,
    /// Share of each polygon.
    share_of: Vec<u32>,
}

impl GatherRows {
    /// The row of each share over some receivers.
    fn rows(&self, cx: &mut Context, receivers: &Receivers, rays: impl Fn(usize) -> u32) -> Result<Vec<Row>> {
        let Some(polygons) = self.polygons else { return Ok(vec![]) };
        hemisphere_rows(cx.client, polygons, &self.share_of, receivers, rays)
    }
}

impl RowSource for GatherRows {
    fn strategy(&self) -> RowStrategy {
        RowStrategy::Gather
    }

    fn edge_factor(&self) -> f64 {
        EDGE_FACTOR
    }

    fn shares(&self, scene: &Scene, mesh: &Mesh, longest_edge: f64) -> Vec<Share> {
        mesh.clustered_shares(CELL * longest_edge, |surface, facet| {
            scene.surfaces[surface as usize].facets[facet as usize].plane
        })
    }

    fn joins_sources(&self) -> bool {
        true
    }

    fn open(&mut self, cx: &mut Context, mesh: &ShareMesh, shooters: Vec<Shooter>) -> RowTable {
        let of_share = |(index, share): (u32, &Share)| {
            share.corners.chunk_by(|a, b| a.0 == b.0).map(|own| (own[0].0, index)).collect::<Vec<_>>()
        };
        let (leaves, share_of): (Vec<PatchId>, Vec<u32>) = (0..).zip(&mesh.shares).flat_map(of_share).unzip();
        let leaves = leaf_polygons(cx.scene, &mesh.mesh, leaves.into_iter());
        self.polygons = Some(cx.client.publish_polygons(&leaves.polygons, &leaves.opacities));
        self.share_of = share_of;
        RowTable::new(shooters, usize::MAX)
    }

    fn close(self: Box<Self>, table: RowTable, client: &mut RowClient) {
        table.release(client);
        self.polygons.into_iter().for_each(|set| client.release(set));
    }

    fn add_receivers(
        &self,
        cx: &mut Context,
        table: &mut RowTable,
        receivers: &Receivers,
        around: Option<&[Surroundings]>,
    ) -> Result<SetId> {
        let id = table.add_set(cx.client.publish_receivers(receivers));
        let all = cx.settings.rays_per_hemisphere;
        let wide = WIDE * cx.settings.shooter_edge * cx.extent();
        let rays = |index: usize| around.map_or(all, |around| rays_of_vertex(&around[index], wide, all));
        for (share, row) in (0..).map(ShareId).zip(self.rows(cx, receivers, rays)?) {
            table.cache().keep(id, share, row);
            table.made(id, share, 0.0);
        }
        Ok(id)
    }

    fn each_over(
        &self,
        cx: &mut Context,
        _: &RowTable,
        (_, receivers): (ReceiverSet, &Receivers),
        take: &mut dyn FnMut(ShareId, &Row),
    ) -> Result<()> {
        let rays = cx.settings.rays_per_hemisphere;
        let rows = self.rows(cx, receivers, |_| rays)?;
        rows.iter().enumerate().for_each(|(share, row)| take(ShareId(share as u32), row));
        Ok(())
    }

    fn twins(&self, receivers: &Receivers) -> Option<Receivers> {
        Some(Receivers { first_key: receivers.first_key + TWIN_KEYS, receivers: receivers.receivers.clone() })
    }

    fn row_sums(&self, mesh: &ShareMesh, at_vertices: &[f64]) -> Vec<f64> {
        let mean = |share: &Share| {
            let at = |(id, corner): &(PatchId, usize)| {
                let patch = mesh.mesh.patch(*id);
                at_vertices[patch.corners[*corner].index()] * patch.area / patch.corners.len() as f64
            };
            share.corners.iter().map(at).sum::<f64>() / share.area
        };
        mesh.shares.iter().map(mean).collect()
    }

    fn first_values(&self, mesh: &ShareMesh, exposed: &[bool]) -> ShareValues {
        ShareValues::means(mesh, exposed)
    }

    fn shoot(&self, _: &mut Context, mesh: &ShareMesh, _: &mut RowTable, _: &[DVec3]) -> Result<Vec<DVec3>> {
        Ok(vec![DVec3::ZERO; mesh.shares.len()])
    }

    /// Passes light on between receivers and shares: each share takes the mean of its part of the mesh, each receiver what its
    /// row gives it.
    fn solve(
        &self,
        cx: &mut Context,
        table: &mut RowTable,
        problem: &Problem,
        _: &mut Option<ColumnCache>,
        mut solution: Solution,
    ) -> Result<Solution> {
        let energies = &problem.mesh.energies;
        let flux = |radiosity: &[DVec3], areas: &[f64]| -> DVec3 {
            radiosity.iter().zip(areas).map(|(value, area)| *value * *area).sum()
        };
        let areas: Vec<f64> = energies.iter().map(|share| share.area).collect();
        let mut acceleration = Acceleration::new(areas.clone());
        for _ in 0..MOST_PASSES {
            table.complete(cx, problem.mesh, problem.direct, &mut solution)?;
            let incident = problem.values.of(energies, &solution.irradiance);
            problem.mesh.preview(cx, problem.direct, || {
                (solution.irradiance.clone(), problem.mesh.unshot(&incident, &solution.radiosity))
            });
            cx.work.sweeps += 1;
            let next: Vec<DVec3> =
                energies.iter().zip(&incident).map(|(share, mean)| share.reflectance * *mean).collect();
            let changes: Vec<DVec3> =
                next.iter().zip(&solution.radiosity).map(|(new, old)| (*new - *old).abs()).collect();
            let (changed, all) = (flux(&changes, &areas), flux(&next, &areas).element_sum());
            solution.unshot = changed;
            solution.residual = if all > 0.0 { changed.element_sum() / all } else { 0.0 };
            let before = std::mem::replace(&mut solution.radiosity, next);
            let reflectance = problem.mesh.mean_reflectance(&solution.radiosity);
            solution.unshot_bound = solution.residual * reflectance / (1.0 - reflectance);
            cx.client.monitor.set_unshot(solution.unshot_bound);
            if solution.unshot_bound <= problem.tolerance {
                break;
            }
            solution.radiosity = acceleration.next(before, &solution.radiosity);
        }
        table.complete(cx, problem.mesh, problem.direct, &mut solution)?;
        Ok(solution)
    }

    fn light_of_leaves(
        &self,
        cx: &mut Context,
        mesh: &ShareMesh,
        receivers: &Receivers,
        irradiance: &[DVec3],
    ) -> Result<LeafLight> {
        let leaves = leaf_polygons(cx.scene, &mesh.mesh, mesh.mesh.leaves().map(|(id, _)| id));
        let each: Vec<u32> = (0..leaves.polygons.len() as u32).collect();
        let set = cx.client.publish_polygons(&leaves.polygons, &leaves.opacities);
        let mut gathered = cx.channels.gathering(receivers.receivers.len());
        let rows = hemisphere_rows(cx.client, set, &each, receivers, |_| cx.settings.rays_per_hemisphere)?;
        for (row, (leaf, _)) in rows.iter().zip(mesh.mesh.leaves()) {
            gathered.add(row, mesh.leaf_radiosity(cx.scene, leaf, irradiance));
        }
        cx.client.release(set);
        // The same rays meet shares and leaves.
        Ok(LeafLight { irradiance: gathered.into_irradiance(), rows: None })
    }
}

/// The fewer rays, the smaller a vertex's surroundings are. Where vertices lie close together, the light of a piece of surface is
/// the mean of many, and so is their noise.
fn rays_of_vertex(around: &Surroundings, wide: f64, all: u32) -> u32 {
    let part = (around.area.sqrt() / wide).clamp(LEAST_PART, 1.0);
    // A power of two has the most even directions.
    ((f64::from(all) * part) as u32).next_power_of_two().min(all)
}

/// Leaves of a mesh as rays see them, each with its opacity where one is not opaque.
fn leaf_polygons(scene: &Scene, mesh: &Mesh, ids: impl Iterator<Item = PatchId>) -> ScenePolygons {
    let mut leaves = ScenePolygons::default();
    for id in ids {
        let patch = mesh.patch(id);
        let surface = &scene.surfaces[patch.surface as usize];
        let corners = mesh.corners(id);
        let opacity = if surface.opacity < 1.0 { surface.mean_opacity(patch.facet, &corners) } else { 1.0 };
        let plane = surface.facets[patch.facet as usize].plane;
        leaves.polygons.push(ConvexPolygon { plane, corners });
        leaves.opacities.push(opacity.clamp(0.0, 1.0) as f32);
    }
    if leaves.opacities.iter().all(|opacity| *opacity == 1.0) {
        leaves.opacities.clear();
    }
    leaves
}

/// What receivers see of polygons, as a row for each share of them over all receivers. `share_of` gives the share of each polygon.
fn hemisphere_rows(
    client: &mut RowClient,
    polygons: ReceiverSet,
    share_of: &[u32],
    receivers: &Receivers,
    rays: impl Fn(usize) -> u32,
) -> Result<Vec<Row>> {
    let hemisphere = |(index, receiver): (usize, &Receiver)| {
        let rays = rays(index).clamp(1, Hemisphere::MOST_RAYS);
        let shape = Shape::Hemisphere(Hemisphere { receiver: *receiver, rays });
        Shooter { key: receivers.first_key + index as u64, shape }
    };
    let shooters: Vec<Shooter> = receivers.receivers.iter().enumerate().map(hemisphere).collect();
    let shares = share_of.iter().max().map_or(0, |last| last + 1);
    let mut by_share: Vec<Vec<(usize, f32)>> = vec![vec![]; shares as usize];
    client.each_row(&shooters, polygons, |receiver, row, _| {
        row.for_each(|polygon, factor| {
            let own = &mut by_share[share_of[polygon] as usize];
            match own.last_mut().filter(|last| last.0 == receiver) {
                Some(last) => last.1 += factor,
                None => own.push((receiver, factor)),
            }
        });
    })?;
    Ok(by_share.into_iter().map(|factors| Row::of_some(shooters.len(), &factors)).collect())
}
