//! A flat convex polygon of a surface, with all that its pairs need.

use glam::DVec3;
use kernel::form_factor::PreparedPolygon;
use kernel::geometry::{Bounds, ConvexPolygon, PlaneId};

use super::quadrature::Quadrature;

/// Heights up to this, in frame units, count as in the plane: a few units in the last place of f32 coordinates.
pub const IN_PLANE: f64 = 3e-4;

/// One polygon of a surface.
pub struct Element {
    /// Index of the surface that it is a part of.
    pub surface: u32,
    /// Its outline.
    pub polygon: ConvexPolygon,
    /// Unit normal.
    pub normal: DVec3,
    /// Area, in squared frame units.
    pub area: f64,
    /// The polygon as seen from points.
    pub prepared: PreparedPolygon,
    /// The polygon as a place to integrate over.
    pub quadrature: Quadrature,
    /// Whether it is a rectangle along the axes: then its box is all of it.
    pub fills_box: bool,
}

impl Element {
    /// Prepares a polygon.
    #[must_use]
    pub fn new(surface: u32, polygon: ConvexPolygon) -> Self {
        let normal = polygon.normal();
        Self {
            surface,
            normal,
            area: polygon.area(),
            prepared: PreparedPolygon::new(&polygon),
            quadrature: Quadrature::with_rules(&polygon.corners),
            fills_box: fills_box(&polygon.corners, normal),
            polygon,
        }
    }

    /// Corners, counter-clockwise.
    #[must_use]
    pub fn corners(&self) -> &[DVec3] {
        &self.polygon.corners
    }

    /// Plane that the polygon lies in.
    #[must_use]
    pub fn plane(&self) -> PlaneId {
        self.polygon.plane
    }

    /// True where no point of another polygon lies before this one: by the number of the plane, or by more than rounding.
    #[must_use]
    pub fn is_behind(&self, other: &Self) -> bool {
        let origin = self.corners()[0];
        self.plane() == other.plane()
            || other.corners().iter().all(|corner| self.normal.dot(*corner - origin) <= IN_PLANE)
    }
}

fn fills_box(corners: &[DVec3], normal: DVec3) -> bool {
    let near = |a: f64, b: f64| (a - b).abs() <= IN_PLANE;
    let Bounds { low, high } = Bounds::around(corners);
    let on_box =
        |corner: &DVec3| (0..3).all(|axis| near(corner[axis], low[axis]) || near(corner[axis], high[axis]));
    normal.abs().max_element() > 1.0 - 1e-12 && corners.len() == 4 && corners.iter().all(on_box)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn element(corners: &[[f64; 3]]) -> Element {
        let corners = corners.iter().copied().map(DVec3::from_array).collect();
        Element::new(0, ConvexPolygon { plane: PlaneId(0), corners })
    }

    #[test]
    fn rectangles_along_the_axes_fill_their_boxes_and_nothing_else_does() {
        let square = [[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [2.0, 3.0, 1.0], [0.0, 3.0, 1.0]];
        assert!(element(&square).fills_box);
        let mut moved = square;
        moved[1][0] = 1.5;
        assert!(!element(&moved).fills_box);
        assert!(!element(&square[..3]).fills_box);
        let leaning = square.map(|[x, y, z]| [x, y, z + x]);
        assert!(!element(&leaning).fills_box);
    }
}
