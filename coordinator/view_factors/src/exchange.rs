//! The exchange area of two polygons that see each other whole: by a rule with a proven bound of its error where they are far
//! apart, exactly where they are near.

use std::borrow::Cow;
use std::f64::consts::PI;

use glam::DVec3;
use kernel::form_factor::{AreaPoint, area_points, between_areas, exchange_area};
use kernel::geometry::{Corners, area_vector, clip};
use smallvec::SmallVec;

use super::element::{Element, IN_PLANE};

/// Relative error up to which a rule may stand for the exact exchange area.
pub const RULE_ERROR: f64 = 1e-7;

/// Most nodes in each direction of a polygon.
const MOST_NODES: usize = 8;

/// Rules with up to this many nodes are kept with the polygon.
const KEPT_RULES: usize = 4;

/// Pairs of points from which on the exact sum over contours is cheaper.
const MOST_POINT_PAIRS: usize = 2500;

/// How far into the complex plane the kernel is bounded, relative to the distance of the polygons.
const REACH: f64 = 0.4;

/// A polygon as a place to integrate over.
pub struct Quadrature {
    normal: DVec3,
    area: f64,
    centre: DVec3,
    radius: f64,
    /// Half of the longest segment along which a parameter moves a point.
    half: f64,
    /// Mean of the largest and the smallest density of the parameters, relative to that of the whole, and half of their
    /// difference: 1 and 0 for a parallelogram.
    density: [f64; 2],
    corners: Corners,
    rules: Vec<Vec<AreaPoint>>,
}

impl Quadrature {
    /// Of a convex polygon.
    #[must_use]
    pub fn new(corners: &[DVec3]) -> Self {
        let whole = area_vector(corners);
        let area = whole.length();
        let centre = corners.iter().sum::<DVec3>() / corners.len() as f64;
        let radius = corners.iter().map(|corner| corner.distance(centre)).fold(0.0, f64::max);
        let end = corners.len() - 1;
        let (mut longest, mut density) = (0.0, [1.0_f64, 0.0_f64]);
        for first in (1..end).step_by(2) {
            let quad = [corners[0], corners[first], corners[first + 1], corners[(first + 2).min(end)]];
            let next = |i: usize| quad[(i + 1) % 4] - quad[i];
            let part = 0.5 * (quad[2] - quad[0]).cross(quad[3] - quad[1]).length();
            let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
            for corner in 0..4 {
                longest = f64::max(longest, next(corner).length());
                let here = next((corner + 3) % 4).cross(next(corner)).length() / part;
                (low, high) = (low.min(here), high.max(here));
            }
            density[0] = density[0].max(0.5 * (high + low));
            density[1] = density[1].max(0.5 * (high - low));
        }
        Self {
            normal: whole.normalize_or_zero(),
            area,
            centre,
            radius,
            half: 0.5 * longest,
            density,
            corners: corners.iter().copied().collect(),
            rules: vec![],
        }
    }

    /// Of a convex polygon that has many pairs.
    #[must_use]
    pub fn with_rules(corners: &[DVec3]) -> Self {
        let rules = (1..=KEPT_RULES).map(|nodes| area_points(corners, nodes)).collect();
        Self { rules, ..Self::new(corners) }
    }

    /// Nodes in each direction with which the integral over this polygon is off by no more than `wanted`, relative to that of
    /// 1 / (pi distance^2); `None` if that takes too many.
    ///
    /// A function that is analytic, and at most M, in the ellipse around an interval whose half axes add up to rho half lengths
    /// has Chebyshev coefficients of at most 2 M rho^-k. Gauss's rule with n nodes is exact up to degree 2n - 1 and misses the
    /// mean of every even polynomial beyond by 4/3 at most: together 8/3 M rho^(-2n) / (1 - rho^-2). A parameter moves the
    /// point by up to d = `REACH` times the distance r into the complex plane, if rho - 1/rho is 2 d / half length. There the
    /// kernel's scalar products are at most (r + d)^2 together, and the squared distance is at least (r - d)^2. Two parameters
    /// double the bound.
    fn nodes(&self, distance: f64, wanted: f64) -> Option<usize> {
        let lift = REACH * distance / self.half;
        let rho = lift + (lift * lift + 1.0).sqrt();
        let square = rho * rho;
        let kernel = (1.0 + REACH) * (1.0 + REACH) / ((1.0 - REACH) * (1.0 - REACH)).powi(2);
        let density = self.density[0] + self.density[1] * 0.5 * (rho + 1.0 / rho);
        let mut bound = 2.0 * (8.0 / 3.0) * kernel * density / (1.0 - 1.0 / square);
        for nodes in 1..=MOST_NODES {
            bound /= square;
            if bound <= wanted {
                return Some(nodes);
            }
        }
        None
    }

    fn points(&self, nodes: usize) -> Cow<'_, [AreaPoint]> {
        match self.rules.get(nodes - 1) {
            Some(points) => points.into(),
            None => area_points(&self.corners, nodes).into(),
        }
    }
}

/// An exchange area, in squared frame units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exchange {
    /// The area.
    pub area: f64,
    /// Bound of its error; 0 where only rounding is left.
    pub error: f64,
}

