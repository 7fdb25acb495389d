//! The least-squares fit of vertex values, instead of values exact at the vertices.
//!
//! Where light is curved, interpolation between exact values lies on one side of the truth: in the concave light of a room it
//! is too dark everywhere, and loses energy. The piecewise linear function of least square error crosses the truth instead; for
//! constant curvature its values differ from the exact ones by h^2/12 u'' and its error is sqrt(6) times smaller. Dividing a
//! patch revealed the curvature.

use glam::DVec3;
use rayon::prelude::*;

use super::revealed::{Revealed, RevealedErrors};
use crate::mesh::{Mesh, Patch, PatchId};

/// Part of the error revealed at a patch's centre by which its children's vertices are off the best fit. An edge of length 2h
/// shows h^2/2 u'' at its middle, and the fit asks for h^2/12 u''.
const FIT: f64 = 1.0 / 6.0;

/// Part of its value that the fit leaves to a vertex: black specks beside spots of sun are seen, the error between is not.
const LEAST_LEFT: f64 = 0.5;

/// Fits values, given the exact ones (irradiance per vertex) and what was revealed of them.
#[must_use]
pub fn best_fit(mesh: &Mesh, exact: &[DVec3], revealed: &RevealedErrors) -> Vec<DVec3> {
    let curvatures = curvatures(mesh, revealed);
    let shifts = shifts(mesh, exact.len(), &curvatures, &curvatures);
    // Extrapolated means that shares shoot can fall a hair below 0.
    let fitted = |(exact, shift): (&DVec3, DVec3)| (*exact + shift * allowed(*exact, shift)).max(DVec3::ZERO);
    exact.iter().zip(shifts).map(fitted).collect()
}

/// Fits a part of the light with the choices made for the whole, of which this was revealed: parts that sum to the whole still do. A
/// part can fall a hair below 0 where light jumps.
#[must_use]
pub fn best_fit_of_part(
    mesh: &Mesh,
    whole: &[DVec3],
    revealed: &RevealedErrors,
    part: &[DVec3],
) -> Vec<DVec3> {
    let of_whole = curvatures(mesh, revealed);
    let whole_shifts = shifts(mesh, whole.len(), &of_whole, &of_whole);
    let shifts = shifts(mesh, part.len(), &of_whole, &curvatures(mesh, &RevealedErrors::new(mesh, part)));
    let fitted = |(((whole, whole_shift), part), shift): (((&DVec3, DVec3), &DVec3), DVec3)| {
        let fitted = *part + shift * allowed(*whole, whole_shift);
        DVec3::select(whole.cmplt(DVec3::ZERO), DVec3::ZERO, fitted)
    };
    whole.iter().zip(whole_shifts).zip(part).zip(shifts).map(fitted).collect()
}

/// The part of a shift that is made, by channel: in the shade beside a bright light, where light jumps, the fit would fall below 0.
fn allowed(exact: DVec3, shift: DVec3) -> DVec3 {
    let deepest = exact.max(DVec3::ZERO) * (1.0 - LEAST_LEFT);
    let part = |deepest: f64, shift: f64| if shift < -deepest { deepest / -shift } else { 1.0 };
    DVec3::new(part(deepest.x, shift.x), part(deepest.y, shift.y), part(deepest.z, shift.z))
}

/// Curvature of each patch that was divided.
fn curvatures(mesh: &Mesh, revealed: &RevealedErrors) -> Vec<Option<DVec3>> {
    let divided = |index: u32| revealed.of(PatchId(index)).map(mean_curvature);
    (0..mesh.patches.len() as u32).into_par_iter().with_min_len(1024).map(divided).collect()
}

/// By how much the fit differs from exact values: by their curvature on the level where that of the whole light is smaller.
fn shifts(mesh: &Mesh, count: usize, whole: &[Option<DVec3>], own: &[Option<DVec3>]) -> Vec<DVec3> {
    let at = |of: &[Option<DVec3>], id: PatchId| of[id.index()].unwrap_or_default();
    let smooth = |patch: &Patch| {
        let parent = patch.parent.filter(|_| patch.first_child.is_none())?;
        // A shadow line shows the same jump on every level, where smooth light shows a quarter: trust the smaller.
        let grandparent = mesh.patch(parent).parent.filter(|id| whole[id.index()].is_some());
        let Some(grandparent) = grandparent else { return Some(at(own, parent) * 0.25) };
        let [fine, coarse] = smaller(at(whole, parent), at(whole, grandparent) * 0.25);
        Some(at(own, parent) * fine + at(own, grandparent) * 0.25 * coarse)
    };
    let smooth: Vec<Option<DVec3>> = mesh.patches.par_iter().with_min_len(1024).map(smooth).collect();
    let mut sums = vec![(DVec3::ZERO, 0.0); count];
    for (patch, smooth) in mesh.patches.iter().zip(smooth) {
        let Some(smooth) = smooth else { continue };
        for corner in &patch.corners {
            sums[corner.index()].0 += smooth * patch.area;
            sums[corner.index()].1 += patch.area;
        }
    }
    let mean = |(shift, area): (DVec3, f64)| if area > 0.0 { shift * (FIT / area) } else { DVec3::ZERO };
    sums.into_iter().map(mean).collect()
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
