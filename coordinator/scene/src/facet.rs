//! Flat convex pieces of surfaces, with the triangles of the input that they join.

use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId, area_vector};
use smallvec::SmallVec;

/// Relative difference up to which areas are the same.
const SAME_AREA: f64 = 1e-9;

/// A flat convex piece of a surface: one triangle, or several coplanar ones joined.
#[derive(Debug, Clone)]
pub struct Facet {
    /// Plane that it lies in.
    pub plane: PlaneId,
    /// Unit normal on the lit side.
    pub normal: DVec3,
    /// Counter-clockwise seen from the lit side.
    pub corners: Vec<Corner>,
    /// The input's triangles that it joins, in the facet's winding. The exporter interpolates vertex attributes in them.
    pub triangles: Vec<SourceTriangle>,
    /// Whether its lit side is the inside of a closed body without light: it stays dark, and nothing is computed for it.
    pub is_sealed: bool,
}

impl Facet {
    /// Positions of the corners.
    pub fn positions(&self) -> impl ExactSizeIterator<Item = DVec3> + Clone {
        self.corners.iter().map(|corner| corner.position)
    }

    /// The input's triangles, by positions; a fan where the facet is a piece of them.
    #[must_use]
    pub fn positions_of_triangles(&self) -> Vec<[DVec3; 3]> {
        let area = |corners: &[DVec3]| area_vector(corners).length();
        let corners: SmallVec<[DVec3; 8]> = self.positions().collect();
        let (whole, of_triangles) =
            (area(&corners), self.triangles.iter().map(|triangle| area(&triangle.positions)).sum::<f64>());
        if (of_triangles - whole).abs() <= SAME_AREA * whole {
            return self.triangles.iter().map(|triangle| triangle.positions).collect();
        }
        (2..corners.len()).map(|third| [corners[0], corners[third - 1], corners[third]]).collect()
    }

    /// The facet as a polygon of the kernel.
    #[must_use]
    pub fn polygon(&self) -> ConvexPolygon {
        ConvexPolygon { plane: self.plane, corners: self.positions().collect() }
    }
}

/// A corner of a facet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// Position in the frame.
    pub position: DVec3,
    /// Unit normal: the file's smooth normal, or the facet's.
    pub normal: DVec3,
}

/// A triangle of the input, in the winding of its facet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SourceTriangle {
    /// Indices into the primitive's vertex attributes.
    pub vertices: [u32; 3],
    /// Positions in the frame.
    pub positions: [DVec3; 3],
}
