//! The mesh of the output: no more vertices than its light needs, and no T-junctions but those of many slivers in one line.
//!
//! The mesh of the bake is divided where light was uncertain, facet by facet. Here its triangles are first made *conforming*: where
//! a vertex of any surface lies inside the open edge of another triangle, that triangle is split at the same position. Then vertices
//! are collapsed into a neighbour while the light on the surface stays within a limit, in all triangles at once that meet at a
//! position, so that the mesh stays conforming. The surface itself does not change: a vertex moves within its plane only, or along a
//! straight edge.
//!
//! | file | what it does |
//! |---|---|
//! | `working` | the triangles with what lies around them |
//! | `join` | joins both sides of contact lines with the same light |
//! | `conform` | vertices at one position; splits at T-junctions |
//! | `grid`, `split` | what lies on an edge; triangles split there |
//! | `slivers` | pieces that are no more than a line |
//! | `linear` | light that is linear over a triangle, and samples of it |
//! | `limits` | how far light may deviate |
//! | `collapse` | which vertices can go |
//! | `simplify` | collapses and flips, in rounds |
//! | `fit` | values of the vertices that are left |
//! | `flip` | diagonals that follow the light |
//! | `assemble` | the lit mesh of what is left |
//! | `own_triangles` | the input's own triangles where their corners suffice |
//! | `sealed` | the dark insides of closed bodies |
//! | `covered` | what is shown where touching surfaces cover each other |

mod assemble;
mod collapse;
mod conform;
mod covered;
mod fit;
mod flip;
mod grid;
mod join;
mod limits;
mod linear;
mod own_triangles;
mod sealed;
mod simplify;
mod slivers;
mod split;
mod working;

use crate::error_budget::{ErrorBudget, INTERPOLATED_NOISE, without};
use crate::lit::LitMesh;
use fit::Fit;
use glam::DVec3;
use limits::Limits;
use scene::Scene;
pub use sealed::add_sealed;
use working::Working;

/// Least interpolation error that the difference is a part of: a hundredth of a per cent is then allowed where light is even.
const LEAST_ERROR: f64 = 4e-4;

/// Part of the estimated interpolation error that simplification may add, in quadrature: it then grows by 3 %.
const PART_OF_ERROR: f64 = 0.25;

/// Makes the output of a lit mesh whose relative L2 error is estimated to be `error`; without one it is conforming only. Vertices are
/// chosen by `LitMesh::vertices`' irradiance; layers and unshot radiosity follow.
///
/// Returns the relative L2 difference too.
#[must_use]
pub fn output_mesh(scene: &Scene, lit: LitMesh, error: Option<&ErrorBudget>) -> (LitMesh, f64) {
    let (lit, difference) = of_lit_facets(scene, lit, error);
    let mut lit = sealed::add_conforming(scene, lit);
    lit.covered = covered::covered(scene, &lit);
    (lit, difference)
}

/// The output of what the bake has light of.
fn of_lit_facets(scene: &Scene, lit: LitMesh, error: Option<&ErrorBudget>) -> (LitMesh, f64) {
    let mut working = Working::new(scene, &lit);
    let allowed = PART_OF_ERROR * error.map_or(0.0, |error| error.receivers.max(LEAST_ERROR));
    // Between the vertices it evens out in part.
    let between = error.map_or(0.0, |error| error.visibility);
    let noise = between / INTERPOLATED_NOISE.sqrt();
    let Some(mut limits) = Limits::new(&working, allowed, noise) else {
        conform::conform(&mut working);
        return (working.into_lit(scene, lit, None), 0.0);
    };
    let irradiance: Vec<DVec3> = lit.vertices.iter().map(|vertex| vertex.irradiance).collect();
    loop {
        join::join(&mut working, &limits);
        conform::conform(&mut working);
        limits.sample(&mut working);
        simplify::simplify(&mut working);
        let fit = Fit::new(&working, &limits, &irradiance);
        working.take(&fit.irradiance);
        // Noise that is no longer there is no error.
        let difference = without(limits.difference(&working), between);
        if difference <= allowed || !limits.tighten(difference) {
            own_triangles::restore(&mut working, scene);
            return (working.into_lit(scene, lit, Some(&fit)), difference);
        }
        working = Working::new(scene, &lit);
    }
}
