//! The solution for the radiosity of the shares.

use glam::DVec3;

use super::direct_light::{Lit, Sources};
use super::glow::{add, glow, light_at};
use super::irradiance::{Irradiance, Lights, Place, Received, irradiance_at};
use super::light::{self, Direct};
use super::light_source::LightSource;
use crate::context::Context;
use crate::error::Result;
use crate::mesh::{PatchId, VertexId};
use crate::observer::Phase;
use crate::refinement::{MeshError, RevealedErrors, SamplePoints, best_fit};
use crate::rows::{COARSE, FIRST_TOLERANCE, Problem, Rows, ShareMesh, ShareValues, Solution, leaving};
use crate::solver::cache::SetId;

/// Measured interpolation error over the predicted one, to begin with: .6 to .75 in rooms of all sorts.
const FOUND_PER_PREDICTED: f64 = 0.68;

/// Leaves over shares from which on it helps to make the leaves the shares.
const MORE_LEAVES: f64 = 1.1;

/// A bake with a solution.
pub struct Solved {
    pub mesh: ShareMesh,
    pub rows: Rows,
    pub sources: Sources,
    /// Irradiance of the vertices from the light sources,
    pub direct: Vec<DVec3>,
    /// from those within the scene that are no surfaces, where no row is bounded,
    pub from_lights: Vec<DVec3>,
    /// and from outside of the scene.
    pub from_outside: Vec<DVec3>,
    pub solution: Solution,
    /// What dividing the mesh revealed of its irradiance.
    pub revealed: RevealedErrors,
    /// Whether each vertex sees any surface.
    pub exposed: Vec<bool>,
    /// How much of its hemisphere each share sees covered.
    pub row_sums: Vec<f64>,
    /// Whether shares take means over the refined mesh.
    takes_means: bool,
    /// What the error of the shooters is expected to be, and at least, since the leaves became the shares: these show no error of
    /// their own.
    pub shooters_expected: [f64; 2],
    /// Measured interpolation error over the predicted one: the prediction knows nothing of the best fit and of
    /// how triangles follow the light.
    pub found_per_predicted: f64,
    /// Times that the error was measured.
    pub rounds_measured: u32,
    /// Where it was measured, with the light that vertices would have there: refinement samples from then on.
    pub measured: Vec<SamplePoints>,
}

/// Relative standard errors of irradiance at a point.
#[derive(Debug, Clone, Copy, Default)]
pub struct Noises {
    /// From rays between a receiver and a light source or a share.
    pub of_rows: f64,
    /// From rays that go anywhere in a hemisphere.
    pub of_hemispheres: f64,
}

impl Noises {
    /// Of both.
    pub fn total(self) -> f64 {
        self.of_rows.hypot(self.of_hemispheres)
    }
}

/// Adds direct light to refinement samples and middles, where rows are over them.
fn add_to_points(
    light: impl Iterator<Item = Vec<DVec3>>,
    sets: [Option<SetId>; 2],
    samples: &mut SamplePoints,
    middles: &mut SamplePoints,
) {
    let points = sets.into_iter().zip([samples, middles]);
    let there = points.filter_map(|(set, points)| set.map(|_| points));
    there.zip(light).for_each(|(points, light)| points.add_direct(&light));
}

