//! From triangles to flat convex facets.
//!
//! Refinement starts from facets, so a wall should be one of them however its file is triangulated: the fewer and rounder
//! they are, the fewer vertices an accurate solution takes.
//!
//! | module | step |
//! |---|---|
//! | [`joint`] | which neighbouring triangles may share a facet |
//! | [`merge`] | removes edges between them as long as the union stays convex |
//! | [`outline`] | leaves out corners that became straight, and gives normals |

mod joint;
mod merge;
mod outline;

use rayon::prelude::*;

use self::merge::Merger;
use super::primitives::VertexAttributes;
use super::triangles::TriangleMesh;
use crate::facet::{Corner, Facet, SourceTriangle};

/// Distance in roundings of the file's coordinates that a point may have from a plane or line that it is meant to lie on.
const FLATNESS: f64 = 4.0;

/// The facets of a mesh, seen from its front, in the order of their first triangles. Planes are not assigned yet.
pub(super) fn build(mesh: &TriangleMesh, attributes: &VertexAttributes) -> Vec<Facet> {
    let outlines = Merger::new(mesh, FLATNESS * mesh.rounding).run(attributes);
    let mut is_corner = vec![false; mesh.points.len()];
    for corner in outlines.iter().flat_map(|outline| &outline.corners) {
        is_corner[corner.point(mesh) as usize] |= !corner.straight || corner.smooth_normal(mesh).is_some();
    }
    outlines.par_iter().map(|outline| outline.facet(mesh, &is_corner)).collect()
}

/// A facet seen from the other side of a `doubleSided` primitive.
pub(super) fn turn(facet: &Facet) -> Facet {
    let turn_corner = |corner: &Corner| Corner { position: corner.position, normal: -corner.normal };
    let turn_triangle = |triangle: &SourceTriangle| {
        let ([a, b, c], [p, q, r]) = (triangle.vertices, triangle.positions);
        SourceTriangle { vertices: [a, c, b], positions: [p, r, q] }
    };
    Facet {
        plane: facet.plane,
        normal: -facet.normal,
        corners: facet.corners.iter().rev().map(turn_corner).collect(),
        triangles: facet.triangles.iter().map(turn_triangle).collect(),
        is_sealed: false,
    }
}
