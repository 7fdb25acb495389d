//! Light passed on between gather points and shares.

use glam::DVec3;
use rayon::prelude::*;

use super::GatherRows;
use crate::context::Context;
use crate::error::Result;
use crate::mesh::PatchId;
use crate::rows::problem::Problem;
use crate::rows::solution::Solution;
use crate::rows::table::RowTable;
use crate::solver::acceleration::Acceleration;
use crate::solver::rooms::{Rooms, sum};

/// Passes end here even if the accuracy was not reached; the bound is reported.
const MOST_PASSES: u32 = 1000;

/// Leaves that a thread takes at a time.
const LEAVES_AT_ONCE: usize = 256;

impl GatherRows {
    /// Passes light on between gather points and shares: each share takes the mean of its part of the mesh, each vertex what the
    /// points around it give it.
    pub(super) fn pass_on(
        &self,
        cx: &mut Context,
        table: &RowTable,
        problem: &Problem,
        mut solution: Solution,
    ) -> Result<Solution> {
        let energies = &problem.mesh.energies;
        let areas: Vec<f64> = energies.iter().map(|share| share.area).collect();
        let mesh = &problem.mesh.mesh;
        let shares = problem.mesh.shares.iter().enumerate();
        let whole_leaves: Vec<(usize, PatchId)> =
            shares.filter_map(|(index, share)| Some((index, share.whole_leaf(mesh)?))).collect();
        let mut acceleration = Acceleration::new(areas, Rooms::one(energies.len()));
        for _ in 0..MOST_PASSES {
            cx.client.monitor.check()?;
            let points = self.points.gather(&solution.radiosity);
            self.light_vertices(table, problem.direct, &points, &mut solution)?;
            let mut incident = problem.values.of(energies, &solution.irradiance);
            if let Some(set) = table.middles {
                solution.middles.set_gathered(&self.at_set(set, &points));
                let means = whole_leaves.par_iter().with_min_len(LEAVES_AT_ONCE);
                let means: Vec<DVec3> =
                    means.map(|(share, leaf)| solution.middles.mean(mesh, *leaf, incident[*share])).collect();
                whole_leaves.iter().zip(means).for_each(|((share, _), mean)| incident[*share] = mean);
            }
            problem.mesh.preview(cx, problem.direct, || {
                (solution.irradiance.clone(), problem.mesh.unshot(&incident, &solution.radiosity))
            });
            cx.work.sweeps += 1;
            let next = problem.mesh.reflected(&incident);
            let change =
                |share: usize| (next[share] - solution.radiosity[share]).abs() * energies[share].area;
            let changed: DVec3 = sum(next.len(), change);
            let all: DVec3 = sum(next.len(), |share| next[share] * energies[share].area);
            let all = all.element_sum();
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
        let points = self.points.gather(&solution.radiosity);
        self.light_vertices(table, problem.direct, &points, &mut solution)?;
        if let Some(set) = table.samples {
            solution.samples.set_gathered(&self.at_set(set, &points));
        }
        Ok(solution)
    }

    /// Sets the irradiance of the vertices, given that of the gather points.
    fn light_vertices(
        &self,
        table: &RowTable,
        direct: &[DVec3],
        points: &[DVec3],
        solution: &mut Solution,
    ) -> Result<()> {
        let by_set = table.vertices.sets().map(|set| self.at_set(set, points));
        solution.set_irradiance(direct, table.vertices.join(by_set))
    }
}
