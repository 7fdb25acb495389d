//! Solving for the light of each source separately.

use std::collections::HashMap;

use glam::DVec3;

use super::digest_of;
use super::kept::{KeptLight, KeptPart, MeshSettings};
use crate::channels::Channels;
use crate::context::Context;
use crate::error::Result;
use crate::mesh::PatchId;
use crate::observer::Phase;
use crate::refinement::SamplePoints;
use crate::rows::{LocalRadiosity, Problem, Radiosity, Rows, ShareValues, Solution, VertexLight};
use crate::settings::RowStrategy;
use crate::solver::cache::ColumnCache;
use crate::stages::{
    LightSource, Lights, Measured, Origin, PART_TOLERANCE, Place, Solved, irradiance_at, names_of,
};
use scene::Scene;

/// Most bytes of irradiances gathered at the same time.
const MOST_GATHERED: usize = 1 << 30;

/// Bytes for each vertex while the light of a part is gathered: irradiances, and radiosity within shares.
const BYTES_GATHERED: usize = 400;

/// Bytes kept for each light and each vertex or sample point. Vertices: total and direct irradiance as f32; samples: total
/// irradiance as f64.
const BYTES: u64 = 24;

/// The solution for a part, until its light is gathered at vertices and sample points.
struct SolvedPart {
    sources: Vec<LightSource>,
    radiosity: Vec<DVec3>,
    local: Option<LocalRadiosity>,
    part: KeptPart,
    unit: Unit,
}

impl SolvedPart {
    /// Radiosity of the shares, and within them.
    fn radiosity(&self) -> Radiosity<'_> {
        Radiosity { shares: &self.radiosity, local: self.local.as_ref() }
    }
}

/// The unit in which light is kept.
#[derive(Debug, Clone, Copy)]
enum Unit {
    /// As it is.
    AsItIs,
    /// Divided by this, and white: of a light with one channel, this colour.
    White(DVec3),
}

impl Unit {
    fn of(self, light: DVec3) -> DVec3 {
        match self {
            Self::AsItIs => light,
            Self::White(colour) => DVec3::splat(light.element_sum() / colour.element_sum()),
        }
    }

    /// Light that is kept, as it is.
    fn light(self, kept: DVec3) -> DVec3 {
        match self {
            Self::AsItIs => kept,
            Self::White(colour) => colour * kept,
        }
    }
}

/// Solves for the light of each source separately. `None` where that is not wanted, or would take too many bytes.
#[tracing::instrument(skip_all)]
pub fn keep_light(cx: &mut Context, measured: &mut Measured) -> Result<Option<KeptLight>> {
    let Some(most_bytes) = cx.settings.keep_light else { return Ok(None) };
    let Measured { solved, validation, error, .. } = measured;
    let groups = solved.sources_by_names(cx.scene);
    let places = solved.mesh.mesh.vertices.len() + validation.count();
    if (groups.len() as u64).saturating_mul(places as u64 * BYTES) > most_bytes {
        return Ok(None);
    }
    cx.client.monitor.enter(Phase::Groups, solved.mesh.mesh.vertices.len());
    // The report counts the sweeps of the whole.
    let sweeps = cx.work.sweeps;
    let is_alone = groups.len() == 1;
    let means = solved.means();
    let mut columns = None;
    let mut parts = vec![];
    for group in groups {
        parts.push(solved.part(cx, group, is_alone, &means, &mut columns)?);
    }
    cx.work.sweeps = sweeps;
    let is_dark = |solved: &SolvedPart| solved.part.irradiance.is_empty();
    let together = if parts.iter().any(is_dark) {
        // What is gathered of a part takes more than what is kept of it.
        MOST_GATHERED / (solved.mesh.mesh.vertices.len() * BYTES_GATHERED).max(1)
    } else {
        parts.len()
    };
    for some in parts.chunks_mut(together.max(1)) {
        if some.iter().any(is_dark) {
            solved.gather_at_vertices(cx, some)?;
        }
        solved.gather_at_samples(cx, validation, some)?;
        some.iter_mut().for_each(|solved| solved.local = None);
    }
    let mesh = &solved.mesh.mesh;
    let mut divided: Vec<(PatchId, PatchId)> = vec![];
    for (index, patch) in mesh.patches.iter().enumerate() {
        divided.extend(patch.first_child.map(|first| (first, PatchId(index as u32))));
    }
    divided.sort_unstable();
    cx.end_step("keep light");
    let settings = cx.settings;
    Ok(Some(KeptLight {
        scene: digest_of(cx.scene),
        sky: cx.scene.sky,
        shooting: MeshSettings {
            edge: settings.shooter_edge,
            max_level: settings.max_level,
            max_vertices: settings.vertices_of_file(cx.scene),
            line_error: settings.asked_error(),
            is_gathered: solved.rows.source.strategy() == RowStrategy::Gather,
        },
        divided: divided.into_iter().map(|(_, patch)| patch).collect(),
        vertices: mesh.vertices.len(),
        parts: parts.into_iter().map(|solved| solved.part).collect(),
        validation: validation.clone(),
        reflectance: solved.mean_reflectance(),
        error: *error,
        simplify: settings.simplifies(),
    }))
}

