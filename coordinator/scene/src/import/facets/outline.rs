//! Outlines of merged polygons, and the facets that they become.

use glam::DVec3;
use kernel::geometry::PlaneId;

use crate::facet::{Corner, Facet, SourceTriangle};
use crate::import::triangles::TriangleMesh;

/// Plane of facets that have not been given theirs yet.
const UNASSIGNED: PlaneId = PlaneId(u32::MAX);

/// A polygon as the merger leaves it.
pub(super) struct Outline {
    /// Corners, straight ones included, counter-clockwise.
    pub(super) corners: Vec<OutlineCorner>,
    /// Triangles that it joins, ascending.
    pub(super) triangles: Vec<u32>,
    /// Sum of their area vectors.
    pub(super) area_vector: DVec3,
}

/// A corner of a polygon: the corner of a triangle of it.
pub(super) struct OutlineCorner {
    /// Index of the triangle.
    pub(super) triangle: u32,
    /// Which of its corners.
    pub(super) corner: usize,
    /// Whether it lies on the line between the real corners around it.
    pub(super) straight: bool,
}

impl Outline {
    /// As a facet, without a plane yet. A straight corner is left out where no facet has a real corner at its point
    /// (`is_corner`); elsewhere it is a T-vertex and stays.
    pub(super) fn facet(&self, mesh: &TriangleMesh, is_corner: &[bool]) -> Facet {
        let normal = self.area_vector.normalize();
        let corner = |corner: &OutlineCorner| Corner {
            position: mesh.points[corner.point(mesh) as usize],
            normal: corner.smooth_normal(mesh).unwrap_or(normal),
        };
        let stays = |corner: &&OutlineCorner| is_corner[corner.point(mesh) as usize];
        let triangles = self.triangles.iter().map(|&triangle| {
            let triangle = &mesh.triangles[triangle as usize];
            SourceTriangle {
                vertices: triangle.vertices,
                positions: triangle.points.map(|point| mesh.points[point as usize]),
            }
        });
        Facet {
            plane: UNASSIGNED,
            normal,
            corners: self.corners.iter().filter(stays).map(corner).collect(),
            triangles: triangles.collect(),
            is_sealed: false,
        }
    }
}

impl OutlineCorner {
    /// Index of its point.
    pub(super) fn point(&self, mesh: &TriangleMesh) -> u32 {
        mesh.triangles[self.triangle as usize].points[self.corner]
    }

    /// Its normal in the file where that deviates from its triangle's.
    pub(super) fn smooth_normal(&self, mesh: &TriangleMesh) -> Option<DVec3> {
        mesh.triangles[self.triangle as usize].smooth_normals[self.corner]
    }
}