impl Lit {
    /// Solves for the light on the shooting mesh, well enough to see where it must be refined.
    #[tracing::instrument(skip_all)]
    pub fn solve(self, cx: &mut Context) -> Result<Solved> {
        let Self { mut mesh, mut rows, sources, mut samples, mut middles, direct } = self;
        mesh.patch_materials.update(cx.scene, &mesh.mesh);
        cx.client.monitor.enter(Phase::Shoot, mesh.mesh.vertices.len());
        let Direct { all: mut direct, from_lights, from_outside, .. } = direct;
        let mut radiosity = {
            let Rows { source, table } = &mut rows;
            let glow = glow(&mesh, &sources.all);
            source.shoot(cx, &mesh, table, &direct, glow.as_deref())?
        };
        let sets: Vec<SetId> =
            [Some(COARSE), rows.table.samples, rows.table.middles].into_iter().flatten().collect();
        let mut glowing = light_at(cx, &mesh, &mut rows, &sources.all, &sets)?.into_iter();
        let Rows { source, table } = &mut rows;
        if let Some(light) = glowing.next() {
            add(&mut direct, &table.vertices.of_coarse(light));
            add_to_points(glowing, [table.samples, table.middles], &mut samples, &mut middles);
        }
        // A first look at all rows, those too that no shot needed.
        let seen = source.gather(cx, &mesh, table, &[COARSE], &[], true)?.pop().unwrap_or_default();
        table.coarse_bytes = seen.cover.bytes;
        let (sums, exposed) =
            (table.vertices.of_coarse(seen.cover.sums), table.vertices.of_coarse(seen.cover.exposed));
        table.bounds.add(&sums);
        table.bounds.apply(0, &mut direct);
        if table.bounds.count() > 0 {
            // Shots were not bounded, and may have run away.
            radiosity.fill(DVec3::ZERO);
        }
        if let Some(set) = table.middles {
            let seen = source.gather(cx, &mesh, table, &[set], &[], true)?.pop().unwrap_or_default();
            middles.set_exposed(&seen.cover.sums);
        }
        let row_sums = source.row_sums(&mesh, &sums);
        let values = source.first_values(&mesh, &exposed);
        let tolerance = cx.settings.threshold.max(FIRST_TOLERANCE);
        let problem = Problem { mesh: &mesh, values: &values, exposed: &exposed, direct: &direct, tolerance };
        let solution = Solution { radiosity, samples, middles, ..Solution::default() };
        let solution = problem.solve(cx, source.as_mut(), table, solution)?;
        cx.end_step("shoot");
        let revealed = RevealedErrors::new(&mesh.mesh, &solution.irradiance);
        Ok(Solved {
            mesh,
            rows,
            sources,
            direct,
            from_lights,
            from_outside,
            solution,
            revealed,
            exposed,
            row_sums,
            takes_means: false,
            shooters_expected: [0.0; 2],
            found_per_predicted: FOUND_PER_PREDICTED,
            rounds_measured: 0,
            measured: vec![],
        })
    }
}

impl Solved {
    /// Means of the shares over the mesh.
    pub fn means(&self) -> ShareValues {
        ShareValues::means(&self.mesh, &self.exposed)
    }

    /// Solves again with the means of the refined mesh. No rows are needed but those that there are, or were.
    #[tracing::instrument(skip_all)]
    pub fn final_solve(&mut self, cx: &mut Context) -> Result<()> {
        cx.client.monitor.enter(Phase::FinalSolve, self.mesh.mesh.vertices.len());
        self.takes_means = true;
        let means = self.means();
        self.mesh.patch_materials.update(cx.scene, &self.mesh.mesh);
        let Self { mesh, rows: Rows { source, table }, direct, solution, exposed, .. } = self;
        let tolerance = cx.settings.threshold;
        let problem = Problem { mesh, values: &means, exposed, direct, tolerance };
        let start = std::mem::take(solution);
        *solution = problem.solve(cx, source.as_mut(), table, start)?;
        self.revealed = RevealedErrors::new(&self.mesh.mesh, &self.solution.irradiance);
        self.preview(cx);
        cx.end_step("final solve");
        Ok(())
    }

    /// Whether the leaves of the refined mesh can become the shares, and enough were added for that to help.
    pub fn can_follow_mesh(&self) -> bool {
        !self.rows.source.leaves_cost_rows() && self.leaves_per_share() >= MORE_LEAVES
    }

    /// Leaves of the refined mesh over shares.
    pub fn leaves_per_share(&self) -> f64 {
        self.mesh.mesh.leaves().count() as f64 / self.mesh.shares.len() as f64
    }

    /// Makes the leaves of the refined mesh the shares, and solves again.
    #[tracing::instrument(skip_all)]
    pub fn follow_mesh(&mut self, cx: &mut Context) -> Result<()> {
        // Light is another from here on.
        self.measured.clear();
        let before = self.glowing_light(cx)?;
        self.rows.source.follow_mesh(cx, &mut self.mesh)?;
        self.exchange_glow(cx, before)?;
        self.look_at_cover(cx)?;
        let incident = self.means().of(&self.mesh.energies, &self.solution.irradiance);
        self.solution.radiosity = self.mesh.reflected(&incident);
        self.final_solve(cx)
    }

    /// Finds anew how much of its hemisphere each share sees covered.
    fn look_at_cover(&mut self, cx: &mut Context) -> Result<()> {
        let Self { mesh, rows: Rows { source, table }, .. } = self;
        let sets: Vec<SetId> = table.vertices.sets().collect();
        let seen = source.gather(cx, mesh, table, &sets, &[], true)?;
        let sums = table.vertices.join(seen.into_iter().map(|gathered| gathered.cover.sums));
        self.row_sums = source.row_sums(mesh, &sums);
        Ok(())
    }

