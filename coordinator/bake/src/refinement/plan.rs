use super::prediction::MeshError;
use crate::error_budget::without_noise;
use crate::mesh::{Mesh, PatchId};

/// Effect of the noise of sampled visibility on the prediction: three vertices of half the variance each, on every level.
const NOISE_SEEN: f64 = 1.1;

/// Part of a leaf's square error that dividing it takes away, at least where light is smooth.
const GAIN: f64 = 0.75;

/// Least part of the square error whose leaves are divided in a round: rounds cost, too.
const LEAST_PER_ROUND: f64 = 0.25;

/// Most of it: the new vertices then tell better where to go on.
const MOST_PER_ROUND: f64 = 0.8;

/// Most new vertices of a divided patch. It may make its neighbours divide as well.
const NEW_VERTICES: usize = 5;

/// How far to refine.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// Expected interpolation error at which refinement ends.
    pub limit: f64,
    /// Measured interpolation error over the predicted one.
    pub found_per_predicted: f64,
    /// Patches of this size are not divided.
    pub shortest_edge: f64,
    /// Most vertices.
    pub max_vertices: usize,
}

/// What to do next.
pub enum Step {
    /// The limit is met.
    Done,
    /// It cannot be met.
    Stop(Obstacle),
    /// Divide these patches.
    Divide(Vec<PatchId>),
}

/// Why refinement ended before its limit was met.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Obstacle {
    /// More vertices would only follow the noise of sampled visibility.
    Noise,
    /// There are as many vertices as there may be.
    MaxVertices,
    /// All patches are as small as they may be.
    SmallPatches,
}

impl Obstacle {
    /// Its description for the user, with a cure.
    #[must_use]
    pub fn describe(self) -> &'static str {
        match self {
            Self::Noise => "noise of sampled visibility hides it: raise --rays or --exact-occluders",
            Self::MaxVertices => "raise --max-vertices",
            Self::SmallPatches => "no patch is left that may be divided",
        }
    }
}

impl Plan {
    /// Decides what to do where the error is predicted like this, and light has this relative noise.
    #[must_use]
    pub fn next(&self, mesh: &Mesh, prediction: &MeshError, noise: f64) -> Step {
        let error = self.found_per_predicted * without_noise(prediction.relative(), NOISE_SEEN * noise);
        if error <= self.limit {
            return Step::Done;
        }
        if error <= noise {
            return Step::Stop(Obstacle::Noise);
        }
        let room = room(mesh, self.max_vertices);
        if room == 0 {
            return Step::Stop(Obstacle::MaxVertices);
        }
        let may_divide = |id: PatchId| mesh.size(id) > self.shortest_edge;
        let worst = prediction.worst_leaves(part_to_divide(error, self.limit), room, may_divide);
        if worst.is_empty() { Step::Stop(Obstacle::SmallPatches) } else { Step::Divide(worst) }
    }
}

/// Leaves that are longer than this, as many as may be divided.
#[must_use]
pub fn long_patches(mesh: &Mesh, longest: f64, max_vertices: usize) -> Vec<PatchId> {
    let leaves = mesh.leaves().map(|(id, _)| id);
    leaves.filter(|id| mesh.size(*id) > longest).take(room(mesh, max_vertices)).collect()
}

/// How many patches may be divided.
fn room(mesh: &Mesh, max_vertices: usize) -> usize {
    max_vertices.saturating_sub(mesh.vertices.len()) / NEW_VERTICES
}

/// Part of the square error whose leaves are divided in one round. No more than brings the error under the limit, if dividing
/// takes three quarters of a leaf's square error away; the last rounds then do not go past it.
fn part_to_divide(error: f64, limit: f64) -> f64 {
    let excess = 1.0 - (limit / error).powi(2);
    (excess / GAIN).clamp(LEAST_PER_ROUND, MOST_PER_ROUND)
}
