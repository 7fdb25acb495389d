//! Hemisphere rows, for finely tessellated scenes: those of receivers, made with rays.
//!
//! A shooter's row is exact, but looks for occluders of every pair, and pairs grow with the square of the mesh. In a scene of a
//! hundred thousand small triangles the light hardly depends on any one of them: there some thousand points send rays over their
//! hemispheres, and what they meet tells what they see of the shares. Light that surfaces reflect changes slowly: all other
//! receivers take it from the points around them. So the rays follow the light, whatever the number of vertices.
//!
//! Light sources keep their exact rows at every receiver: a small bright lamp would be found by few rays, and its shadows are sharp.
//! But what is dim and large is gathered, too.
//!
//! | file | what it does |
//! |---|---|
//! | `hemisphere` | what receivers see, by rays |
//! | `points` | gather points, with what they see |
//! | `rays` | how many rays each casts |
//! | `noise` | the noise of their rays |
//! | `nearest` | points that are near a receiver |
//! | `interpolation` | light between the points |
//! | `passes` | light passed on between points and shares until it is known |
//! | `set` | receivers that take their light from the points |
//! | `place` | where the points lie |
//! | `sky` | light between the points under an even sky |
//! | `weigh` | which of them each receiver takes its light from |
//! | `asked` | light of receivers that are asked about once |

mod asked;
mod hemisphere;
mod interpolation;
mod nearest;
mod noise;
mod passes;
mod place;
mod points;
pub mod rays;
mod set;
mod sky;
mod weigh;

use glam::DVec3;
use kernel::occluder::Occluder;
use kernel::replica::{Receiver, Receivers};

use super::local_radiosity::Radiosity;
use super::means::{Means, ShareValues};
use super::problem::Problem;
use super::share_mesh::ShareMesh;
use super::solution::Solution;
use super::source::{Cover, Gathered, LeafLight, RowSource};
use super::table::RowTable;
use super::vertices::COARSE;
use crate::context::Context;
use crate::error::Result;
use crate::jobs::{ReceiverSet, RowClient};
use crate::mesh::{ClusterLimits, Mesh, PatchId, Share, Surroundings};
use crate::refinement::{Cap, MOST_DRAWN, SamplePoints};
use crate::settings::{BakeSettings, RowStrategy};
use crate::solver::cache::{ColumnCache, SetId};
use hemisphere::{covered, gathered, hemispheres, publish_leaves, views};
use interpolation::Neighbours;
use noise::Twins;
use place::{FIRST_POINTS, MOST_POINTS};
use points::GatherPoints;
use set::{Set, cluster_limits};

/// Factor of the edge of shooters: leaves, whose light is constant, are made finer than shares are, since they cost next to nothing.
const EDGE_FACTOR: f64 = 1.0 / 3.0;

/// The gathering strategy.
#[derive(Default)]
pub struct GatherRows {
    /// The polygons of the shares, once they are published.
    polygons: Option<ReceiverSet>,
    /// Empty until they are placed.
    points: GatherPoints,
    /// Times that points were placed, each with seeds of its own.
    rounds: u32,
    /// What stands between receivers and gather points; none where no receiver takes its light from others' points.
    occluder: Option<Occluder>,
    twins: Twins,
    sets: Vec<Set>,
    /// Whether receivers may see an even sky, those too that are asked about and in no set.
    has_even_sky: bool,
    /// What gathers for receivers that are asked about in the end, where it has points and this has none.
    of_asked: Option<Box<GatherRows>>,
}

impl GatherRows {
    /// The points that others interpolate between, sorted.
    fn neighbours<'a>(&'a self, cx: &Context) -> Option<Neighbours<'a>> {
        let rays = rays::of_point(cx.settings);
        self.occluder.as_ref().map(|occluder| self.points.neighbours(rays, occluder, cx.extent()))
    }

    /// Irradiance of the receivers of a set, given that of the gather points.
    fn at_set(&self, set: SetId, points: &[DVec3]) -> Vec<DVec3> {
        self.sets[set.index()].weights.of(points)
    }
}

impl RowSource for GatherRows {
    fn strategy(&self) -> RowStrategy {
        RowStrategy::Gather
    }

    fn edge_factor(&self) -> f64 {
        EDGE_FACTOR
    }

    fn rays(&self, settings: &BakeSettings) -> u32 {
        rays::of_receiver(settings)
    }

    fn rays_of_point(&self, settings: &BakeSettings) -> u32 {
        rays::of_point(settings)
    }