    /// Adds gather points where light between them was found wrong, or changes, and solves again. False where there may be no more.
    pub fn add_gather_points(&mut self, cx: &mut Context, found: &[(PatchId, DVec3)]) -> Result<bool> {
        let before = self.glowing_light(cx)?;
        let mut gathered: Vec<DVec3> =
            self.solution.irradiance.iter().zip(&self.direct).map(|(all, direct)| *all - *direct).collect();
        if !before.is_empty() {
            add(&mut gathered, &self.rows.table.vertices.join(before.iter().cloned()));
        }
        let revealed = RevealedErrors::new(&self.mesh.mesh, &gathered);
        let expected = self.predict_for(cx, (&gathered, &revealed), found);
        let expected: Vec<f64> = expected.parts().iter().map(|(_, part)| *part).collect();
        let is_added = self.rows.source.add_points(cx, &self.mesh.mesh, &expected)?;
        if is_added {
            self.measured.clear();
            self.exchange_glow(cx, before)?;
            self.look_at_cover(cx)?;
            self.final_solve(cx)?;
        }
        Ok(is_added)
    }

    /// Light of what glows, at the vertices set by set, and at refinement samples and middles; nothing where nothing glows.
    fn glowing_light(&mut self, cx: &mut Context) -> Result<Vec<Vec<DVec3>>> {
        let table = &self.rows.table;
        let sets: Vec<SetId> = table.vertices.sets().chain(table.samples).chain(table.middles).collect();
        light_at(cx, &self.mesh, &mut self.rows, &self.sources.all, &sets)
    }

    /// Takes this light of what glows from the direct light, and adds that of now: it changes with the gather points and the shares.
    fn exchange_glow(&mut self, cx: &mut Context, before: Vec<Vec<DVec3>>) -> Result<()> {
        if before.is_empty() {
            return Ok(());
        }
        let mut change = self.glowing_light(cx)?;
        let pairs = change.iter_mut().flatten().zip(before.iter().flatten());
        pairs.for_each(|(now, before)| *now -= *before);
        let table = &self.rows.table;
        let points = change.split_off(table.vertices.sets().count());
        add(&mut self.direct, &table.vertices.join(change));
        let Solution { samples, middles, .. } = &mut self.solution;
        add_to_points(points.into_iter(), [table.samples, table.middles], samples, middles);
        Ok(())
    }

    /// Hands a preview to the observer, if it wants one.
    pub fn preview(&self, cx: &mut Context) {
        self.mesh.preview(cx, &self.direct, || {
            let values = if self.takes_means {
                self.means()
            } else {
                self.rows.source.first_values(&self.mesh, &self.exposed)
            };
            let Solution { irradiance, radiosity, .. } = &self.solution;
            let incident = values.of(&self.mesh.energies, irradiance);
            (irradiance.clone(), self.mesh.unshot(&incident, radiosity))
        });
    }

    /// Adds the vertices from `first` on, and computes their irradiance.
    pub fn receive(&mut self, cx: &mut Context, first: VertexId) -> Result<()> {
        cx.client.monitor.enter(Phase::Refine, self.mesh.mesh.vertices.len());
        let set = self.rows.add_vertices(cx, &self.mesh.mesh, first)?;
        let lights = Lights { sources: &self.sources.all, radiosity: self.solution.radiosity() };
        let Received { light, cover } =
            irradiance_at(cx, &self.mesh, &mut self.rows, Place::Kept(set), &[lights])?;
        let bounds = &mut self.rows.table.bounds;
        bounds.add(&cover.sums);
        self.exposed.extend(cover.exposed);
        for Irradiance { mut direct, mut all, .. } in light {
            bounds.apply(self.direct.len(), &mut direct.all);
            bounds.apply(self.direct.len(), &mut all);
            self.direct.extend(direct.all);
            self.from_lights.extend(direct.from_lights);
            self.from_outside.extend(direct.from_outside);
            self.solution.irradiance.extend(all);
        }
        self.revealed.follow(&self.mesh.mesh, &self.solution.irradiance);
        Ok(())
    }

