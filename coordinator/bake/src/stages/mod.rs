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
//! | groups | the light of each group of sources is solved for by itself; that of each source, where it is to be kept |
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
mod emitters;
mod layers;
mod light;
mod measure;
mod observer;
pub mod occluders;
mod pieces;
mod present;
mod receiver_rows;
mod receivers;
mod refine;
mod reflection;
mod relight;
mod report;
mod rows;
mod settings;
mod settle;
mod share_rows;
mod shoot;
mod sky;

use std::time::Instant;

use glam::DVec3;
use kernel::replica::{Receivers, encode_translucent_scene};
use kernel::row::{Row, Shape, Shooter};

pub use budget::ErrorBudget;
pub use layers::listed;
pub use layers::{LightGroup, LightPart, check_groups};
pub use observer::{Observer, Phase, Progress, Unobserved};
pub use relight::{KeptLight, LightChange, NewLight, RelightError, RelightReport, Relit, relight};
pub use report::{BakeReport, Model};
pub use rows::{BakeError, RowService};
pub use settings::{BakeSettings, RowStrategy};

use crate::lit::{LitLayer, LitMesh};
use crate::mesh::{Mesh, Share, VertexId};
use crate::solver::ShareEnergy;
use crate::solver::cache::SetId;
use channels::Channels;
use checks::Checks;
use light::{LightSource, Origin};
use receivers::receivers;
use reflection::{MeanLook, PatchLooks};
use rows::RowOffice;
use scene::Scene;
use share_rows::{COARSE, ShareRows};

/// What a bake gives.
pub struct Baked {
    /// The lit mesh.
    pub lit: LitMesh,
    /// The figures.
    pub report: BakeReport,
    /// What it leaves behind so that the scene can be lit otherwise, if it was asked to.
    pub kept: Option<KeptLight>,
}