    fn measures_twice(&self) -> bool {
        true
    }

    /// Each leaf: what rays meet has the light of its own place, whatever lies hidden beside it, and more leaves cost no rays.
    fn shares(&self, _: &Context, mesh: &Mesh, _: f64) -> Vec<Share> {
        mesh.leaf_shares()
    }

    fn joins_sources(&self) -> bool {
        true
    }

    fn rays_to_sources(&self, settings: &BakeSettings) -> u32 {
        rays::to_sources(settings)
    }

    fn open(&mut self, cx: &mut Context, mesh: &ShareMesh) -> RowTable {
        self.polygons = Some(publish_leaves(cx, &mesh.mesh));
        let rays = f64::from(rays::to_sources(cx.settings));
        cx.set_precision(cx.settings.clone().with_rays(rays).precision());
        // No shooter has a row of its own.
        RowTable::new(vec![], 0)
    }

    fn end(&mut self, client: &mut RowClient) {
        std::mem::take(self).polygons.into_iter().for_each(|set| client.release(set));
    }

    fn clusters(&self, settings: &BakeSettings) -> Option<ClusterLimits> {
        // What must be divided needs receivers of its own.
        settings.max_edge.is_none().then(|| cluster_limits(settings.asked_error()))
    }

    fn add_receivers(
        &mut self,
        cx: &mut Context,
        table: &mut RowTable,
        receivers: &Receivers,
        around: Option<&[Surroundings]>,
    ) -> Result<SetId> {
        let id = table.add_set(cx.client.publish_receivers(receivers), None);
        let shooter_edge = cx.settings.shooter_edge * cx.extent();
        let most_rays = rays::of_receiver(cx.settings);
        let mut set = Set::new(&receivers.receivers, around, shooter_edge, most_rays);
        if !self.points.receivers.is_empty() {
            set.weights = self.weigh(cx, &set.receivers, &set.rays)?;
        }
        self.sets.push(set);
        Ok(id)
    }

    fn see_sky(&mut self, set: SetId, sky_views: &[f64]) {
        self.has_even_sky = true;
        self.sets[set.index()].see_sky(sky_views.to_vec(), &self.points.sky_views());
    }

    fn gather(
        &mut self,
        _: &mut Context,
        mesh: &ShareMesh,
        _: &mut RowTable,
        sets: &[SetId],
        radiosities: &[Radiosity],
        wants_cover: bool,
    ) -> Result<Vec<Gathered>> {
        let lights: Vec<Vec<DVec3>> =
            radiosities.iter().map(|radiosity| self.points.gather(radiosity.shares)).collect();
        let covered = wants_cover.then(|| self.points.covered(&mesh.materials));
        let gathered = |set: &SetId| Gathered {
            light: lights.iter().map(|light| self.at_set(*set, light)).collect(),
            cover: covered.as_ref().map_or_else(Cover::default, |covered| {
                let sums: Vec<f64> =
                    self.at_set(*set, covered).into_iter().map(|sum| sum.x.clamp(0.0, 1.0)).collect();
                let sky_views = self.sets[set.index()].sky_views.as_deref();
                // What sees nothing but the sky is not covered by anything that lies on it.
                let sees_sky = |receiver: usize| sky_views.is_some_and(|views| views[receiver] > 0.0);
                let exposed = sums.iter().enumerate().map(|(receiver, sum)| *sum > 0.0 || sees_sky(receiver));
                Cover { exposed: exposed.collect(), sums, bytes: 0 }
            }),
        };
        Ok(sets.iter().map(gathered).collect())
    }

    fn gather_once(
        &mut self,
        cx: &mut Context,
        mesh: &ShareMesh,
        _: &mut RowTable,
        (_, receivers): (ReceiverSet, &Receivers),
        radiosities: &[Radiosity],
    ) -> Result<Gathered> {
        let Some(polygons) = self.polygons else { return Ok(Gathered::default()) };
        let views = views(cx.client, polygons, &hemispheres(receivers, |_| rays::of_draw(cx.settings)))?;
        let at = |radiosity: &Radiosity| views.iter().map(|view| gathered(view, radiosity.shares)).collect();
        let sums = views.iter().map(|view| covered(view, &mesh.materials)).collect();
        Ok(Gathered {
            light: radiosities.iter().map(at).collect(),
            cover: Cover { sums, ..Cover::default() },
        })
    }

