//! The solution for the radiosity of the shares.

use glam::DVec3;

use super::direct_light::{Lit, Sources};
use super::glow::{add, glow};
use super::irradiance::{Irradiance, Lights, Place, Received, irradiance_at};
use super::light::{self, LightSource};
use crate::context::Context;
use crate::error::Result;
use crate::mesh::{PatchId, VertexId};
use crate::observer::Phase;
use crate::refinement::{MeshError, best_fit};
use crate::rows::{COARSE, FIRST_TOLERANCE, Problem, RowSource, Rows, ShareMesh, ShareValues, Solution};
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
    /// Irradiance of the vertices from the light sources.
    pub direct: Vec<DVec3>,
    pub solution: Solution,
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
}

/// Flux that the shares stop of this direct light of the vertices.
fn stopped(source: &dyn RowSource, mesh: &ShareMesh, direct: &[DVec3]) -> DVec3 {
    let values = source.first_values(mesh, &vec![true; direct.len()]);
    let shares = mesh.energies.iter().zip(&mesh.materials);
    let light = values.of(&mesh.energies, direct);
    shares.zip(light).map(|((share, material), light)| share.area * material.opacity * light).sum()
}

impl Lit {
    /// Solves for the light on the shooting mesh, well enough to see where it must be refined.
    #[tracing::instrument(skip_all)]
    pub fn solve(self, cx: &mut Context) -> Result<Solved> {
        let Self { mesh, mut rows, mut sources, mut samples, mut middles, mut direct } = self;
        cx.client.monitor.enter(Phase::Shoot, mesh.mesh.vertices.len());
        let Rows { source, table } = &mut rows;
        let glow = glow(&mesh, &sources.all);
        let mut radiosity = source.shoot(cx, &mesh, table, &direct, glow.as_deref())?;
        if let Some(glow) = &glow {
            let sets: Vec<SetId> =
                [Some(COARSE), table.samples, table.middles].into_iter().flatten().collect();
            let gathered = source.gather(cx, &mesh, table, &sets, &[glow], false)?;
            let mut light = gathered.into_iter().flat_map(|gathered| gathered.light);
            add(&mut direct, &table.vertices.of_coarse(light.next().unwrap_or_default()));
            for (set, points) in [(table.samples, &mut samples), (table.middles, &mut middles)] {
                if set.is_some() {
                    points.add_direct(&light.next().unwrap_or_default());
                }
            }
        }
        sources.received = stopped(source.as_ref(), &mesh, &direct);
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
        let problem =
            Problem { mesh: &mesh, values: &values, direct: &direct, glow: glow.as_deref(), tolerance };
        let solution = Solution { radiosity, samples, middles, ..Solution::default() };
        let solution = problem.solve(cx, source.as_mut(), table, solution)?;
        cx.end_step("shoot");
        Ok(Solved {
            mesh,
            rows,
            sources,
            direct,
            solution,
            exposed,
            row_sums,
            takes_means: false,
            shooters_expected: [0.0; 2],
            found_per_predicted: FOUND_PER_PREDICTED,
            rounds_measured: 0,
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
        let Self { mesh, rows: Rows { source, table }, direct, solution, sources, .. } = self;
        let glow = glow(mesh, &sources.all);
        let tolerance = cx.settings.threshold;
        let problem = Problem { mesh, values: &means, direct, glow: glow.as_deref(), tolerance };
        let start = std::mem::take(solution);
        *solution = problem.solve(cx, source.as_mut(), table, start)?;
        self.preview(cx);
        cx.end_step("final solve");
        Ok(())
    }

    /// Whether the leaves of the refined mesh can become the shares, and enough were added for that to help.
    pub fn can_follow_mesh(&self) -> bool {
        let leaves = self.mesh.mesh.leaves().count();
        !self.rows.source.leaves_cost_rows() && leaves as f64 >= MORE_LEAVES * self.mesh.shares.len() as f64
    }

    /// Makes the leaves of the refined mesh the shares, and solves again.
    #[tracing::instrument(skip_all)]
    pub fn follow_mesh(&mut self, cx: &mut Context) -> Result<()> {
        self.rows.source.follow_mesh(cx, &mut self.mesh)?;
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
        let reflected: Vec<DVec3> =
            self.solution.irradiance.iter().zip(&self.direct).map(|(all, direct)| *all - *direct).collect();
        let expected = self.predict_for(cx, &reflected, found);
        let expected: Vec<f64> = expected.leaves().iter().map(|(_, square)| *square).collect();
        let before = self.glowing_light(cx)?;
        let is_added = self.rows.source.add_points(cx, &self.mesh.mesh, &expected)?;
        if is_added {
            let now = self.glowing_light(cx)?;
            self.add_direct(
                before.into_iter().map(|light| light.into_iter().map(|light| -light).collect()).collect(),
            );
            self.add_direct(now);
            self.look_at_cover(cx)?;
            self.final_solve(cx)?;
        }
        Ok(is_added)
    }

    /// Light of what glows, at the vertices set by set, and at refinement samples and middles; empty where nothing does.
    fn glowing_light(&mut self, cx: &mut Context) -> Result<Vec<Vec<DVec3>>> {
        let Some(glow) = glow(&self.mesh, &self.sources.all) else { return Ok(vec![]) };
        let Rows { source, table } = &mut self.rows;
        let sets: Vec<SetId> = table.vertices.sets().chain(table.samples).chain(table.middles).collect();
        let gathered = source.gather(cx, &self.mesh, table, &sets, &[&glow], false)?;
        Ok(gathered.into_iter().flat_map(|gathered| gathered.light).collect())
    }

    /// Adds direct light in the order of [`Self::glowing_light`].
    fn add_direct(&mut self, light: Vec<Vec<DVec3>>) {
        if light.is_empty() {
            return;
        }
        let table = &self.rows.table;
        let mut light = light.into_iter();
        let by_set: Vec<Vec<DVec3>> = light.by_ref().take(table.vertices.sets().count()).collect();
        add(&mut self.direct, &table.vertices.join(by_set));
        let Solution { samples, middles, .. } = &mut self.solution;
        for (set, points) in [(table.samples, samples), (table.middles, middles)] {
            if set.is_some() {
                points.add_direct(&light.next().unwrap_or_default());
            }
        }
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
        let lights = Lights { sources: &self.sources.all, radiosity: &self.solution.radiosity };
        let Received { light, cover } =
            irradiance_at(cx, &self.mesh, &mut self.rows, Place::Kept(set), &[lights])?;
        let bounds = &mut self.rows.table.bounds;
        bounds.add(&cover.sums);
        self.exposed.extend(cover.exposed);
        for Irradiance { mut direct, mut all } in light {
            bounds.apply(self.direct.len(), &mut direct);
            bounds.apply(self.direct.len(), &mut all);
            self.direct.extend(direct);
            self.solution.irradiance.extend(all);
        }
        Ok(())
    }

    /// The error of interpolation as vertices and refinement samples tell it.
    pub fn predict(&self, cx: &Context) -> MeshError {
        let (mesh, irradiance) = (&self.mesh.mesh, &self.solution.irradiance);
        let mut found = self.solution.samples.compare(mesh, &best_fit(mesh, irradiance));
        // A leaf whose corners are all in the dark, or all in the light, may be otherwise between them.
        found.extend(self.solution.middles.compare_direct(mesh, &self.direct));
        self.predict_for(cx, irradiance, &found)
    }

    /// The same for this irradiance of the vertices and these errors of the radiosity.
    fn predict_for(&self, cx: &Context, irradiance: &[DVec3], found: &[(PatchId, DVec3)]) -> MeshError {
        let reflectance: Vec<DVec3> = cx.scene.surfaces.iter().map(|surface| surface.reflectance).collect();
        MeshError::predict(&self.mesh.mesh, irradiance, &reflectance, found)
    }

    /// Relative standard error of irradiance at a point, from the rays that sampled visibility.
    pub fn noise(&self) -> f64 {
        let sources = self.sources.all.iter().map(|source| source.strength);
        self.noise_of(&self.solution, sources)
    }

    /// The same of another solution, for light sources of these strengths.
    pub fn noise_of(&self, solution: &Solution, strengths: impl Iterator<Item = DVec3>) -> f64 {
        let Some(set) = self.rows.table.samples else { return 0.0 };
        let sources = strengths.zip(self.sources.variances.iter().copied());
        let shares = solution.radiosity.iter().copied().zip(self.rows.table.variances(set));
        let samples = &solution.samples;
        samples.noise(shares.chain(sources), samples.count()).hypot(solution.ray_noise)
    }

    /// Irradiance of all vertices straight from these sources.
    pub fn direct_of(&mut self, cx: &mut Context, sources: &[LightSource]) -> Result<Vec<DVec3>> {
        let Rows { source, table } = &mut self.rows;
        let mut by_set = vec![];
        for set in table.vertices.sets() {
            by_set.push(light::irradiance(sources, table.set(set), cx.client)?);
        }
        if let Some(glow) = glow(&self.mesh, sources) {
            let sets: Vec<SetId> = table.vertices.sets().collect();
            let gathered = source.gather(cx, &self.mesh, table, &sets, &[&glow], false)?;
            let light = gathered.into_iter().flat_map(|gathered| gathered.light);
            by_set.iter_mut().zip(light).for_each(|(direct, light)| add(direct, &light));
        }
        let mut direct = table.vertices.join(by_set);
        table.bounds.apply(0, &mut direct);
        Ok(direct)
    }

    /// A solution to start from for these sources alone.
    pub fn dark(&mut self, cx: &mut Context, sources: &[LightSource]) -> Result<Solution> {
        let mut solution = Solution {
            radiosity: vec![DVec3::ZERO; self.mesh.shares.len()],
            irradiance: vec![],
            ..self.solution.clone()
        };
        if let Some(id) = self.rows.table.middles {
            let set = self.rows.table.set(id);
            solution.middles.set_direct(light::irradiance(sources, set, cx.client)?);
            if let Some(glow) = glow(&self.mesh, sources) {
                let Rows { source, table } = &mut self.rows;
                let gathered = source.gather(cx, &self.mesh, table, &[id], &[&glow], false)?;
                gathered
                    .iter()
                    .flat_map(|gathered| &gathered.light)
                    .for_each(|light| solution.middles.add_direct(light));
            }
        }
        Ok(solution)
    }

    /// Reflected flux over incident flux.
    pub fn mean_reflectance(&self) -> f64 {
        self.mesh.mean_reflectance(&self.solution.radiosity)
    }
}