    /// The irradiance of the vertices that fits best between them.
    pub fn fitted(&self) -> Vec<DVec3> {
        best_fit(&self.mesh.mesh, &self.solution.irradiance, &self.revealed)
    }

    /// The error of interpolation as vertices, [`fitted`](Self::fitted), and refinement samples tell it.
    pub fn predict(&self, cx: &Context, fitted: &[DVec3]) -> MeshError {
        let mesh = &self.mesh.mesh;
        let mut found = self.solution.samples.compare(mesh, fitted);
        // The next measurement has points of its own.
        found.extend(self.measured.iter().flat_map(|points| points.compare(mesh, fitted)));
        // A leaf whose corners are all in the dark, or all in the light, may be otherwise between them.
        found.extend(self.solution.middles.compare_direct(mesh, &self.direct));
        self.predict_for(cx, (&self.solution.irradiance, &self.revealed), &found)
    }

    /// The same for this irradiance of the vertices, with what was revealed of it, and these errors of the radiosity.
    fn predict_for(
        &self,
        cx: &Context,
        (irradiance, revealed): (&[DVec3], &RevealedErrors),
        found: &[(PatchId, DVec3)],
    ) -> MeshError {
        // Where there are middles, they tell of leaves that were never divided.
        let unknown = if self.rows.source.leaves_cost_rows() { cx.shortest_edge() } else { f64::INFINITY };
        let reflectance: Vec<DVec3> = cx.scene.surfaces.iter().map(|surface| surface.reflectance).collect();
        MeshError::predict(&self.mesh.mesh, irradiance, &reflectance, revealed, found, unknown)
    }

    /// Relative standard error of irradiance at a point, from the rays that sampled visibility.
    pub fn noise(&self) -> f64 {
        self.noises().total()
    }

    /// The same by what the rays are for.
    pub fn noises(&self) -> Noises {
        let strengths = self.sources.all.iter().map(|source| source.strength);
        self.noise_of(&self.solution, &self.sources.all, strengths)
    }

    /// The same of another solution, for some light sources, and these strengths of all.
    pub fn noise_of(
        &self,
        solution: &Solution,
        sources: &[LightSource],
        strengths: impl Iterator<Item = DVec3>,
    ) -> Noises {
        let Rows { source, table } = &self.rows;
        let Some(set) = table.samples else { return Noises::default() };
        let Solution { samples, radiosity, .. } = solution;
        let lights = strengths.zip(self.sources.variances.iter().copied());
        let shares = radiosity.iter().copied().zip(table.variances(set));
        let glow = glow(&self.mesh, sources);
        Noises {
            of_rows: samples.noise(shares.chain(lights), samples.count()),
            of_hemispheres: source.ray_noise(&leaving(radiosity, glow.as_deref()), samples.level()),
        }
    }

    /// Irradiance of all vertices straight from these sources.
    pub fn direct_of(&mut self, cx: &mut Context, sources: &[LightSource]) -> Result<Vec<DVec3>> {
        let sets: Vec<SetId> = self.rows.table.vertices.sets().collect();
        let mut by_set = vec![];
        for set in &sets {
            by_set.push(light::direct(sources, self.rows.table.set(*set), cx.client)?.all);
        }
        let glowing = light_at(cx, &self.mesh, &mut self.rows, sources, &sets)?;
        by_set.iter_mut().zip(&glowing).for_each(|(direct, light)| add(direct, light));
        let table = &self.rows.table;
        let mut direct = table.vertices.join(by_set);
        table.bounds.apply(0, &mut direct);
        Ok(direct)
    }

    /// A solution to start from for these sources alone.
    pub fn dark(&mut self, cx: &mut Context, sources: &[LightSource]) -> Result<Solution> {
        let mut solution = Solution {
            radiosity: vec![DVec3::ZERO; self.mesh.shares.len()],
            irradiance: vec![],
            local: None,
            ..self.solution.clone()
        };
        if let Some(id) = self.rows.table.middles {
            let set = self.rows.table.set(id);
            solution.middles.set_direct(light::direct(sources, set, cx.client)?.all);
            let glowing = light_at(cx, &self.mesh, &mut self.rows, sources, &[id])?;
            glowing.iter().for_each(|light| solution.middles.add_direct(light));
        }
        Ok(solution)
    }

    /// Reflected flux over incident flux.
    pub fn mean_reflectance(&self) -> f64 {
        self.mesh.mean_reflectance(&self.solution.radiosity)
    }
}
