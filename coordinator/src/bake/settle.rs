//! The last step: the shares take the mean radiosity of the refined mesh, and the figures are drawn up.

use glam::DVec3;

use super::{Bake, BakeError, BakeReport, Phase};
use crate::mesh::{Mesh, PatchId, Share};
use crate::solver::balance::{EnergyBalance, RowSums};
use crate::solver::sweeps::Transfer;

/// A vertex whose row sums to more than this is counted as enclosed: what its row lacks is error, not sky.
const ENCLOSED: f64 = 0.999;

/// A scene whose vertices see less than this of their hemisphere covered, in the mean, is open.
const OPEN: f64 = 0.99;

/// Row sums over this are worth a warning.
const LARGEST_ROW_SUM: f64 = 1.01;

/// More unshot flux than this after the sweeps is worth a warning.
const MOST_UNSHOT: f64 = 1e-4;

/// A share of which less than this part is exposed takes the value at its vertex.
const LEAST_EXPOSED: f64 = 0.1;

impl Bake<'_> {
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
        self.solve(&Transfer { columns }, &direct, guess)
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

    pub(super) fn report(&self) -> BakeReport {
        let statistics = &self.office.statistics;
        let areas = self.energies.iter().map(|share| share.area);
        let sums: Vec<(f64, f64)> = self.row_sums.iter().copied().zip(areas).collect();
        let row_sums = RowSums::new(&sums);
        BakeReport {
            warnings: self.warnings(&row_sums),
            vertices: self.mesh.vertices.len(),
            shooting_vertices: self.shares.len(),
            patches: self.mesh.leaves().count(),
            occluders: self.occluders,
            rows: self.office.rows_made(),
            factors: statistics.factors,
            sampled_pairs: statistics.sampled_pairs,
            rays: statistics.rays,
            shots: self.shots,
            sweeps: self.sweeps,
            refinement_rounds: self.rounds,
            unshot_bound: self.unshot_bound,
            mesh_error: self.mesh_error,
            balance: self.balance(),
            row_sums,
            busy_seconds: statistics.busy_nanoseconds as f64 * 1e-9,
            seconds: self.seconds.clone(),
        }
    }

    /// True when light can leave the scene: then what a point light sends to no surface has escaped, where in a closed scene
    /// it is an error of the mesh. Shares that see next to nothing lie between surfaces and do not count.
    fn is_open(&self) -> bool {
        let seeing = self.row_sums.iter().zip(&self.energies).filter(|(sum, _)| **sum > 1.0 - ENCLOSED);
        let (covered, area) =
            seeing.fold((0.0, 0.0), |(c, a), (sum, share)| (c + sum.min(1.0) * share.area, a + share.area));
        covered < OPEN * area
    }

    fn warnings(&self, row_sums: &RowSums) -> Vec<String> {
        let mut warnings = vec![];
        if self.mesh_error > self.settings.mesh_error {
            warnings.push(format!(
                "refinement ended at {:.2} % predicted error of the mesh, not {:.2} %: raise --max-vertices or --row-memory",
                100.0 * self.mesh_error,
                100.0 * self.settings.mesh_error
            ));
        }
        if row_sums.largest > LARGEST_ROW_SUM {
            warnings.push(format!(
                "form factors of a vertex sum to {:.4}, more than 1: surfaces overlap, or smooth normals bend far",
                row_sums.largest
            ));
        }
        if self.unshot_bound > MOST_UNSHOT {
            warnings.push(format!("the sweeps left {:.1e} of the reflected flux unshot", self.unshot_bound));
        }
        warnings
    }

    fn balance(&self) -> EnergyBalance {
        let square_unit = self.scene.frame.scale * self.scene.frame.scale;
        let surfaces = &self.scene.surfaces;
        let (mut emitted, mut absorbed, mut escaped) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        for (_, patch) in self.mesh.leaves() {
            let surface = &surfaces[patch.surface as usize];
            let corners = patch.corners.iter().map(|corner| self.irradiance[corner.index()]);
            let mean = corners.sum::<DVec3>() / patch.corners.len() as f64;
            emitted += surface.exitance * patch.area;
            absorbed += (1.0 - surface.reflectance) * mean * patch.area;
        }
        for (index, share) in self.shares.iter().enumerate() {
            if self.row_sums[index] < ENCLOSED {
                let leaving = surfaces[share.surface as usize].exitance + self.radiosity[index];
                escaped += leaving * share.area * (1.0 - self.row_sums[index]);
            }
        }
        let [emitted, absorbed, unshot, escaped] =
            [emitted, absorbed, self.unshot, escaped].map(|f| f * square_unit);
        let intensity: DVec3 = self.scene.point_lights.iter().map(|light| light.intensity).sum();
        let from_lights = intensity * 4.0 * std::f64::consts::PI;
        let past =
            if self.is_open() { from_lights - self.from_point_lights * square_unit } else { DVec3::ZERO };
        EnergyBalance::new(emitted + from_lights, absorbed, unshot, escaped + past.max(DVec3::ZERO))
    }
}

/// Weights of the exposed vertices in the mean of a share: its parts are children of the patches that it was dealt, or quarters of
/// those that were never divided.
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
