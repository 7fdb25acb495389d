//! Which irradiance a share reflects: that at its vertex, or the mean over its part of the refined mesh. The mean is better where
//! a shadow line or a hot spot lies inside the share.

use std::ops::{AddAssign, Mul, Range};

use kernel::row::{GROUP, Row};
use rayon::prelude::*;

use super::share_mesh::ShareMesh;
use super::weights::mean_weights;
use crate::mesh::{Mesh, Share};
use crate::solver::ShareEnergy;

/// Shares that a thread takes at a time.
const AT_ONCE: usize = 1024;

/// What means can be taken of.
pub trait Value: Copy + Default + AddAssign + Mul<f64, Output = Self> {}

impl<T: Copy + Default + AddAssign + Mul<f64, Output = T>> Value for T {}

/// Where shares take their irradiance from.
pub enum ShareValues {
    /// The value at the vertex of each.
    AtVertices,
    /// Means over the mesh.
    Means(Means),
}

impl ShareValues {
    /// Means over a mesh. `exposed` tells which vertices see any surface.
    pub fn means(mesh: &ShareMesh, exposed: &[bool]) -> Self {
        Self::Means(Means::new(&mesh.mesh, &mesh.shares, exposed))
    }

    /// Value of each share, from that of each vertex.
    pub fn of<T: Value>(&self, energies: &[ShareEnergy], values: &[T]) -> Vec<T> {
        match self {
            Self::AtVertices => energies.iter().map(|share| values[share.receiver]).collect(),
            Self::Means(means) => means.of(values),
        }
    }
}

/// The mean over each share's part of the refined mesh, of what its vertices have.
pub struct Means {
    shares: usize,
    /// Offsets into `weights`, one per vertex and the end.
    starts: Vec<u32>,
    /// By vertex.
    weights: Vec<Weight>,
}

/// Weight of a vertex in the mean of a share.
#[derive(Clone, Copy, Default)]
struct Weight {
    vertex: u32,
    share: u32,
    part: f64,
}

impl Means {
    /// The means of these shares. A vertex that is not exposed sees no surface, like the floor under a box, and sends light to
    /// none: it must not dim the mean of a share that lies half in the open.
    pub fn new(mesh: &Mesh, shares: &[Share], exposed: &[bool]) -> Self {
        let of_some = |(chunk, some): (usize, &[Share])| -> Vec<Weight> {
            let first = (chunk * AT_ONCE) as u32;
            let weight = |share, (vertex, part)| Weight { vertex: vertex as u32, share, part };
            let of_share = |(share, own)| {
                mean_weights(mesh, own, exposed).into_iter().map(move |own| weight(share, own))
            };
            (first..).zip(some).flat_map(of_share).collect()
        };
        let by_share: Vec<Vec<Weight>> = shares.par_chunks(AT_ONCE).enumerate().map(of_some).collect();
        let mut starts = vec![0; exposed.len() + 1];
        for weight in by_share.iter().flatten() {
            starts[weight.vertex as usize + 1] += 1;
        }
        for vertex in 0..exposed.len() {
            starts[vertex + 1] += starts[vertex];
        }
        let mut next = starts.clone();
        let mut weights = vec![Weight::default(); starts.last().copied().unwrap_or(0) as usize];
        for weight in by_share.into_iter().flatten() {
            let next = &mut next[weight.vertex as usize];
            weights[*next as usize] = weight;
            *next += 1;
        }
        Self { shares: shares.len(), starts, weights }
    }

    /// Weights of these vertices.
    fn of_vertices(&self, vertices: Range<usize>) -> &[Weight] {
        &self.weights[self.starts[vertices.start] as usize..self.starts[vertices.end] as usize]
    }

    /// Mean of each share.
    pub fn of<T: Value>(&self, values: &[T]) -> Vec<T> {
        let mut means = vec![T::default(); self.shares];
        for Weight { vertex, share, part } in &self.weights {
            means[*share as usize] += values[*vertex as usize] * *part;
        }
        means
    }

    /// Starts to take means of rows.
    pub fn sums(&self) -> Sums<'_> {
        Sums { means: self, sums: vec![0.0; self.shares], reached: vec![false; self.shares.div_ceil(GROUP)] }
    }
}

/// Takes means of rows, one after the other: shares that a row does not reach cost next to nothing.
pub struct Sums<'a> {
    means: &'a Means,
    sums: Vec<f64>,
    /// By 32 shares: whether the row reaches one of them.
    reached: Vec<bool>,
}

impl Sums<'_> {
    /// The means of a row, given in consecutive parts: a factor for each share.
    pub fn column(&mut self, rows: &[&Row]) -> Row {
        let mut first = 0;
        for row in rows {
            for (start, mask, own) in row.groups() {
                let start_vertex = first + start;
                let end = (start + GROUP).min(row.receivers());
                // The whole group at once: factors of 0 need no branch.
                let mut factors = [0.0; GROUP];
                spread(mask, own, &mut factors);
                for Weight { vertex, share, part } in self.means.of_vertices(start_vertex..first + end) {
                    let factor = factors[(*vertex as usize - start_vertex) % GROUP];
                    self.sums[*share as usize] += factor * part;
                    self.reached[*share as usize / GROUP] = true;
                }
            }
            first += row.receivers();
        }
        let means = Row::of_groups(&self.sums, &self.reached);
        for (sums, reached) in self.sums.chunks_mut(GROUP).zip(&mut self.reached) {
            if std::mem::take(reached) {
                sums.fill(0.0);
            }
        }
        means
    }
}

/// Scatters the factors of a group.
fn spread(mask: u32, own: &[f32], factors: &mut [f64; GROUP]) {
    if mask == u32::MAX {
        factors.iter_mut().zip(own).for_each(|(place, factor)| *place = f64::from(*factor));
        return;
    }
    let mut rest = mask;
    for factor in own {
        factors[rest.trailing_zeros() as usize % GROUP] = f64::from(*factor);
        rest &= rest.wrapping_sub(1);
    }
}
