//! Which neighbouring triangles may share a facet.
//!
//! A half-edge is an edge as one triangle sees it: number 3 t + i leads from corner i of triangle t to the next.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use foldhash::fast::RandomState;

use crate::import::primitives::VertexAttributes;
use crate::import::triangles::{Triangle, TriangleMesh};

/// Marks a half-edge without a twin.
pub(super) const NONE: u32 = u32::MAX;

/// Cosine of the angle between triangles above which they can be flat together. Planarity itself is decided by distances
/// from a common plane; this only keeps triangles that are smaller than those distances from being folded.
const LEAST_COSINE: f64 = 0.5;

/// How far an attribute may be from the affine continuation of the neighbour's.
const ATTRIBUTE_TOLERANCE: f64 = 1e-4;

/// The other half of every half-edge, or [`NONE`] at borders and where more than two triangles meet.
pub(super) fn twins(mesh: &TriangleMesh) -> Vec<u32> {
    let count = 3 * mesh.triangles.len();
    let mut by_ends: HashMap<u64, u32, RandomState> =
        HashMap::with_capacity_and_hasher(count, RandomState::default());
    for half in 0..count as u32 {
        match by_ends.entry(key(ends(mesh, half))) {
            Entry::Occupied(mut entry) => {
                entry.insert(NONE);
            }
            Entry::Vacant(entry) => {
                entry.insert(half);
            }
        }
    }
    let mut twins = vec![NONE; count];
    for half in 0..count as u32 {
        let (start, end) = ends(mesh, half);
        // Each pair is found once, and only halves that are alone between their ends have a twin.
        if start > end || by_ends[&key((start, end))] != half {
            continue;
        }
        let twin = by_ends.get(&key((end, start))).copied().unwrap_or(NONE);
        if twin != NONE {
            (twins[half as usize], twins[twin as usize]) = (twin, half);
        }
    }
    twins
}

fn key((start, end): (u32, u32)) -> u64 {
    u64::from(start) << 32 | u64::from(end)
}

/// Points where a half-edge starts and ends.
fn ends(mesh: &TriangleMesh, half: u32) -> (u32, u32) {
    let (triangle, corner) = split(mesh, half);
    (triangle.points[corner], triangle.points[(corner + 1) % 3])
}

fn split(mesh: &TriangleMesh, half: u32) -> (&Triangle, usize) {
    (&mesh.triangles[half as usize / 3], half as usize % 3)
}

/// Whether nothing is lost by removing the edge between two triangles: neither a fold, nor shading, nor a seam or a kink of
/// the attributes, which the exporter interpolates.
pub(super) fn may_join(mesh: &TriangleMesh, attributes: &VertexAttributes, half: u32, twin: u32) -> bool {
    let ((a, _), (b, _)) = (split(mesh, half), split(mesh, twin));
    let cosine = a.area_vector.normalize().dot(b.area_vector.normalize());
    if cosine < LEAST_COSINE || !is_flat_along(mesh, half) || !is_flat_along(mesh, twin) {
        return false;
    }
    // The larger triangle tells more about the smaller one than the other way round.
    if a.area_vector.length_squared() >= b.area_vector.length_squared() {
        continues(mesh, attributes, half, twin)
    } else {
        continues(mesh, attributes, twin, half)
    }
}

fn is_flat_along(mesh: &TriangleMesh, half: u32) -> bool {
    let (triangle, corner) = split(mesh, half);
    triangle.smooth_normals[corner].is_none() && triangle.smooth_normals[(corner + 1) % 3].is_none()
}

/// Whether the attributes of the second triangle are the affine continuation of the first one's.
fn continues(mesh: &TriangleMesh, attributes: &VertexAttributes, first: u32, second: u32) -> bool {
    let ((known, i), (other, j)) = (split(mesh, first), split(mesh, second));
    let [start, end, apex] = [i, (i + 1) % 3, (i + 2) % 3];
    let values = |triangle: &Triangle, corner: usize| attributes.of(triangle.vertices[corner]);
    let (at_start, at_end, at_apex) = (values(known, start), values(known, end), values(known, apex));

    let same = |a: &[f32], b: &[f32]| {
        a.iter().zip(b).all(|(&a, &b)| f64::from((a - b).abs()) <= ATTRIBUTE_TOLERANCE)
    };
    if !same(at_start, values(other, (j + 1) % 3)) || !same(at_end, values(other, j)) {
        return false;
    }

    // Barycentric coordinates of the other apex in the known triangle.
    let point = |triangle: &Triangle, corner: usize| mesh.points[triangle.points[corner] as usize];
    let (p, q, r) = (point(known, start), point(known, end), point(known, apex));
    let target = point(other, (j + 2) % 3);
    let area_vector = known.area_vector;
    let weight = |a: glam::DVec3, b: glam::DVec3| {
        (a - target).cross(b - target).dot(area_vector) / (2.0 * area_vector.length_squared())
    };
    let weights = [weight(q, r), weight(r, p), weight(p, q)];
    let continued = |k: usize| {
        weights[0] * f64::from(at_start[k])
            + weights[1] * f64::from(at_end[k])
            + weights[2] * f64::from(at_apex[k])
    };
    let at_target = values(other, (j + 2) % 3);
    (0..at_target.len()).all(|k| (continued(k) - f64::from(at_target[k])).abs() <= ATTRIBUTE_TOLERANCE)
}
