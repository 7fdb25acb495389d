//! Solving for the light of each source by itself.

use std::collections::HashMap;

use glam::DVec3;

use super::digest_of;
use super::kept::{KeptLight, KeptPart, ShootingMesh};
use crate::mesh::PatchId;
use crate::solver::cache::{ColumnCache, SetId};
use crate::stages::channels::{Channels, Gathering};
use crate::stages::layers::{TOLERANCE, names_of};
use crate::stages::light::{self, LightSource, Origin};
use crate::stages::settle::Means;
use crate::stages::{Bake, BakeError, Phase};

/// Bytes of irradiances that are gathered at the same time.
const MOST_GATHERED: usize = 1 << 30;

/// Bytes that are kept for each light and each vertex or check point. Vertices: irradiance in all and direct, three channels each; check
/// points: irradiance in all, twice as exactly.
const BYTES: u64 = 24;

/// The solution for a part, until the vertices and check points are lit by all of them.
struct Solved {
    sources: Vec<LightSource>,
    radiosity: Vec<DVec3>,
    part: KeptPart,
    unit: Unit,
}

/// What the solutions of all parts have in common.
struct Solving {
    means: Option<Means>,
    columns: Option<ColumnCache>,
    /// Root mean square of the radiosity of the whole at the guides.
    level: f64,
}

/// What light is kept as.
#[derive(Debug, Clone, Copy)]
enum Unit {
    /// As it is.
    AsItIs,
    /// A light of one colour as a white one of this many times less: with one channel that is as much of each.
    White(f64),
}

impl Unit {
    fn of(self, light: DVec3) -> DVec3 {
        match self {
            Self::AsItIs => light,
            Self::White(sum) => DVec3::splat(light.element_sum() / sum),
        }
    }
}

impl Bake<'_, '_> {
    /// Solves for the light of each source by itself. `None` where that is not wanted, or would take more room than it may.
    ///
    /// # Errors
    /// When rows cannot be had.
    #[tracing::instrument(skip_all)]
    pub(in crate::stages) fn keep_light(&mut self) -> Result<Option<KeptLight>, BakeError> {
        let Some(most_bytes) = self.settings.keep_light else { return Ok(None) };
        let groups = self.sources_by_names();
        let places = self.mesh.vertices.len() + self.checks.count();
        if (groups.len() as u64).saturating_mul(places as u64 * BYTES) > most_bytes {
            return Ok(None);
        }
        self.office.enter(Phase::Groups, self.mesh.vertices.len());
        let is_alone = groups.len() == 1;
        let level = self.guides.level();
        let reflectance = self.mean_reflectance();
        let mut parts = self.apart(|bake| {
            let mut solving = Solving { means: None, columns: None, level };
            groups
                .into_iter()
                .map(|group| bake.part(group, is_alone, &mut solving))
                .collect::<Result<Vec<_>, _>>()
        })?;
        if parts.iter().any(|solved| solved.part.irradiance.is_empty()) {
            self.gather_at_vertices(&mut parts)?;
        }
        self.gather_at_checks(&mut parts)?;
        let mut divided: Vec<(PatchId, PatchId)> = vec![];
        for (index, patch) in self.mesh.patches.iter().enumerate() {
            divided.extend(patch.first_child.map(|first| (first, PatchId(index as u32))));
        }
        divided.sort_unstable();
        self.end_step("keep light");
        let settings = self.settings;
        Ok(Some(KeptLight {
            scene: digest_of(self.scene),
            sky: self.scene.sky,
            shooting: ShootingMesh {
                edge: settings.shooter_edge,
                max_level: settings.max_level,
                max_vertices: settings.max_vertices,
                has_error: settings.error.is_some(),
                is_gathered: self.is_gathered,
            },
            divided: divided.into_iter().map(|(_, patch)| patch).collect(),
            vertices: self.mesh.vertices.len(),
            parts: parts.into_iter().map(|solved| solved.part).collect(),
            checks: self.checks.clone(),
            reflectance,
            error: self.error,
        }))
    }

    /// The light sources, those of the same names together.
    fn sources_by_names(&self) -> Vec<(Vec<String>, Vec<LightSource>)> {
        let mut groups: Vec<(Vec<String>, Vec<LightSource>)> = vec![];
        let mut places = HashMap::new();
        for source in self.sources.iter().filter(|source| source.strength != DVec3::ZERO) {
            // A light that happens to be called as the sky is is not the sky.
            let is_sky = source.origin == Origin::Sky;
            let names: Vec<String> = names_of(self.scene, source.origin).map(str::to_owned).collect();
            let place = *places.entry((is_sky, names.clone())).or_insert_with(|| {
                groups.push((names, vec![]));
                groups.len() - 1
            });
            groups[place].1.push(source.clone());
        }
        groups
    }

