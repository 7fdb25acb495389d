use glam::DVec3;

use super::PlaneId;

/// A flat convex polygon, counter-clockwise seen from the side it is lit from. Corners may lie on the straight line
/// between their neighbours (T-vertices do).
#[derive(Debug, Clone, PartialEq)]
pub struct ConvexPolygon {
    /// Plane that the polygon lies in.
    pub plane: PlaneId,
    /// Three corners or more.
    pub corners: Vec<DVec3>,
}

impl ConvexPolygon {
    /// Area vector: along the normal, as long as the area is large. Exact for planar polygons, concave ones too.
    #[must_use]
    pub fn area_vector(&self) -> DVec3 {
        area_vector(&self.corners)
    }

    /// Area.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.area_vector().length()
    }

    /// Unit normal; zero for a polygon without area.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        self.area_vector().normalize_or_zero()
    }

    /// Mean of the corners: the centre of gravity that subdivision uses.
    #[must_use]
    pub fn corner_mean(&self) -> DVec3 {
        self.corners.iter().sum::<DVec3>() / self.corners.len() as f64
    }
}

/// Area vector of a polygon given by its corners. Differences to the first corner keep it exact far from the origin.
pub fn area_vector(corners: &[DVec3]) -> DVec3 {
    let Some((&origin, rest)) = corners.split_first() else { return DVec3::ZERO };
    rest.windows(2).map(|pair| (pair[0] - origin).cross(pair[1] - origin)).sum::<DVec3>() * 0.5
}

/// Maps the unit square to a convex polygon of three corners or more, uniformly: `x` chooses a triangle of the fan by area
/// and is used again in it.
#[must_use]
pub fn uniform_point(corners: &[DVec3], x: f64, y: f64) -> DVec3 {
    let origin = corners[0];
    let doubled = |pair: &[DVec3]| (pair[0] - origin).cross(pair[1] - origin).length();
    let total: f64 = corners[1..].windows(2).map(doubled).sum();
    let mut left = x * total;
    let mut chosen = (&corners[1..3], 0.0);
    for pair in corners[1..].windows(2) {
        let area = doubled(pair);
        chosen = (pair, (left / area).clamp(0.0, 1.0));
        if left < area {
            break;
        }
        left -= area;
    }
    let (pair, x) = chosen;
    let root = x.sqrt();
    origin * (1.0 - root) + pair[0] * (root * (1.0 - y)) + pair[1] * (root * y)
}
