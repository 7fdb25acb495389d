//! Which neighbouring triangles may share a facet.
//!
//! A half-edge is an edge as one triangle sees it: number 3 t + i leads from corner i of triangle t to the next.

use crate::import::primitives::VertexAttributes;
use crate::import::triangles::{Triangle, TriangleMesh};

/// Marks a half-edge without a twin.
pub(super) const NONE: u32 = u32::MAX;

/// Cosine of the angle between triangles above which they can be flat together. Planarity itself is decided by distances
/// from a common plane; this only keeps triangles that are smaller than those distances from being folded.
const LEAST_COSINE: f64 = 0.5;

/// How far an attribute may be from the affine continuation of the neighbour's.
const ATTRIBUTE_TOLERANCE: f64 = 1e-4;

/// The other half of every half-edge, or [`NONE`] at borders and where more than two triangles meet. Triangles
/// thinner than the tolerance are ignored where others meet: three points on a line, bent by rounding, would split a wall.
pub(super) fn twins(mesh: &TriangleMesh, tolerance: f64) -> Vec<u32> {
    let leaving = Leaving::new(mesh);
    let is_thin = |half: u32| split(mesh, half).0.height(&mesh.points) <= tolerance;
    let twin = |half: u32| {
        let (start, end) = ends(mesh, half);
        // Only halves that are alone between their ends have a twin.
        if leaving.alone(start, end, is_thin) == half { leaving.alone(end, start, is_thin) } else { NONE }
    };
    (0..3 * mesh.triangles.len() as u32).map(twin).collect()
}

/// Half-edges by the point where they start: next to each other, where a hash map over all of them would miss every cache.
struct Leaving {
    /// Where those of each point begin, and of one point more.
    first: Vec<u32>,
    /// Where each ends, and which it is; those of one point ascending.
    halves: Vec<(u32, u32)>,
}

impl Leaving {
    fn new(mesh: &TriangleMesh) -> Self {
        let all = || (0..3 * mesh.triangles.len() as u32).map(|half| (half, ends(mesh, half)));
        let mut first = vec![0; mesh.points.len() + 1];
        for (_, (start, _)) in all() {
            first[start as usize + 1] += 1;
        }
        for point in 1..first.len() {
            first[point] += first[point - 1];
        }
        let mut next = first.clone();
        let mut halves = vec![(0, 0); 3 * mesh.triangles.len()];
        for (half, (start, end)) in all() {
            halves[next[start as usize] as usize] = (end, half);
            next[start as usize] += 1;
        }
        for ends in first.windows(2) {
            halves[ends[0] as usize..ends[1] as usize].sort_unstable();
        }
        Self { first, halves }
    }

    /// The only half-edge from one point to another, or the only one of them that does not belong to a thin triangle; [`NONE`] where
    /// there is no such.
    fn alone(&self, start: u32, end: u32, is_thin: impl Fn(u32) -> bool) -> u32 {
        let start = start as usize;
        let around = &self.halves[self.first[start] as usize..self.first[start + 1] as usize];
        let at = around.partition_point(|(other, _)| *other < end);
        let count = around[at..].iter().take_while(|(other, _)| *other == end).count();
        let halves = around[at..at + count].iter().map(|(_, half)| *half);
        let mut counting = halves.filter(|half| count == 1 || !is_thin(*half));
        match (counting.next(), counting.next()) {
            (Some(half), None) => half,
            _ => NONE,
        }
    }
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
