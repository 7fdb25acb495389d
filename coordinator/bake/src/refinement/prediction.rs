//! Predicts the interpolation error of each leaf.
//!
//! Dividing a patch reveals its error: the solution at the new vertices minus the interpolated values. The error of a leaf is
//! predicted from that of its parent and the decay since its grandparent. Steep but linear light has none. A leaf that was never
//! divided may be dim at all of its corners, and bright between them.

use foldhash::{HashMap, HashMapExt};
use glam::DVec3;
use kernel::geometry::Bounds;
use rayon::prelude::*;

use super::cap::{Cap, parts_of_both};
use super::revealed::RevealedErrors;
use crate::mesh::{Mesh, Patch, PatchId};

/// Decay of the square error per division: 16 where light is smooth, next to none across a shadow line.
const DECAY: std::ops::RangeInclusive<f64> = 1.0 / 16.0..=0.75;

/// Least reflectance by which errors are weighted: a viewer shows the irradiance of a black metal times its base colour.
pub const LEAST_WEIGHT: f64 = 0.05;

/// Decay taken where only one level is known.
const FIRST_DECAY: f64 = 0.25;

/// Least error of a leaf that was never divided, relative to the light at its corners, where no middles tell of it.
const UNKNOWN: f64 = 0.2;

/// Errors show relative to the light at their place, but to no less than this part of the root mean square of the radiosity.
const DARK: f64 = 0.02;

/// Predicted interpolation error of a mesh.
pub struct MeshError {
    /// Per leaf: predicted square error, integrated over its area, under the cap where the whole error is more so.
    leaves: Vec<(PatchId, f64)>,
    /// Per leaf: the same without a cap, relative to the light of the leaf.
    contrasts: Vec<f64>,
    /// Per leaf: see [`Self::parts`].
    parts: Vec<(PatchId, f64)>,
    /// See [`Self::relative`].
    relative: f64,
    /// Area of the mesh.
    area: f64,
}

/// How errors of leaves are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measure {
    /// By the square error, integrated over the area.
    Error,
    /// By the same relative to the light of the leaf.
    Contrast,
}

/// A leaf with what is summed over the mesh.
struct Leaf {
    id: PatchId,
    /// Predicted square error, integrated over the area.
    error: f64,
    /// Mean square of the radiosity.
    square: f64,
    area: f64,
}

/// Predicted errors under a cap.
struct Errors {
    /// Per leaf: square error, integrated over its area.
    squares: Vec<f64>,
    /// Square of the radiosity, integrated over the mesh.
    norm: f64,
    /// Root of all square errors over it.
    relative: f64,
}

impl Errors {
    /// Those of leaves, which are these places.
    fn under(leaves: &[Leaf], places: &[(f64, f64)], cap: Cap) -> Self {
        let squares: Vec<f64> = leaves.iter().map(|leaf| leaf.error * cap.part(leaf.square)).collect();
        let norm = cap.norm(places);
        let relative = if norm > 0.0 { (squares.iter().sum::<f64>() / norm).sqrt() } else { 0.0 };
        Self { squares, norm, relative }
    }
}