/// Bakes a scene. Rows come from `service`, and `observer` is told how far it is, often.
///
/// However it ends, the service is left with nothing to do and nothing to hold for it.
///
/// # Errors
/// When the rows cannot be had, the scene gives no mesh, or the observer ends it.
#[tracing::instrument(skip_all)]
pub fn bake(
    scene: &Scene,
    settings: &BakeSettings,
    service: &mut dyn RowService,
    observer: &mut dyn Observer,
) -> Result<Baked, BakeError> {
    check_groups(scene, &settings.groups)?;
    let blockers = occluders::occluders(scene);
    let mut office =
        RowOffice::new(service, observer, encode_translucent_scene(&blockers.polygons, &blockers.opacities));
    let mut settings = settings.clone();
    let mut spent = Spent::default();
    loop {
        let mut bake = Bake::new(scene, &settings, &mut office, spent)?;
        bake.occluders = blockers.polygons.len();
        bake.light()?;
        bake.show();
        bake.shoot()?;
        bake.meet_error()?;
        match bake.better_settings() {
            Some(better) => {
                spent = bake.give_up();
                settings = better;
            }
            None => {
                let lost_behind = bake.look_behind()?;
                let layers = bake.layers()?;
                let kept = bake.keep_light()?;
                return Ok(Baked { kept, ..bake.finish(lost_behind, layers) });
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

/// Keys of the guides' twins, above those of the guides.
const TWIN_KEYS: u64 = 1 << 34;

/// Measured interpolation error over the predicted one, to begin with: .6 to .75 in rooms of all sorts.
const FOUND_PER_PREDICTED: f64 = 0.68;

/// A bake under way.
struct Bake<'a, 'b> {
    scene: &'a Scene,
    settings: &'a BakeSettings,
    channels: Channels,
    office: &'a mut RowOffice<'b>,
    mesh: Mesh,
    /// Mean reflectance of each surface.
    reflectance: Vec<DVec3>,
    shares: Vec<Share>,
    /// What each share reflects, emits and takes.
    looks: Vec<MeanLook>,
    /// The same of patches.
    patch_looks: PatchLooks,
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
    /// The guides once more, with other rays, where rows are those of receivers.
    guide_twins: Option<SetId>,
    /// Relative standard error of the irradiance at a point from the rays of its hemisphere.
    ray_noise: f64,
    /// Whether rows are those of receivers.
    is_gathered: bool,
    /// Whether the shares take means over the refined mesh by now, rather than the values at their vertices.
    takes_means: bool,
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
    /// Flux that the shares get from lights within the scene that are no surfaces, in frame units.
    from_lights: DVec3,
    /// Flux that the shares get from outside of the scene, from directional lights and the sky, in frame units.
    from_outside: DVec3,
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
    /// Where it was measured, with the light there.
    checks: Checks,
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
        office.check()?;
        office.set_error(None);
        let mesh = shooting_mesh(scene, settings);
        if mesh.patches.is_empty() {
            return Err(BakeError::EmptyMesh);
        }
        let plane_of =
            |surface: u32, facet: u32| scene.surfaces[surface as usize].facets[facet as usize].plane;
        let is_gathered = receiver_rows::suit(scene, settings);
        let shares = if is_gathered { mesh.leaf_shares(plane_of) } else { mesh.shares(plane_of) };
        let reflectance: Vec<DVec3> = scene.surfaces.iter().map(|surface| surface.reflectance).collect();
        let looks = reflection::of_shares(scene, &mesh, &shares);
        let energies = shares
            .iter()
            .zip(&looks)
            .map(|(share, look)| ShareEnergy {
                receiver: share.vertex.index(),
                area: share.area,
                reflectance: look.reflectance,
            })
            .collect();
        let shooter = |(key, share): (usize, &Share)| Shooter {
            key: key as u64,
            shape: Shape::Polygons(share.polygons.clone()),
        };
        let shooters: Vec<Shooter> = shares.iter().enumerate().map(shooter).collect();
        let sources = light::sources(scene, &mesh, settings, shooters.len() as u64, is_gathered);
        office.set_precision(settings.precision());
        let mut rows = if is_gathered {
            let seen = receiver_rows::seen(scene, &mesh, mesh.leaves().map(|(id, _)| id));
            ShareRows::seen_as(office.publish_polygons(&seen.polygons, &seen.opacities), shooters)
        } else {
            ShareRows::new(shooters, settings.row_cache.saturating_mul(1 << 20))
        };
        let rays = receiver_rows::rays(&mesh, VertexId(0), settings, extent(scene));
        let coarse = rows.add_receivers(office, &receivers(&mesh, VertexId(0)), rays)?;
        let guides = Checks::draw(&mesh, scene, settings, &[], 0);
        let count = shares.len();
        let mut bake = Self {
            scene,
            settings,
            channels: Channels::needed(scene),
            office,
            mesh,
            reflectance,
            looks,
            patch_looks: PatchLooks::default(),
            energies,
            sources,
            rows,
            vertex_sets: vec![coarse],
            guides,
            guide_set: None,
            guide_twins: None,
            ray_noise: 0.0,
            is_gathered,
            takes_means: false,
            guide_variances: vec![],
            direct: vec![],
            exposed: vec![],
            coarse_bytes: 0,
            most_row_bytes: 0,
            radiosity: vec![DVec3::ZERO; count],
            irradiance: vec![],
            occluders: 0,
            from_lights: DVec3::ZERO,
            from_outside: DVec3::ZERO,
            row_sums: vec![],
            unshot: DVec3::ZERO,
            unshot_bound: 0.0,
            residual: 0.0,
            spent,
            found_per_predicted: FOUND_PER_PREDICTED,
            rounds_measured: 0,
            error: ErrorBudget::default(),
            checks: Checks::default(),
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
    #[tracing::instrument(skip_all)]
    fn light(&mut self) -> Result<(), BakeError> {
        self.office.enter(Phase::Light, self.mesh.vertices.len());
        let energies = &self.energies;
        let (mut from_lights, mut from_outside) = (DVec3::ZERO, DVec3::ZERO);
        self.direct =
            light::irradiance(&self.sources, self.rows.set(COARSE), self.office, |source, row, _| {
                if matches!(source.origin, Origin::Surface(_)) {
                    return;
                }
                let factors = row.to_dense();
                let flux = energies.iter().map(|s| s.area * f64::from(factors[s.receiver])).sum::<f64>();
                *if source.is_outside { &mut from_outside } else { &mut from_lights } +=
                    source.strength * flux;
            })?;
        (self.from_lights, self.from_outside) = (from_lights, from_outside);
        if self.guides.count() > 0 {
            let receivers = self.guides.receivers(self.guides.count());
            let rays = |_| self.settings.rays_per_hemisphere;
            let id = self.rows.add_receivers(self.office, &receivers, rays)?;
            let set = self.rows.set(id);
            self.guide_set = Some(id);
            if self.is_gathered {
                let twins = Receivers { first_key: receivers.first_key + TWIN_KEYS, ..receivers };
                self.guide_twins = Some(self.rows.add_receivers(self.office, &twins, rays)?);
            }
            let variances = &mut self.guide_variances;
            let look = |_: &LightSource, _: &Row, variance| variances.push(variance);
            self.guides.set_direct(light::irradiance(&self.sources, set, self.office, look)?);
        }
        self.end_step("light");
        Ok(())
    }

    fn finish(mut self, warnings: Vec<String>, layers: Vec<LitLayer>) -> Baked {
        let (lit, fitted) = self.lit(&self.irradiance, &self.direct);
        let lit = LitMesh { layers, ..lit };
        self.irradiance = fitted;
        self.end_step("export mesh");
        let mut report = self.report();
        report.warnings.extend(warnings);
        Baked { lit, report, kept: None }
    }
}

/// The mesh of the shares. Where an error is asked for and its mesh would have too many vertices, the finest that has not.
fn shooting_mesh(scene: &Scene, settings: &BakeSettings) -> Mesh {
    let extent = extent(scene);
    let mut edge = settings.shooter_edge * receiver_rows::edge_factor(scene, settings);
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
