use glam::DVec3;
use kernel::geometry::area_vector;

use super::triangulation::triangulate_leaf;
use super::{Mesh, PatchId, VertexId};

/// Three vertices and their weights in a linear interpolation.
pub type Interpolation = [(VertexId, f64); 3];

impl Mesh {
    /// The leaf of a patch that holds a point of it.
    #[must_use]
    pub fn leaf_at(&self, patch: PatchId, position: DVec3) -> PatchId {
        let mut id = patch;
        // The child that the point is deepest inside of, whatever rounding did to the point.
        while let Some(child) = self
            .children(id)
            .map(|child| (child, self.depth_inside(child, position)))
            .reduce(|a, b| if b.1 > a.1 { b } else { a })
        {
            id = child.0;
        }
        id
    }

    /// Least height of a point over the edges of a patch, in its plane; negative outside.
    fn depth_inside(&self, id: PatchId, position: DVec3) -> f64 {
        let corners: Vec<DVec3> =
            self.patch(id).corners.iter().map(|corner| self.position(*corner)).collect();
        let normal = area_vector(&corners).normalize_or_zero();
        let next = corners.iter().cycle().skip(1);
        let height = |(a, b): (&DVec3, &DVec3)| {
            let along = (*b - *a).normalize_or_zero();
            normal.cross(along).dot(position - *a)
        };
        corners.iter().zip(next).map(height).fold(f64::INFINITY, f64::min)
    }
}

/// How the triangles of a leaf, as [`super::triangulate`] chooses them, interpolate at a point of it.
#[must_use]
pub fn interpolation(
    mesh: &Mesh,
    leaf: PatchId,
    position: DVec3,
    value: impl Fn(VertexId) -> DVec3,
) -> Interpolation {
    let weighted = |corners: [VertexId; 3]| {
        let weights = barycentric(corners.map(|corner| mesh.position(corner)), position);
        [0, 1, 2].map(|i| (corners[i], weights[i]))
    };
    let least = |interpolation: &Interpolation| {
        interpolation.iter().map(|(_, weight)| *weight).fold(f64::INFINITY, f64::min)
    };
    let whole = mesh.patch(leaf).corners[0];
    triangulate_leaf(mesh, leaf, &value)
        .into_iter()
        .map(weighted)
        .reduce(|a, b| if least(&b) > least(&a) { b } else { a })
        .unwrap_or([(whole, 1.0), (whole, 0.0), (whole, 0.0)])
}

/// Barycentric coordinates of a point in the plane of a triangle with area.
fn barycentric([a, b, c]: [DVec3; 3], point: DVec3) -> [f64; 3] {
    let normal = (b - a).cross(c - a);
    let part = |from: DVec3, to: DVec3| (to - from).cross(point - from).dot(normal) / normal.length_squared();
    [part(b, c), part(c, a), part(a, b)]
}