impl Solved {
    /// The light sources, those of the same names together.
    fn sources_by_names(&self, scene: &Scene) -> Vec<(Vec<String>, Vec<LightSource>)> {
        let mut groups: Vec<(Vec<String>, Vec<LightSource>)> = vec![];
        let mut places = HashMap::new();
        for source in self.sources.each().iter().filter(|source| source.strength != DVec3::ZERO) {
            // A light may have the name of the sky.
            let is_sky = source.origin == Origin::Sky;
            let names: Vec<String> = names_of(scene, source.origin).map(str::to_owned).collect();
            let place = *places.entry((is_sky, names.clone())).or_insert_with(|| {
                groups.push((names, vec![]));
                groups.len() - 1
            });
            groups[place].1.push(source.clone());
        }
        groups
    }

    /// The solution for some sources. It is known already where they are `alone`.
    fn part(
        &mut self,
        cx: &mut Context,
        (names, mut sources): (Vec<String>, Vec<LightSource>),
        alone: bool,
        means: &ShareValues,
        columns: &mut Option<ColumnCache>,
    ) -> Result<SolvedPart> {
        let is_sky = sources.iter().any(|source| source.origin == Origin::Sky);
        let sky = cx.scene.sky;
        // With three channels the sky is solved for as one of white mean: then any colour can be made of it.
        let is_white = is_sky && cx.channels == Channels::Three;
        if is_white {
            for source in &mut sources {
                source.strength = if cx.scene.sky_pattern.is_some() {
                    DVec3::select(sky.cmpgt(DVec3::ZERO), source.strength / sky, DVec3::ZERO)
                } else {
                    DVec3::splat(std::f64::consts::PI)
                };
            }
        }
        let unit = if is_sky && !is_white { Unit::White(sky) } else { Unit::AsItIs };
        let kept = |light: &[DVec3]| light.iter().map(|light| unit.of(*light).as_vec3()).collect();
        let (direct, solution) = if alone && !is_white {
            (self.direct.clone(), self.solution.clone())
        } else {
            let direct = self.direct_of(cx, &sources)?;
            let tolerance = cx.settings.threshold * PART_TOLERANCE;
            let dark = self.dark(cx, &sources)?;
            let (mesh, exposed) = (&self.mesh, &self.exposed);
            let problem = Problem { mesh, values: means, exposed, direct: &direct, tolerance };
            let Rows { source, table } = &mut self.rows;
            let solution = source.solve(cx, table, &problem, columns, dark)?;
            (direct, solution)
        };
        let noise = self.noise_of_part(&sources, &solution);
        let part = KeptPart {
            names,
            is_sky,
            as_baked: if is_sky { sky } else { DVec3::ONE },
            direct: kept(&direct),
            irradiance: kept(&solution.irradiance),
            gathered: vec![],
            noise: if is_sky && !is_white { noise / sky.max_element() } else { noise },
            residual: solution.residual,
        };
        Ok(SolvedPart { sources, radiosity: solution.radiosity, local: solution.local, part, unit })
    }

    /// Gathers the light of parts at the vertices.
    fn gather_at_vertices(&mut self, cx: &mut Context, parts: &mut [SolvedPart]) -> Result<()> {
        let direct_of = |solved: &SolvedPart| {
            let direct = solved.part.direct.iter();
            direct.map(|kept| solved.unit.light(kept.as_dvec3())).collect()
        };
        let directs: Vec<Vec<DVec3>> = parts.iter().map(direct_of).collect();
        let lights = parts.iter().zip(&directs);
        let lights: Vec<VertexLight> =
            lights.map(|(solved, direct)| VertexLight { radiosity: &solved.radiosity, direct }).collect();
        let on = (&self.mesh, &*self.exposed);
        let gathered = self.rows.table.gather_at_vertices(cx, on, &lights)?;
        for (solved, (reflected, local)) in parts.iter_mut().zip(gathered) {
            let all = solved
                .part
                .direct
                .iter()
                .zip(reflected)
                .map(|(direct, light)| (direct.as_dvec3() + solved.unit.of(light)).as_vec3());
            solved.part.irradiance = all.collect();
            solved.local = Some(local);
        }
        Ok(())
    }

    /// Gathers the light of parts at sample points.
    fn gather_at_samples(
        &mut self,
        cx: &mut Context,
        samples: &SamplePoints,
        parts: &mut [SolvedPart],
    ) -> Result<()> {
        if samples.count() == 0 {
            return Ok(());
        }
        let receivers = samples.receivers(samples.count());
        let lights: Vec<Lights> = parts
            .iter()
            .map(|solved| Lights { sources: &solved.sources, radiosity: solved.radiosity() })
            .collect();
        let light = irradiance_at(cx, &self.mesh, &mut self.rows, Place::Once(&receivers), &lights)?.light;
        for (solved, mut light) in parts.iter_mut().zip(light) {
            samples.bound(&mut light.all);
            solved.part.gathered = light.all.into_iter().map(|light| solved.unit.of(light)).collect();
        }
        Ok(())
    }

    /// Standard error of a part of the light from rays, relative to the whole. That of small lamps that share rows is not known.
    fn noise_of_part(&self, sources: &[LightSource], solution: &Solution) -> f64 {
        let whole = self.solution.samples.level();
        if whole <= 0.0 {
            return 0.0;
        }
        let key = |source: &LightSource| source.shooter.as_ref().map(|shooter| shooter.key);
        let strengths: HashMap<u64, DVec3> =
            sources.iter().filter_map(|source| Some((key(source)?, source.strength))).collect();
        let strength = |source: &LightSource| {
            key(source).and_then(|key| strengths.get(&key)).copied().unwrap_or_default()
        };
        let noise = self.noise_of(solution, sources, self.sources.all.iter().map(strength)).total();
        noise * solution.samples.level() / whole
    }
}
