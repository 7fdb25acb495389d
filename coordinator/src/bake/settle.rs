//! The last step of the solution: the shares take the mean radiosity of the refined mesh.

use glam::DVec3;

use super::{Bake, BakeError, Phase};
use crate::mesh::{Mesh, PatchId, Share};
use crate::solver::sweeps::Transfer;

/// A share of which less than this part is exposed takes the value at its vertex.
const LEAST_EXPOSED: f64 = 0.1;

impl Bake<'_, '_> {
    /// Solves again with each share's radiosity taken as the mean over its part of the refined mesh instead of the value at
    /// its vertex: the better figure where a shadow line or a hot spot lies inside the share. No new rows are needed.
    pub(super) fn settle(&mut self) -> Result<(), BakeError> {
        self.office.enter(Phase::Settle, self.mesh.vertices.len());
        let exposed = self.exposed_vertices();
        let means: Vec<Vec<(usize, f64)>> =
            self.shares.iter().map(|share| mean_weights(&self.mesh, share, &exposed)).collect();
        let columns = self
            .rows
            .iter()
            .map(|row| {
                let mean = |weights: &Vec<(usize, f64)>| {
                    weights.iter().map(|(vertex, weight)| f64::from(row[*vertex]) * weight).sum::<f64>()
                        as f32
                };
                means.iter().map(mean).collect()
            })
            .collect();
        let direct: Vec<DVec3> = means
            .iter()
            .map(|weights| weights.iter().map(|(vertex, weight)| self.direct[*vertex] * *weight).sum())
            .collect();
        let guess = std::mem::take(&mut self.radiosity);
        self.solve(&Transfer { columns }, &direct, guess)?;
        self.end_step("settle");
        Ok(())
    }

    /// Whether each vertex sees any surface. One that sees none, like the floor under a box, sends light to none either: what
    /// it has must not dim the mean of a share that lies half in the open.
    fn exposed_vertices(&self) -> Vec<bool> {
        let mut exposed = vec![false; self.mesh.vertices.len()];
        for row in &self.rows {
            for (exposed, factor) in exposed.iter_mut().zip(row) {
                *exposed |= *factor > 0.0;
            }
        }
        exposed
    }
}

/// Weights of the exposed vertices in the mean of a share: its parts are children of the patches that it was dealt, or
/// quarters of those that were never divided.
fn mean_weights(mesh: &Mesh, share: &Share, exposed: &[bool]) -> Vec<(usize, f64)> {
    let mut weights = vec![];
    for &(patch, corner) in &share.corners {
        if mesh.patch(patch).first_child.is_some() {
            add_leaves(mesh, patch, corner, &mut weights);
        } else {
            let area = mesh.patch(patch).area / mesh.patch(patch).corners.len() as f64;
            add_quarter(mesh, patch, corner, area, &mut weights);
        }
    }
    weights.sort_unstable_by_key(|(vertex, _)| *vertex);
    weights.dedup_by(|from, into| {
        let same = from.0 == into.0;
        if same {
            into.1 += from.1;
        }
        same
    });
    let is_exposed = |entry: &(usize, f64)| exposed[entry.0];
    let sum = |weights: &[(usize, f64)]| weights.iter().map(|entry| entry.1).sum::<f64>();
    if weights.iter().any(is_exposed) {
        weights.retain(is_exposed);
    }
    let total = sum(&weights);
    // Extrapolation has negative weights: where few vertices are left they may outweigh the others.
    if total < LEAST_EXPOSED * share.area {
        return vec![(share.vertex.index(), 1.0)];
    }
    weights.iter_mut().for_each(|(_, weight)| *weight /= total);
    weights
}

/// Mean over the leaves of a divided patch's child. Between exact vertex values the mean of the interpolation is off by a
/// multiple of the squared size, which Richardson extrapolation with the mean on the parent's level takes out.
fn add_leaves(mesh: &Mesh, parent: PatchId, corner: usize, weights: &mut Vec<(usize, f64)>) {
    let Some(id) = mesh.children(parent).nth(corner) else { return };
    let patch = mesh.patch(id);
    if patch.first_child.is_some() {
        (0..patch.corners.len()).for_each(|corner| add_leaves(mesh, id, corner, weights));
        return;
    }
    let weight = patch.area / patch.corners.len() as f64;
    weights.extend(patch.corners.iter().map(|corner| (corner.index(), weight * 4.0 / 3.0)));
    add_quarter(mesh, parent, corner, -patch.area / 3.0, weights);
}

/// `part` times the mean over the part of a patch that a corner answers for, of the values interpolated between the patch's
/// corners.
fn add_quarter(mesh: &Mesh, id: PatchId, corner: usize, part: f64, weights: &mut Vec<(usize, f64)>) {
    let patch = mesh.patch(id);
    let count = patch.corners.len();
    let mut add = |i: usize, weight: f64| weights.push((patch.corners[i % count].index(), weight * part));
    // A quarter each for the corner, the middles of its two edges and the centre.
    add(corner, 0.5);
    add(corner + 1, 0.125);
    add(corner + count - 1, 0.125);
    for i in 0..count {
        add(i, 0.25 / count as f64);
    }
}
