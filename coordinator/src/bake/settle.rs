//! The last step of the solution: the shares take the mean radiosity of the refined mesh.

use glam::DVec3;
use shared::row::Row;

use super::{Bake, BakeError, Phase};
use crate::mesh::{Mesh, PatchId, Share};
use crate::solver::ShareEnergy;

/// A share of which less than this part is exposed takes the value at its vertex.
const LEAST_EXPOSED: f64 = 0.1;

impl Bake<'_, '_> {
    /// Solves again with each share's radiosity taken as the mean over its part of the refined mesh instead of the value at
    /// its vertex: the better figure where a shadow line or a hot spot lies inside the share. No rows are needed but
    /// those that there are, or were.
    pub(super) fn settle(&mut self) -> Result<(), BakeError> {
        self.office.enter(Phase::Settle, self.mesh.vertices.len());
        let means = Means::new(&self.mesh, &self.shares, &self.exposed);
        let direct = means.of(&self.direct);
        let guess = std::mem::take(&mut self.radiosity);
        let itself = |(receiver, share): (usize, &ShareEnergy)| ShareEnergy { receiver, ..*share };
        let energies = self.energies.iter().enumerate().map(itself).collect();
        self.solve(energies, Some(&means), direct, guess)?;
        self.end_step("settle");
        Ok(())
    }
}

/// The mean over each share's part of the refined mesh, of what its vertices have.
pub struct Means {
    shares: usize,
    /// Where the shares of each vertex begin, and where the last ones end.
    starts: Vec<u32>,
    /// By vertex: the shares whose means it is a part of, and how much.
    weights: Vec<(u32, f64)>,
}

impl Means {
    /// The means of these shares. A vertex that is not exposed sees no surface: it sends light to none either, like the floor
    /// under a box, and what it has must not dim the mean of a share that lies half in the open.
    fn new(mesh: &Mesh, shares: &[Share], exposed: &[bool]) -> Self {
        let by_share: Vec<Vec<(usize, f64)>> =
            shares.iter().map(|share| mean_weights(mesh, share, exposed)).collect();
        let mut starts = vec![0; exposed.len() + 1];
        for (vertex, _) in by_share.iter().flatten() {
            starts[vertex + 1] += 1;
        }
        for vertex in 0..exposed.len() {
            starts[vertex + 1] += starts[vertex];
        }
        let mut next = starts.clone();
        let mut weights = vec![(0, 0.0); starts.last().copied().unwrap_or(0) as usize];
        for (share, own) in (0..).zip(&by_share) {
            for (vertex, weight) in own {
                weights[next[*vertex] as usize] = (share, *weight);
                next[*vertex] += 1;
            }
        }
        Self { shares: shares.len(), starts, weights }
    }

    fn at(&self, vertex: usize) -> &[(u32, f64)] {
        &self.weights[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }

    /// Mean of each share.
    fn of(&self, values: &[DVec3]) -> Vec<DVec3> {
        let mut means = vec![DVec3::ZERO; self.shares];
        for (vertex, value) in values.iter().enumerate() {
            self.at(vertex).iter().for_each(|(share, weight)| means[*share as usize] += *value * *weight);
        }
        means
    }

    /// For the means of rows.
    pub fn sums(&self) -> Sums<'_> {
        Sums {
            means: self,
            sums: vec![0.0; self.shares],
            reached: vec![],
            is_reached: vec![false; self.shares],
        }
    }
}

/// Sums up means of rows, one row after the other: what a row does not reach costs nothing.
pub struct Sums<'a> {
    means: &'a Means,
    sums: Vec<f64>,
    reached: Vec<u32>,
    is_reached: Vec<bool>,
}

impl Sums<'_> {
    /// The means of a row, given in parts that follow each other: a factor for each share.
    pub fn column(&mut self, rows: &[&Row]) -> Row {
        let mut first = 0;
        for row in rows {
            row.for_each(|receiver, factor| {
                for (share, weight) in self.means.at(first + receiver) {
                    if !std::mem::replace(&mut self.is_reached[*share as usize], true) {
                        self.reached.push(*share);
                    }
                    self.sums[*share as usize] += f64::from(factor) * weight;
                }
            });
            first += row.receivers();
        }
        self.reached.sort_unstable();
        let means: Vec<(usize, f32)> =
            self.reached.iter().map(|share| (*share as usize, self.sums[*share as usize] as f32)).collect();
        for share in self.reached.drain(..) {
            self.sums[share as usize] = 0.0;
            self.is_reached[share as usize] = false;
        }
        Row::of_some(self.means.shares, &means)
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
