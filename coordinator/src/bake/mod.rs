//! One bake from scene to lit mesh: the way that the data takes through mesh, solver and rows.
//!
//! | step | what happens |
//! |---|---|
//! | mesh | facets are divided into patches of shooting size; each vertex gets its share |
//! | light | every light source's row: direct irradiance at the vertices |
//! | shoot | shares shoot by falling unshot flux as their rows arrive |
//! | finish | sweeps over the rows solve for all interreflection |
//! | refine | patches are divided where interpolation is wrong; new vertices only receive |
//! | settle | shares take the mean radiosity of the refined mesh; sweeps again |
//! | measure | the answer is compared with light gathered at random points |
//! | look behind | light that falls on the backs of one-sided surfaces is reported |
//!
//! Where an error is asked for, refining, settling and measuring are repeated until it is met, or all of it with finer shooters or
//! more rays.
//!
//! Shooters stay coarse while receivers are refined (substructuring): a share far away sends nearly the same light whether it
//! is one polygon or sixteen, but a shadow line on the receiving side needs its vertices.

mod behind;
mod budget;
mod channels;
mod checks;
mod light;
mod measure;
pub(crate) mod occluders;
mod receivers;
mod refine;
mod report;
mod rows;
mod settings;
mod settle;
mod share_rows;
mod shoot;

use std::time::Instant;

use glam::DVec3;
use serde::Serialize;
use shared::replica::encode_scene;
use shared::row::{Row, Shape, Shooter};

pub use budget::ErrorBudget;
pub use report::{BakeReport, Model};
pub use rows::{BakeError, RowService};
pub use settings::BakeSettings;

use crate::lit::LitMesh;
use crate::mesh::{Mesh, Share, VertexId, triangulate};
use crate::scene::Scene;
use crate::solver::ShareEnergy;
use crate::solver::cache::SetId;
use crate::solver::fit::best_fit;
use channels::Channels;
use checks::Checks;
use light::LightSource;
use receivers::receivers;
use rows::RowOffice;
use share_rows::{COARSE, ShareRows};

/// What a bake is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Phase {
    /// Rows of the light sources.
    Light,
    /// Shooting.
    Shoot,
    /// Refining the mesh.
    Refine,
    /// Measuring the error.
    Measure,
    /// Last sweeps and triangles.
    Settle,
}

/// How far a bake has come.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// What it is doing.
    pub phase: Phase,
    /// Unshot flux over reflected flux.
    pub unshot: f64,
    /// Rows finished.
    pub rows: u64,
    /// Rows known to be needed, so far.
    pub rows_needed: u64,
    /// Rays cast.
    pub rays: u64,
    /// Vertices of the mesh.
    pub vertices: usize,
}

/// What a bake gives.
pub struct Baked {
    /// The lit mesh.
    pub lit: LitMesh,
    /// The figures.
    pub report: BakeReport,
}

