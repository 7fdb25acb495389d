//! The least-squares fit of vertex values, instead of values exact at the vertices.
//!
//! Where light is curved, interpolation between exact values lies on one side of the truth: in the concave light of a room it
//! is too dark everywhere, and loses energy. The piecewise linear function of least square error crosses the truth instead; for
//! constant curvature its values differ from the exact ones by h^2/12 u'' and its error is sqrt(6) times smaller. Dividing a
//! patch revealed the curvature.

use glam::DVec3;
use rayon::prelude::*;

use super::prediction::{Revealed, revealed_errors};
use crate::mesh::{Mesh, PatchId};

/// Part of the error revealed at a patch's centre by which its children's vertices are off the best fit. An edge of length 2h
/// shows h^2/2 u'' at its middle, and the fit asks for h^2/12 u''.
const FIT: f64 = 1.0 / 6.0;

/// Fits values, given the exact ones (irradiance per vertex).
#[must_use]
pub fn best_fit(mesh: &Mesh, exact: &[DVec3]) -> Vec<DVec3> {
    let curvatures = curvatures(mesh, exact);
    // The fit, and the extrapolated means that shares shoot, can fall a hair below 0 where light jumps.
    fit(mesh, exact, &curvatures, &curvatures).into_iter().map(|fitted| fitted.max(DVec3::ZERO)).collect()
}

/// Fits a part of the light with the choices made for the whole: parts that sum to the whole still do.
///
/// A part can fall a hair below 0 where light jumps; where the whole would, all parts are 0.
#[must_use]
pub fn best_fit_of_part(mesh: &Mesh, whole: &[DVec3], part: &[DVec3]) -> Vec<DVec3> {
    let of_whole = curvatures(mesh, whole);
    let whole = fit(mesh, whole, &of_whole, &of_whole);
    let part = fit(mesh, part, &of_whole, &curvatures(mesh, part));
    let kept = |(part, whole): (DVec3, DVec3)| DVec3::select(whole.cmple(DVec3::ZERO), DVec3::ZERO, part);
    part.into_iter().zip(whole).map(kept).collect()
}

/// Curvature of each patch that was divided.
fn curvatures(mesh: &Mesh, exact: &[DVec3]) -> Vec<Option<DVec3>> {
    let divided =
        |id: PatchId| mesh.patch(id).first_child.map(|_| mean_curvature(&revealed_errors(mesh, id, exact)));
    (0..mesh.patches.len() as u32).into_par_iter().with_min_len(1024).map(PatchId).map(divided).collect()
}

/// Moves exact values by their curvature on the level where that of the whole light is smaller.
fn fit(mesh: &Mesh, exact: &[DVec3], whole: &[Option<DVec3>], own: &[Option<DVec3>]) -> Vec<DVec3> {
    let mut sums = vec![(DVec3::ZERO, 0.0); exact.len()];
    for (_, patch) in mesh.leaves() {
        let Some(parent) = patch.parent else { continue };
        let at = |of: &[Option<DVec3>], id: PatchId| of[id.index()].unwrap_or_default();
        // A shadow line shows the same jump on every level, where smooth light shows a quarter: trust the smaller.
        let grandparent = mesh.patch(parent).parent.filter(|id| whole[id.index()].is_some());
        let smooth = match grandparent {
            None => at(own, parent) * 0.25,
            Some(grandparent) => {
                let [fine, coarse] = smaller(at(whole, parent), at(whole, grandparent) * 0.25);
                at(own, parent) * fine + at(own, grandparent) * 0.25 * coarse
            }
        };
        for corner in &patch.corners {
            sums[corner.index()].0 += smooth * patch.area;
            sums[corner.index()].1 += patch.area;
        }
    }
    let shifted = |(exact, (shift, area)): (&DVec3, (DVec3, f64))| {
        if area > 0.0 { *exact + shift * (FIT / area) } else { *exact }
    };
    exact.iter().zip(sums).map(shifted).collect()
}

/// The error at the centre of a patch: mean of the estimates from its edges and its centre.
fn mean_curvature(revealed: &Revealed) -> DVec3 {
    let from_edges = revealed.middles.iter().sum::<DVec3>() * (2.0 / revealed.middles.len() as f64);
    (from_edges + revealed.centre) * 0.5
}

/// 1 for the smaller of two values and 0 for the other, by channel; 0 for both where their signs differ.
fn smaller(a: DVec3, b: DVec3) -> [DVec3; 2] {
    let alike = (a * b).cmpgt(DVec3::ZERO);
    let is_first = a.abs().cmplt(b.abs());
    [is_first, !is_first].map(|chosen| DVec3::select(alike & chosen, DVec3::ONE, DVec3::ZERO))
}
