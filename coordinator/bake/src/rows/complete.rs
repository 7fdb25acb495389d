//! Solutions made complete: light at all vertices and refinement samples, from the radiosity of the shares.

use glam::DVec3;

use super::local_radiosity::{LocalRadiosity, Radiosity};
use super::problem::Problem;
use super::share_mesh::ShareMesh;
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

/// What lights all vertices.
pub struct VertexLight<'a> {
    /// Radiosity of the shares.
    pub radiosity: &'a [DVec3],
    /// Irradiance of the vertices from the light sources.
    pub direct: &'a [DVec3],
}

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
        let Problem { mesh, exposed, direct, .. } = *problem;
        let light = VertexLight { radiosity: &solution.radiosity, direct };
        let near = self.with_near(cx, (mesh, exposed), &sets, gathered, &[light])?;
        for (mut gathered, local) in near {
            solution.local = Some(local);
            if self.samples.is_some()
                && let Some(gathered) = gathered.pop()
            {
                solution.samples.set_gathered(&gathered);
            }
            solution.set_irradiance(direct, self.at_vertices(gathered))?;
        }
        Ok(())
    }

    /// Irradiance that the shares give all vertices, of which only what is exposed sees any surface, and the radiosity within shares: of
    /// several lights, in two passes over the rows.
    pub fn gather_at_vertices(
        &mut self,
        cx: &mut Context,
        (mesh, exposed): (&ShareMesh, &[bool]),
        lights: &[VertexLight],
    ) -> Result<Vec<(Vec<DVec3>, LocalRadiosity)>> {
        let sets: Vec<SetId> = self.vertices.sets().collect();
        let even: Vec<Radiosity> = lights.iter().map(|light| Radiosity::even(light.radiosity)).collect();
        let gathered = self.gather_each(cx, &mesh.mesh, &sets, &even, |_, _, _| ())?;
        let near = self.with_near(cx, (mesh, exposed), &sets, gathered, lights)?;
        Ok(near.into_iter().map(|(gathered, local)| (self.at_vertices(gathered), local)).collect())
    }

    /// Adds near light to what the sets get of even shares: those of the vertices, each of which has a receiver of its own, and others
    /// after them.
    ///
    /// What near receivers lose of a share's flux all get that see it, in a pass over the rows more. So light balances; of a share that
    /// sees the open sky a part is lost there.
    fn with_near(
        &mut self,
        cx: &mut Context,
        (mesh, exposed): (&ShareMesh, &[bool]),
        sets: &[SetId],
        gathered: Vec<BySet>,
        lights: &[VertexLight],
    ) -> Result<Vec<(BySet, LocalRadiosity)>> {
        let areas = self.areas_of_vertices(&mesh.mesh);
        let (mut all, mut given_back) = (vec![], vec![]);
        for (gathered, light) in gathered.into_iter().zip(lights) {
            let (estimate, lost) = self.estimate(cx, (mesh, exposed), light.direct, &gathered, &areas)?;
            let lost = lost.into_iter().zip(&mesh.shares).map(|(lost, share)| lost / share.area);
            let lost: Vec<DVec3> = lost.collect();
            let wholes =
                light.radiosity.iter().zip(&lost).map(|(radiosity, lost)| *radiosity + *lost).collect();
            all.push((gathered, estimate, wholes));
            given_back.push(lost);
        }
        if given_back.iter().flatten().any(|light| *light != DVec3::ZERO) {
            let even: Vec<Radiosity> = given_back.iter().map(|light| Radiosity::even(light)).collect();
            let light = self.gather_each(cx, &mesh.mesh, sets, &even, |_, _, _| ())?;
            for ((gathered, estimate, _), light) in all.iter_mut().zip(&light) {
                add(gathered, light);
                add(estimate, light);
            }
        }
        let mut lit = vec![];
        for ((mut gathered, estimate, wholes), light) in all.into_iter().zip(lights) {
            let irradiance = self.irradiance(light.direct, estimate);
            let local = LocalRadiosity::new(cx.scene, mesh, exposed, &irradiance, wholes);
            self.add_near(cx, &mesh.mesh, sets, &local, &mut gathered)?;
            lit.push((gathered, local));
        }
        Ok(lit)
    }

    /// What receivers would get if each part of a share were as bright as even shares make it, and the flux of each share that near
    /// vertices lose so.
    fn estimate(
        &self,
        cx: &mut Context,
        (mesh, exposed): (&ShareMesh, &[bool]),
        direct: &[DVec3],
        gathered: &BySet,
        areas: &[f64],
    ) -> Result<(BySet, Vec<DVec3>)> {
        let irradiance = self.irradiance(direct, gathered.clone());
        let local = LocalRadiosity::new(cx.scene, mesh, exposed, &irradiance, vec![]);
        let mut estimate = gathered.clone();
        let mut lost = vec![DVec3::ZERO; mesh.shares.len()];
        let mut first = 0;
        for (set, light) in self.vertices.sets().zip(&mut estimate) {
            if let Some((receivers, near)) = self.near(set) {
                near.each_light(
                    &mut cx.client.monitor,
                    &mesh.mesh,
                    receivers,
                    &local,
                    |receiver, share, near| {
                        light[receiver] += near;
                        lost[share.index()] -= near * areas[first + receiver];
                    },
                )?;
            }
            first += light.len();
        }
        Ok((estimate, lost))
    }

    /// The area that each vertex stands for in means over patches, smaller where its light is bounded.
    fn areas_of_vertices(&self, mesh: &Mesh) -> Vec<f64> {
        let mut areas = vec![DVec3::ZERO; mesh.vertices.len()];
        let mut weights = vec![];
        for (id, _) in mesh.leaves() {
            add_whole(mesh, id, 1.0, &mut weights);
            weights.drain(..).for_each(|(vertex, weight)| areas[vertex].x += weight);
        }
        self.bounds.apply(0, &mut areas);
        areas.into_iter().map(|area| area.x).collect()
    }

    /// Irradiance of all vertices, from what the receivers of their sets get of shares.
    fn irradiance(&self, direct: &[DVec3], mut gathered: BySet) -> Vec<DVec3> {
        gathered.truncate(self.vertices.sets().count());
        let reflected = self.at_vertices(gathered);
        direct.iter().zip(reflected).map(|(direct, light)| *direct + light).collect()
    }
}

fn add(light: &mut BySet, other: &BySet) {
    light.iter_mut().flatten().zip(other.iter().flatten()).for_each(|(light, other)| *light += *other);
}