/// Bakes a scene. Rows come from `service`; `progress` is told how far it is, often.
///
/// # Errors
/// When the rows cannot be had, or the scene gives no mesh.
pub fn bake(
    scene: &Scene,
    settings: &BakeSettings,
    service: &mut dyn RowService,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Baked, BakeError> {
    let blockers = occluders::occluders(scene);
    let mut office = RowOffice::new(service, progress, encode_scene(&blockers));
    let mut settings = settings.clone();
    let mut spent = Spent::default();
    loop {
        let mut bake = Bake::new(scene, &settings, &mut office, spent)?;
        bake.occluders = blockers.len();
        bake.light()?;
        bake.shoot()?;
        bake.meet_error()?;
        match bake.better_settings() {
            Some(better) => {
                spent = bake.give_up();
                settings = better;
            }
            None => {
                let lost_behind = bake.look_behind()?;
                return Ok(bake.finish(lost_behind));
            }
        }
    }
}

/// What earlier attempts took.
#[derive(Default)]
struct Spent {
    restarts: u32,
    shots: u64,
    sweeps: u32,
    rounds: u32,
    seconds: Vec<(&'static str, f64)>,
}

/// Measured interpolation error over the predicted one, to begin with: .6 to .75 in rooms of all sorts.
const FOUND_PER_PREDICTED: f64 = 0.68;

/// A bake under way.
struct Bake<'a, 'b> {
    scene: &'a Scene,
    settings: &'a BakeSettings,
    channels: Channels,
    office: &'a mut RowOffice<'b>,
    mesh: Mesh,
    /// Reflectance of each surface.
    reflectance: Vec<DVec3>,
    shares: Vec<Share>,
    energies: Vec<ShareEnergy>,
    sources: Vec<LightSource>,
    /// Rows of the shares over all vertices so far, and over the guides.
    rows: ShareRows,
    /// The vertices as receivers: those of the shooting mesh, then those of each round of refinement.
    vertex_sets: Vec<SetId>,
    /// Points between the vertices that guide the refinement.
    guides: Checks,
    /// The guides as receivers, where there are any.
    guide_set: Option<SetId>,
    /// Variance of the row of each light source over the guides, summed over it.
    guide_variances: Vec<f64>,
    /// Irradiance from the light sources, per vertex.
    direct: Vec<DVec3>,
    /// Whether each vertex sees any surface.
    exposed: Vec<bool>,
    /// Bytes of the rows over the shooting mesh.
    coarse_bytes: usize,
    /// Most bytes of rows that were ever kept.
    most_row_bytes: usize,
    /// Radiosity of each share.
    radiosity: Vec<DVec3>,
    /// Irradiance, per vertex.
    irradiance: Vec<DVec3>,
    occluders: usize,
    /// Flux that the shares get from point lights, in frame units.
    from_point_lights: DVec3,
    row_sums: Vec<f64>,
    unshot: DVec3,
    unshot_bound: f64,
    /// Flux by which shares differ from what they should have shot, relative to the reflected flux.
    residual: f64,
    spent: Spent,
    /// Interpolation error as it was measured, over the predicted one: the prediction knows nothing of the best fit and of
    /// how triangles follow the light.
    found_per_predicted: f64,
    /// Times that the error was measured.
    rounds_measured: u32,
    error: ErrorBudget,
    /// What ended the refinement before its error was met.
    mesh_obstacle: Option<&'static str>,
    clock: Instant,
}

impl<'a, 'b> Bake<'a, 'b> {
    fn new(
        scene: &'a Scene,
        settings: &'a BakeSettings,
        office: &'a mut RowOffice<'b>,
        spent: Spent,
    ) -> Result<Self, BakeError> {
        let clock = Instant::now();
        let mesh = shooting_mesh(scene, settings);
        if mesh.patches.is_empty() {
            return Err(BakeError::EmptyMesh);
        }
        let plane_of =
            |surface: u32, facet: u32| scene.surfaces[surface as usize].facets[facet as usize].plane;
        let shares = mesh.shares(plane_of);
        let reflectance: Vec<DVec3> = scene.surfaces.iter().map(|surface| surface.reflectance).collect();
        let energies = shares
            .iter()
            .map(|share| ShareEnergy {
                receiver: share.vertex.index(),
                area: share.area,
                reflectance: reflectance[share.surface as usize],
            })
            .collect();
        let shooter = |(key, share): (usize, &Share)| Shooter {
            key: key as u64,
            shape: Shape::Polygons(share.polygons.clone()),
        };
        let shooters: Vec<Shooter> = shares.iter().enumerate().map(shooter).collect();
        let sources = light::sources(scene, settings, shooters.len() as u64);
        office.set_precision(settings.precision());
        let mut rows = ShareRows::new(shooters, settings.row_cache.saturating_mul(1 << 20));
        let coarse = rows.add_set(office.publish_receivers(&receivers(&mesh, VertexId(0))));
        let guides = Checks::draw(&mesh, scene, settings, &[], 0);
        let count = shares.len();
        let mut bake = Self {
            scene,
            settings,
            channels: Channels::needed(scene),
            office,
            mesh,
            reflectance,
            energies,
            sources,
            rows,
            vertex_sets: vec![coarse],
            guides,
            guide_set: None,
            guide_variances: vec![],
            direct: vec![],
            exposed: vec![],
            coarse_bytes: 0,
            most_row_bytes: 0,
            radiosity: vec![DVec3::ZERO; count],
            irradiance: vec![],
            occluders: 0,
            from_point_lights: DVec3::ZERO,
            row_sums: vec![],
            unshot: DVec3::ZERO,
            unshot_bound: 0.0,
            residual: 0.0,
            spent,
            found_per_predicted: FOUND_PER_PREDICTED,
            rounds_measured: 0,
            error: ErrorBudget::default(),
            mesh_obstacle: None,
            clock,
            shares,
        };
        bake.end_step("mesh");
        Ok(bake)
    }

    fn end_step(&mut self, name: &'static str) {
        let seconds = self.clock.elapsed().as_secs_f64();
        match self.spent.seconds.iter_mut().find(|(step, _)| *step == name) {
            Some(step) => step.1 += seconds,
            None => self.spent.seconds.push((name, seconds)),
        }
        self.clock = Instant::now();
    }

    /// Ends an attempt without a result.
    fn give_up(self) -> Spent {
        self.rows.release(self.office);
        Spent { restarts: self.spent.restarts + 1, ..self.spent }
    }

    /// Direct irradiance at the vertices of the shooting mesh and at the guides.
    fn light(&mut self) -> Result<(), BakeError> {
        self.office.enter(Phase::Light, self.mesh.vertices.len());
        let energies = &self.energies;
        let mut from_point_lights = DVec3::ZERO;
        self.direct =
            light::irradiance(&self.sources, self.rows.set(COARSE), self.office, |source, row, _| {
                if !matches!(source.shooter.shape, Shape::Polygons(_)) {
                    let factors = row.to_dense();
                    let flux = energies.iter().map(|s| s.area * f64::from(factors[s.receiver])).sum::<f64>();
                    from_point_lights += source.strength * flux;
                }
            })?;
        self.from_point_lights = from_point_lights;
        if self.guides.count() > 0 {
            let set = self.office.publish_receivers(&self.guides.receivers(self.guides.count()));
            let variances = &mut self.guide_variances;
            let look = |_: &LightSource, _: &Row, variance| variances.push(variance);
            self.guides.set_direct(light::irradiance(&self.sources, set, self.office, look)?);
            self.guide_set = Some(self.rows.add_set(set));
        }
        self.end_step("light");
        Ok(())
    }

    fn finish(mut self, warnings: Vec<String>) -> Baked {
        self.irradiance = best_fit(&self.mesh, &self.irradiance);
        let radiosity = |vertex: VertexId| self.irradiance[vertex.index()];
        let triangles = triangulate(&self.mesh, self.scene.surfaces.len(), radiosity);
        let lit = receivers::lit_mesh(&self.mesh, &self.irradiance, triangles);
        self.end_step("export mesh");
        let mut report = self.report();
        report.warnings.extend(warnings);
        Baked { lit, report }
    }
}

/// The mesh of the shares. Where an error is asked for and its mesh would have too many vertices, the finest that has not.
fn shooting_mesh(scene: &Scene, settings: &BakeSettings) -> Mesh {
    let extent = extent(scene);
    let mut edge = settings.shooter_edge;
    loop {
        let mesh = Mesh::new(scene, extent, edge * extent, settings.max_level);
        let fits = mesh.vertices.len() <= settings.max_vertices;
        if fits || settings.error.is_none() || edge >= 1.0 {
            return mesh;
        }
        edge *= 2.0;
    }
}

/// Largest extent of the facets, in frame units.
fn extent(scene: &Scene) -> f64 {
    let corners =
        || scene.surfaces.iter().flat_map(|s| &s.facets).flat_map(|f| &f.corners).map(|c| c.position);
    (corners().fold(DVec3::MIN, DVec3::max) - corners().fold(DVec3::MAX, DVec3::min)).max_element()
}
