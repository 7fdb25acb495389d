use glam::DVec3;
use rayon::prelude::*;

use super::{Mesh, Patch, PatchId, VertexId};
use crate::lit::LitTriangle;

/// The leaves of each surface as triangles. A leaf with a finer neighbour takes the neighbour's vertices into its outline, so
/// there are no cracks and no jumps. Of all ways to triangulate an outline the one is chosen whose inner edges join vertices
/// with the most similar `value`: edges then run along shadow lines rather than across them.
#[must_use]
pub fn triangulate(
    mesh: &Mesh,
    surfaces: usize,
    value: impl Fn(VertexId) -> DVec3 + Sync,
) -> Vec<Vec<LitTriangle>> {
    let mut triangles = vec![vec![]; surfaces];
    let of_leaf = |(id, patch)| (patch, triangulate_leaf(mesh, id, &value));
    let all: Vec<(&Patch, Vec<[VertexId; 3]>)> = mesh.par_leaves().map(of_leaf).collect();
    for (&Patch { surface, facet, .. }, own) in all {
        let of_vertices =
            |corners: [VertexId; 3]| LitTriangle { facet, vertices: corners.map(|corner| corner.0) };
        triangles[surface as usize].extend(own.into_iter().map(of_vertices));
    }
    triangles
}

/// The triangles of one leaf.
pub(super) fn triangulate_leaf(
    mesh: &Mesh,
    id: PatchId,
    value: &impl Fn(VertexId) -> DVec3,
) -> Vec<[VertexId; 3]> {
    let outline = outline(mesh, id);
    let triangles = triangulate_outline(mesh, &outline, value);
    triangles.into_iter().map(|corners| corners.map(|corner| outline[corner])).collect()
}

/// Corners of a leaf with the vertices that finer neighbours have on its edges.
fn outline(mesh: &Mesh, id: PatchId) -> Vec<VertexId> {
    let mut outline = vec![];
    for (from, to) in mesh.edges(id) {
        outline.push(from);
        outline.extend(mesh.middle_of(from, to));
    }
    outline
}

/// Least-cost triangulation of a convex outline by dynamic programming over its diagonals. Triangles without area are not
/// allowed.
fn triangulate_outline(
    mesh: &Mesh,
    outline: &[VertexId],
    value: &impl Fn(VertexId) -> DVec3,
) -> Vec<[usize; 3]> {
    let count = outline.len();
    let positions: Vec<DVec3> = outline.iter().map(|id| mesh.position(*id)).collect();
    let values: Vec<DVec3> = outline.iter().map(|id| value(*id)).collect();
    let size = positions.iter().map(|p| p.distance_squared(positions[0])).fold(0.0, f64::max);
    let flat = |a: usize, b: usize, c: usize| {
        let area = (positions[b] - positions[a]).cross(positions[c] - positions[a]).length();
        area <= 1e-9 * size
    };
    let diagonal_cost = |a: usize, b: usize| {
        if b - a == 1 || (a == 0 && b == count - 1) { 0.0 } else { values[a].distance_squared(values[b]) }
    };
    if count == 3 {
        return if flat(0, 1, 2) { vec![] } else { vec![[0, 1, 2]] };
    }
    let mut best = vec![vec![(0.0, 0); count]; count];
    for span in 2..count {
        for from in 0..count - span {
            let to = from + span;
            best[from][to] = (from + 1..to)
                .map(|apex| {
                    // A flat triangle costs so much that it is taken only where nothing else is possible.
                    let shape = if flat(from, apex, to) { 1e30 } else { 0.0 };
                    let inner = diagonal_cost(from, apex) + diagonal_cost(apex, to);
                    (shape + inner + best[from][apex].0 + best[apex][to].0, apex)
                })
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .unwrap_or((0.0, from));
        }
    }
    let mut triangles = vec![];
    let mut todo = vec![(0, count - 1)];
    while let Some((from, to)) = todo.pop() {
        if to - from >= 2 {
            let apex = best[from][to].1;
            if !flat(from, apex, to) {
                triangles.push([from, apex, to]);
            }
            todo.extend([(from, apex), (apex, to)]);
        }
    }
    triangles
}