    fn expect_many(
        &mut self,
        cx: &mut Context,
        mesh: &ShareMesh,
        receivers: (usize, &[Receiver]),
        light: (&[DVec3], Option<&[DVec3]>),
    ) -> Result<()> {
        self.place_for_asked(cx, mesh, receivers, light)
    }

    fn gather_many(
        &mut self,
        cx: &mut Context,
        mesh: &ShareMesh,
        _: &mut RowTable,
        (_, receivers, sky_views): (ReceiverSet, &Receivers, Option<&[f64]>),
        radiosities: &[Radiosity],
    ) -> Result<Gathered> {
        if let Some(asked) = &mut self.of_asked {
            return asked.gather_weighed(cx, mesh, (receivers, sky_views), radiosities);
        }
        self.gather_weighed(cx, mesh, (receivers, sky_views), radiosities)
    }

    fn interpolated(
        &mut self,
        cx: &mut Context,
        receivers: (&Receivers, Option<&[f64]>),
        radiosity: &[DVec3],
    ) -> Result<Option<Vec<DVec3>>> {
        self.weigh_once(cx, receivers, |weights, points| Some(weights.of(&points.gather(radiosity))))
    }

    fn add_points(&mut self, cx: &mut Context, mesh: &Mesh, expected: &[f64]) -> Result<bool> {
        let may_add = self.occluder.is_some() && self.points.placed < MOST_POINTS;
        if may_add {
            self.points.truncate(self.points.shared);
            let count = (self.points.placed / 2).clamp(FIRST_POINTS, MOST_DRAWN);
            let (_, looking, seen) = self.look_around(cx, mesh, expected, count)?;
            self.points.add_placed(looking, seen);
            self.weigh_all(cx)?;
        }
        Ok(may_add)
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

    fn shoot(
        &mut self,
        cx: &mut Context,
        mesh: &ShareMesh,
        _: &mut RowTable,
        direct: &[DVec3],
        glow: Option<&[DVec3]>,
    ) -> Result<Vec<DVec3>> {
        let radiosity = self.place(cx, mesh, direct, glow)?;
        self.weigh_all(cx)?;
        Ok(radiosity)
    }

    fn solve(
        &mut self,
        cx: &mut Context,
        table: &mut RowTable,
        problem: &Problem,
        _: &mut Option<ColumnCache>,
        solution: Solution,
    ) -> Result<Solution> {
        self.pass_on(cx, table, problem, solution)
    }

    fn ray_noise(&self, leaving: &[DVec3], level: f64) -> f64 {
        let part = self.sets.get(COARSE.index()).map_or(1.0, |set| set.weights.variance_part());
        let square = self.twins.square_noise(&self.points, leaving, Cap::NONE) * part;
        if level > 0.0 { square.sqrt() / level } else { 0.0 }
    }

    fn follow_mesh(&mut self, cx: &mut Context, mesh: &mut ShareMesh) -> Result<()> {
        let polygons = publish_leaves(cx, &mesh.mesh);
        self.polygons.replace(polygons).into_iter().for_each(|before| cx.client.release(before));
        self.points.look_again(cx.client, polygons)?;
        self.twins.look_again(cx.client, polygons)?;
        mesh.deal_out(cx.scene, mesh.mesh.leaf_shares());
        Ok(())
    }

    fn leaves_cost_rows(&self) -> bool {
        false
    }

    fn light_of_leaves(
        &self,
        cx: &mut Context,
        mesh: &ShareMesh,
        receivers: &Receivers,
        (irradiance, exposed, middles): (&[DVec3], &[bool], &SamplePoints),
    ) -> Result<LeafLight> {
        let set = publish_leaves(cx, &mesh.mesh);
        let views = views(cx.client, set, &hemispheres(receivers, |_| rays::of_draw(cx.settings)))?;
        cx.client.release(set);
        let means = Means::new(&mesh.mesh, &mesh.mesh.leaf_shares(), exposed).of(irradiance);
        let reflected = |((id, _), mean): ((PatchId, _), DVec3)| {
            let mean = middles.mean(&mesh.mesh, id, mean);
            mesh.patch_materials.of(cx.scene, &mesh.mesh, id).reflectance * mean
        };
        let radiosity: Vec<DVec3> = mesh.mesh.leaves().zip(means).map(reflected).collect();
        // The same rays meet shares and leaves.
        Ok(LeafLight {
            irradiance: views.iter().map(|view| gathered(view, &radiosity)).collect(),
            rows: None,
        })
    }
}
