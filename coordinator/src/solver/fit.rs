//! Vertex values that fit best, rather than ones that are exact at the vertices.
//!
//! Over a patch where light is curved, interpolation between exact values lies on one side of the truth all over: in the
//! concave light of a room it is too dark everywhere, and by the same error energy is lost. The piecewise linear function
//! with the least square error crosses the truth instead; where curvature is constant its values differ from the exact ones
//! by h^2/12 u'' and its error is sqrt(6) times smaller. The curvature is known: dividing a patch revealed it.

use glam::DVec3;

use super::refinement::{Revealed, revealed_errors};
use crate::mesh::{Mesh, PatchId};

/// Part of the error revealed at a patch's centre by which its children's vertices are off the best fit. An edge of length 2h
/// shows h^2/2 u'' at its middle, and the fit asks for h^2/12 u''.
const FIT: f64 = 1.0 / 6.0;

/// The values of the best fit, from the exact ones (irradiance per vertex).
#[must_use]
pub fn best_fit(mesh: &Mesh, exact: &[DVec3]) -> Vec<DVec3> {
    let curvature: Vec<Option<DVec3>> = (0..mesh.patches.len() as u32)
        .map(PatchId)
        .map(|id| mesh.patch(id).first_child.map(|_| mean_curvature(&revealed_errors(mesh, id, exact))))
        .collect();
    let mut sums = vec![(DVec3::ZERO, 0.0); exact.len()];
    for (_, patch) in mesh.leaves() {
        let Some(parent) = patch.parent else { continue };
        let own = curvature[parent.index()].unwrap_or_default();
        // A shadow line shows the same jump on every level, where smooth light shows a quarter: trust the smaller.
        let coarse = mesh.patch(parent).parent.and_then(|grandparent| curvature[grandparent.index()]);
        let smooth = coarse.map_or(own * 0.25, |coarse| minmod(own, coarse * 0.25));
        for corner in &patch.corners {
            sums[corner.index()].0 += smooth * patch.area;
            sums[corner.index()].1 += patch.area;
        }
    }
    let fit = |(exact, (shift, area)): (&DVec3, (DVec3, f64))| {
        let fitted = if area > 0.0 { *exact + shift * (FIT / area) } else { *exact };
        // The fit, and the extrapolated means that shares shoot, can fall a hair below 0 where light jumps.
        fitted.max(DVec3::ZERO)
    };
    exact.iter().zip(sums).map(fit).collect()
}

/// The error at the centre of a patch, estimated in both ways that it shows.
fn mean_curvature(revealed: &Revealed) -> DVec3 {
    let from_edges = revealed.middles.iter().sum::<DVec3>() * (2.0 / revealed.middles.len() as f64);
    (from_edges + revealed.centre) * 0.5
}

fn minmod(a: DVec3, b: DVec3) -> DVec3 {
    let smaller = DVec3::select(a.abs().cmplt(b.abs()), a, b);
    DVec3::select((a * b).cmpgt(DVec3::ZERO), smaller, DVec3::ZERO)
}