impl MeshError {
    /// Predicts the error of `irradiance` (one value per vertex) on the mesh, as radiosity: weighted by the reflectance of
    /// each surface. `revealed` is of the same irradiance, and `found` are errors of the radiosity measured inside leaves, where
    /// vertices may have missed something. Flat leaves longer than `unknown` that were never divided are
    /// not known.
    #[must_use]
    pub fn predict(
        mesh: &Mesh,
        irradiance: &[DVec3],
        reflectance: &[DVec3],
        revealed: &RevealedErrors,
        found: &[(PatchId, DVec3)],
        unknown: f64,
    ) -> Self {
        let mut measured: HashMap<PatchId, f64> = HashMap::new();
        for (leaf, error) in found {
            let largest = measured.entry(*leaf).or_default();
            *largest = largest.max(error.length_squared());
        }
        let of_leaf = |(id, patch): (PatchId, &Patch)| {
            let weight = reflectance[patch.surface as usize].max(DVec3::splat(LEAST_WEIGHT));
            let corners = patch.corners.iter().map(|corner| weight * irradiance[corner.index()]);
            let square = corners.clone().map(DVec3::length_squared).sum::<f64>() / patch.corners.len() as f64;
            let error = match patch.parent {
                Some(parent) => {
                    let own = child_error(mesh, parent, id, revealed, weight);
                    let grandparent = mesh.patch(parent).parent;
                    let before = grandparent.map(|g| child_error(mesh, g, parent, revealed, weight));
                    let decay = before.map_or(FIRST_DECAY, |before| {
                        if before > 0.0 {
                            (own / before).clamp(*DECAY.start(), *DECAY.end())
                        } else {
                            *DECAY.end()
                        }
                    });
                    own * decay
                }
                None => {
                    let is_unknown = mesh.size(id) > unknown && !is_smooth(mesh, patch);
                    let least = if is_unknown { UNKNOWN * UNKNOWN * square } else { 0.0 };
                    (spread(corners) / 16.0).max(least)
                }
            };
            let error = error.max(measured.get(&id).copied().unwrap_or(0.0));
            Leaf { id, error: error * patch.area, square, area: patch.area }
        };
        let leaves: Vec<Leaf> = mesh.par_leaves().map(of_leaf).collect();
        let area: f64 = leaves.iter().map(|leaf| leaf.area).sum();
        let places: Vec<(f64, f64)> = leaves.iter().map(|leaf| (leaf.square, leaf.area)).collect();
        let caps = [Cap::NONE, Cap::over(places.clone())];
        let [all, capped] = caps.map(|cap| Errors::under(&leaves, &places, cap));
        let dark = DARK * DARK * all.norm / area;
        let contrast = |leaf: &Leaf| {
            let light = leaf.square.max(dark);
            if light > 0.0 { leaf.error / light } else { 0.0 }
        };
        let ids = || leaves.iter().map(|leaf| leaf.id);
        let parts = ids().zip(parts_of_both(&all.squares, &capped.squares)).collect();
        let contrasts = leaves.iter().map(contrast).collect();
        let larger = if capped.relative > all.relative { capped } else { all };
        let Errors { squares, relative, .. } = larger;
        Self { leaves: ids().zip(squares).collect(), contrasts, parts, relative, area }
    }

    /// Root mean square over the area of the error relative to the light at its place. In a dark corner an error shows that is
    /// nothing beside the light of the room.
    #[must_use]
    pub fn contrast(&self) -> f64 {
        let total: f64 = self.contrasts.iter().sum();
        if self.area > 0.0 { (total / self.area).sqrt() } else { 0.0 }
    }

    /// How often to draw samples in each leaf: its part of the predicted square error, plus its part of that under the cap.
    #[must_use]
    pub fn parts(&self) -> &[(PatchId, f64)] {
        &self.parts
    }

    /// Relative L2 error of the radiosity, or that under the cap, where it is more.
    #[must_use]
    pub fn relative(&self) -> f64 {
        self.relative
    }

    /// The leaves that hold this part of the error, the worst first, at most `limit` of them.
    #[must_use]
    pub fn worst_leaves(
        &self,
        measure: Measure,
        part: f64,
        limit: usize,
        may_divide: impl Fn(PatchId) -> bool + Sync,
    ) -> Vec<PatchId> {
        let shown = |(leaf, contrast): (&(PatchId, f64), &f64)| match measure {
            Measure::Error => *leaf,
            Measure::Contrast => (leaf.0, *contrast),
        };
        let leaves = self.leaves.par_iter().zip(&self.contrasts).with_min_len(1024).map(shown);
        let mut leaves: Vec<_> = leaves.filter(|leaf| leaf.1 > 0.0 && may_divide(leaf.0)).collect();
        leaves.par_sort_unstable_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        let total: f64 = leaves.iter().map(|leaf| leaf.1).sum();
        let mut held = 0.0;
        leaves
            .into_iter()
            .take_while(|leaf| {
                let wanted = held < part * total;
                held += leaf.1;
                wanted
            })
            .take(limit)
            .map(|leaf| leaf.0)
            .collect()
    }
}

/// Mean square of the errors that dividing `parent` revealed at the vertices of one of its children.
fn child_error(
    mesh: &Mesh,
    parent: PatchId,
    child: PatchId,
    revealed: &RevealedErrors,
    weight: DVec3,
) -> f64 {
    let Some(revealed) = revealed.of(parent) else { return 0.0 };
    let position = mesh.children(parent).position(|candidate| candidate == child).unwrap_or(0);
    let count = revealed.middles.len();
    let errors =
        [revealed.middles[position], revealed.centre, revealed.middles[(position + count - 1) % count]];
    errors.iter().map(|error| (weight * *error).length_squared()).sum::<f64>() / 3.0
}

/// Whether a patch has smooth normals. Small ones are made for the look of curved things, which they follow as they are.
fn is_smooth(mesh: &Mesh, patch: &Patch) -> bool {
    patch.corners.iter().any(|corner| mesh.vertices[corner.index()].smooth)
}

/// Largest square difference between values.
fn spread(values: impl Iterator<Item = DVec3>) -> f64 {
    Bounds::around(values).extent().length_squared()
}
