//! Solutions made complete: light at all vertices and refinement samples, from the radiosity of the shares.

use glam::DVec3;

use super::local_radiosity::{LocalRadiosity, Radiosity};
use super::problem::Problem;
use super::solution::Solution;
use super::table::RowTable;
use super::weights::add_whole;
use crate::context::Context;
use crate::error::Result;
use crate::mesh::Mesh;
use crate::solver::ShareId;
use crate::solver::bounds::add_slab_to_sums;
use crate::solver::cache::SetId;
use crate::solver::slab::Slab;

/// Light of the receivers of some sets, set by set.
type BySet = Vec<Vec<DVec3>>;

impl RowTable {
    /// Gathers the irradiance of a solution at all vertices and refinement samples.
    pub fn complete(&mut self, cx: &mut Context, problem: &Problem, solution: &mut Solution) -> Result<()> {
        let sets: Vec<SetId> = self.vertices.sets().chain(self.samples).collect();
        // They do not change, and passes are many.
        let misses_sums = self.samples.is_some() && !solution.samples.has_row_sums();
        let mut sums = vec![0.0; solution.samples.count()];
        let materials = &problem.mesh.materials;
        let last = sets.len().saturating_sub(1);
        let look = |set: usize, shares: &[ShareId], slab: &Slab| {
            if misses_sums && set == last {
                add_slab_to_sums(slab, |row| materials[shares[row].index()].opacity, &mut sums);
            }
        };
        let even = [Radiosity::even(&solution.radiosity)];
        let gathered = self.gather_each(cx, &problem.mesh.mesh, &sets, &even, look)?;
        if misses_sums {
            solution.samples.set_row_sums(&sums);
        }
        let near = self.with_near(cx, &sets, gathered, &[(problem, &solution.radiosity)])?;
        for (mut gathered, local) in near {
            solution.local = Some(local);
            if self.samples.is_some()
                && let Some(gathered) = gathered.pop()
            {
                solution.samples.set_gathered(&gathered);
            }
            solution.set_irradiance(problem.direct, self.at_vertices(gathered))?;
        }
        Ok(())
    }

    /// Irradiance that the shares give all vertices, and the radiosity within shares: for several problems on one mesh, each with the
    /// radiosity of its shares, in two passes over the rows.
    pub fn gather_at_vertices(
        &mut self,
        cx: &mut Context,
        parts: &[(&Problem, &[DVec3])],
    ) -> Result<Vec<(Vec<DVec3>, LocalRadiosity)>> {
        let Some((Problem { mesh, .. }, _)) = parts.first() else { return Ok(vec![]) };
        let sets: Vec<SetId> = self.vertices.sets().collect();
        let even: Vec<Radiosity> = parts.iter().map(|(_, radiosity)| Radiosity::even(radiosity)).collect();
        let gathered = self.gather_each(cx, &mesh.mesh, &sets, &even, |_, _, _| ())?;
        let near = self.with_near(cx, &sets, gathered, parts)?;
        Ok(near.into_iter().map(|(gathered, local)| (self.at_vertices(gathered), local)).collect())
    }

    /// Adds near light to what the sets get of even shares: those of the vertices, and others after them.
    ///
    /// What near receivers lose of a share's flux all others get, so that the light balances: a pass over the rows more.
    fn with_near(
        &mut self,
        cx: &mut Context,
        sets: &[SetId],
        mut gathered: Vec<BySet>,
        parts: &[(&Problem, &[DVec3])],
    ) -> Result<Vec<(BySet, LocalRadiosity)>> {
        let Some((Problem { mesh, .. }, _)) = parts.first() else { return Ok(vec![]) };
        let areas = areas_of_vertices(&mesh.mesh);
        let (mut locals, mut estimates, mut given_back) = (vec![], vec![], vec![]);
        for (gathered, (problem, radiosity)) in gathered.iter().zip(parts) {
            cx.client.monitor.check()?;
            let irradiance = self.irradiance(problem, gathered.clone());
            let (scene, exposed) = (cx.scene, problem.exposed);
            let mut local = LocalRadiosity::new(scene, mesh, exposed, &irradiance, radiosity.to_vec());
            let near = Radiosity { shares: radiosity, local: Some(&local) };
            let mut estimate = gathered.clone();
            let mut lost = vec![DVec3::ZERO; radiosity.len()];
            let mut first = 0;
            for (set, light) in self.vertices.sets().zip(&mut estimate) {
                self.each_near(&mesh.mesh, set, near, |receiver, share, near| {
                    light[receiver] += near;
                    lost[share.index()] -= near * areas[first + receiver];
                });
                first += light.len();
            }
            local.give_back(mesh, &lost);
            let wholes = (0..radiosity.len()).map(|share| local.whole(share) - radiosity[share]);
            given_back.push(wholes.collect::<Vec<DVec3>>());
            locals.push(local);
            estimates.push(estimate);
        }
        let given_back: Vec<Radiosity> = given_back.iter().map(|light| Radiosity::even(light)).collect();
        let given_back = self.gather_each(cx, &mesh.mesh, sets, &given_back, |_, _, _| ())?;
        for light in [&mut gathered, &mut estimates] {
            add_all(light, &given_back);
        }
        let of_parts = locals.into_iter().zip(estimates).zip(parts);
        let mut all = vec![];
        for (mut gathered, ((local, estimate), (problem, radiosity))) in gathered.into_iter().zip(of_parts) {
            cx.client.monitor.check()?;
            let irradiance = self.irradiance(problem, estimate);
            let wholes = local.into_wholes();
            let local = LocalRadiosity::new(cx.scene, mesh, problem.exposed, &irradiance, wholes);
            let near = Radiosity { shares: radiosity, local: Some(&local) };
            for (set, light) in sets.iter().zip(&mut gathered) {
                self.each_near(&mesh.mesh, *set, near, |receiver, _, near| light[receiver] += near);
            }
            all.push((gathered, local));
        }
        Ok(all)
    }

    /// Irradiance of all vertices, from what the receivers of their sets get of shares.
    fn irradiance(&self, problem: &Problem, mut gathered: BySet) -> Vec<DVec3> {
        gathered.truncate(self.vertices.sets().count());
        let reflected = self.at_vertices(gathered);
        problem.direct.iter().zip(reflected).map(|(direct, light)| *direct + light).collect()
    }
}

fn add_all(light: &mut [BySet], other: &[BySet]) {
    let pairs = light.iter_mut().flatten().flatten().zip(other.iter().flatten().flatten());
    pairs.for_each(|(light, other)| *light += *other);
}

/// The area that each vertex stands for in means over patches.
fn areas_of_vertices(mesh: &Mesh) -> Vec<f64> {
    let mut areas = vec![0.0; mesh.vertices.len()];
    let mut weights = vec![];
    for (id, _) in mesh.leaves() {
        add_whole(mesh, id, 1.0, &mut weights);
        weights.drain(..).for_each(|(vertex, weight)| areas[vertex] += weight);
    }
    areas
}