    /// The solution for some sources; `alone` where there are no others, so that it is known already.
    fn part(
        &mut self,
        (names, mut sources): (Vec<String>, Vec<LightSource>),
        alone: bool,
        solving: &mut Solving,
    ) -> Result<Solved, BakeError> {
        let is_sky = sources.iter().any(|source| source.origin == Origin::Sky);
        let sky = self.scene.sky;
        // With three channels the sky is solved for as a white one: then any colour can be made of it.
        let is_white = is_sky && self.channels == Channels::Three;
        if is_white {
            sources.iter_mut().for_each(|source| source.strength = DVec3::splat(std::f64::consts::PI));
        }
        let unit = if is_sky && !is_white { Unit::White(sky.element_sum()) } else { Unit::AsItIs };
        let kept = |light: &[DVec3]| light.iter().map(|light| unit.of(*light).as_vec3()).collect();
        let is_known = alone && !is_white;
        let mut irradiance = vec![];
        if !is_known && !self.is_gathered {
            let direct = self.direct_of(&sources)?;
            self.solve_for(&direct, solving)?;
            self.direct = direct;
        } else {
            if !is_known {
                self.light_vertices(&sources, true)?;
            }
            irradiance = kept(&self.irradiance);
        }
        let noise = self.noise_of(&sources, solving.level);
        let part = KeptPart {
            names,
            is_sky,
            as_baked: if is_sky { sky } else { DVec3::ONE },
            direct: kept(&self.direct),
            irradiance,
            gathered: vec![],
            noise: if is_sky && !is_white { noise / sky.max_element() } else { noise },
            residual: self.residual,
        };
        Ok(Solved { sources, radiosity: self.radiosity.clone(), part, unit })
    }

    /// Solves for the radiosity of the shares under this light, with means and columns that are the same for all parts.
    fn solve_for(&mut self, direct: &[DVec3], solving: &mut Solving) -> Result<(), BakeError> {
        let means = solving.means.get_or_insert_with(|| Means::new(&self.mesh, &self.shares, &self.exposed));
        let (energies, dark) = (self.settled_energies(), vec![DVec3::ZERO; self.shares.len()]);
        let tolerance = self.settings.threshold * TOLERANCE;
        let columns = solving.columns.take();
        let columns = self.solve_shares(energies, Some(means), columns, means.of(direct), dark, tolerance)?;
        solving.columns = Some(columns);
        Ok(())
    }

    /// Gathers the light of each part at the vertices: rows that are not kept are made once for as many parts as fit into memory.
    fn gather_at_vertices(&mut self, parts: &mut [Solved]) -> Result<(), BakeError> {
        let together = (MOST_GATHERED / (self.mesh.vertices.len() * size_of::<DVec3>()).max(1)).max(1);
        let sets = self.vertex_sets.clone();
        for parts in parts.chunks_mut(together) {
            let nothing = |set: &SetId| self.channels.gathering(self.rows.set(*set).count());
            let mut gathered: Vec<Vec<Gathering>> =
                parts.iter().map(|_| sets.iter().map(nothing).collect()).collect();
            self.rows.each(
                self.office,
                &sets,
                |_| true,
                |share, rows| {
                    for (gathered, solved) in gathered.iter_mut().zip(&*parts) {
                        let light = solved.radiosity[share.index()];
                        for (gathered, row) in gathered.iter_mut().zip(rows.into_iter().flatten()) {
                            gathered.add(row, light);
                        }
                    }
                },
            )?;
            for (solved, gathered) in parts.iter_mut().zip(gathered) {
                let reflected = gathered.into_iter().flat_map(Gathering::into_irradiance);
                let direct = &solved.part.direct;
                let all = direct
                    .iter()
                    .zip(reflected)
                    .map(|(direct, light)| (direct.as_dvec3() + solved.unit.of(light)).as_vec3());
                solved.part.irradiance = all.collect();
            }
        }
        Ok(())
    }

    /// Gathers the light of each part at the check points, all in one go over the rows.
    fn gather_at_checks(&mut self, parts: &mut [Solved]) -> Result<(), BakeError> {
        let count = self.checks.count();
        if count == 0 {
            return Ok(());
        }
        let receivers = self.checks.receivers(count);
        let set = self.office.publish_receivers(&receivers);
        let mut gathered: Vec<Gathering> =
            parts.iter().map(|_| self.channels.gathering(set.count())).collect();
        self.rows.each_over(self.office, set, &receivers, |share, row| {
            for (gathered, solved) in gathered.iter_mut().zip(&*parts) {
                gathered.add(row, solved.radiosity[share]);
            }
        })?;
        for (solved, gathered) in parts.iter_mut().zip(gathered) {
            let direct = light::irradiance(&solved.sources, set, self.office, |_, _, _| ())?;
            let all = direct.iter().zip(gathered.into_irradiance()).map(|(direct, light)| *direct + light);
            solved.part.gathered = all.map(|light| solved.unit.of(light)).collect();
        }
        self.office.release_receivers(set);
        Ok(())
    }

    /// Standard error of the light of some sources, which is that of the vertices now, from rays; relative to a whole of this level.
    fn noise_of(&self, sources: &[LightSource], whole: f64) -> f64 {
        let Some(guides) = self.guide_set.filter(|_| whole > 0.0) else { return 0.0 };
        let strengths: HashMap<u64, DVec3> =
            sources.iter().map(|source| (source.shooter.key, source.strength)).collect();
        let strength = |source: &LightSource| strengths.get(&source.shooter.key).copied().unwrap_or_default();
        let direct = self.sources.iter().map(strength).zip(self.guide_variances.iter().copied());
        let shares = self.radiosity.iter().copied().zip(self.rows.variances(guides));
        let noise = self.guides.noise(shares.chain(direct), self.guides.count());
        noise.hypot(self.ray_noise) * self.guides.level() / whole
    }
}