/// The exchange area of two polygons as if nothing stood between them.
#[must_use]
pub fn unoccluded(a: &Element, b: &Element) -> Exchange {
    let (of_a, of_b) = (part_in_front(b, a), part_in_front(a, b));
    let by_rule = match (&of_a, &of_b) {
        (Cow::Borrowed(_), Cow::Borrowed(_)) => by_rule(&a.quadrature, &b.quadrature),
        _ if of_a.is_empty() || of_b.is_empty() => return Exchange { area: 0.0, error: 0.0 },
        _ => by_rule(&Quadrature::new(&of_a), &Quadrature::new(&of_b)),
    };
    by_rule.unwrap_or_else(|| Exchange { area: exchange_area(&a.polygon, &b.polygon), error: 0.0 })
}

/// The part of a polygon that lies before the front of another; borrowed if that is all of it, empty if it is only rounding.
#[must_use]
pub fn part_in_front<'a>(front: &Element, polygon: &'a Element) -> Cow<'a, [DVec3]> {
    let origin = front.corners()[0];
    let heights: SmallVec<[f64; 8]> =
        polygon.corners().iter().map(|corner| front.normal.dot(*corner - origin)).collect();
    if heights.iter().all(|height| *height <= IN_PLANE) {
        return vec![].into();
    }
    if heights.iter().all(|height| *height >= -IN_PLANE) {
        return polygon.corners().into();
    }
    clip(polygon.corners(), &heights).into_vec().into()
}

/// `None` where the polygons are too near for it.
fn by_rule(a: &Quadrature, b: &Quadrature) -> Option<Exchange> {
    let offset = b.centre - a.centre;
    let squared = offset.length_squared();
    let distance = squared.sqrt() - a.radius - b.radius;
    if distance <= 0.0 || a.area <= 0.0 || b.area <= 0.0 {
        return None;
    }
    // The integral relative to that of 1 / (pi distance^2), at the two centres.
    let cosines = -a.normal.dot(offset) * b.normal.dot(offset) / squared;
    let share = cosines * distance * distance / squared;
    // Half for each polygon, and a third of it since the centres may overestimate.
    let wanted = RULE_ERROR / 6.0 * share;
    let (from, to) = (a.nodes(distance, wanted)?, b.nodes(distance, wanted)?);
    if (from * to).pow(2) > MOST_POINT_PAIRS {
        return None;
    }
    let area = between_areas(&a.points(from), a.normal, &b.points(to), b.normal);
    let bound = 2.0 * wanted * a.area * b.area / (PI * distance * distance);
    (bound <= RULE_ERROR * area).then_some(Exchange { area, error: bound })
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use kernel::geometry::{ConvexPolygon, PlaneId};
    use proptest::prelude::*;

    use super::*;

    fn element(plane: u32, corners: Vec<DVec3>) -> Element {
        Element::new(0, ConvexPolygon { plane: PlaneId(plane), corners })
    }

    fn point() -> impl Strategy<Value = DVec3> {
        [-1.0..1.0, -1.0..1.0, -1.0..1.0].prop_map(DVec3::from_array)
    }

    fn quadrilateral(skew: f64) -> Vec<DVec3> {
        [[-1.0, -1.0], [1.0, -1.0], [1.0 - skew, 1.0], [-1.0 + skew, 1.0]]
            .map(|[x, y]| DVec3::new(x, y, 0.0))
            .to_vec()
    }

    proptest! {
        /// The bound holds: for rectangles, trapezoids and nearly triangles, of different size and in every position.
        #[test]
        fn rules_keep_their_bound(
            axis in point(), angle in 0.0..6.0, way in point(), distance in 1.0..60.0, size in 0.05..3.0,
            skew in 0.0..0.99,
        ) {
            let turn = DQuat::from_axis_angle(axis.normalize_or(DVec3::X), angle);
            let centre = (way + DVec3::Z).normalize_or(DVec3::Z) * distance;
            let below = element(0, quadrilateral(0.0));
            let above: Vec<DVec3> =
                quadrilateral(skew).iter().map(|corner| turn * (*corner * size) + centre).collect();
            let above = element(1, above);
            let found = unoccluded(&below, &above);
            let exact = exchange_area(&below.polygon, &above.polygon);
            prop_assert!(found.error <= RULE_ERROR * found.area);
            let rounding = 1e-13 * exact + 1e-15 * size * size;
            prop_assert!((found.area - exact).abs() <= found.error + rounding, "{found:?} {exact:e}");
        }
    }

    #[test]
    fn distant_pairs_take_the_rule_and_near_ones_do_not() {
        let below = element(0, quadrilateral(0.0));
        let lifted = |height: f64| {
            let corners = quadrilateral(0.0).iter().rev().map(|corner| *corner + DVec3::Z * height).collect();
            element(1, corners)
        };
        assert!(unoccluded(&below, &lifted(30.0)).error > 0.0);
        assert_eq!(unoccluded(&below, &lifted(1.0)).error, 0.0);
        assert!(unoccluded(&below, &lifted(1.0)).area > 0.1);
        assert_eq!(unoccluded(&below, &lifted(-1.0)).area, 0.0);
    }
}
