//! The exchange area of two polygons that see each other whole: by a rule with a proven bound of its error where they are far
//! apart, exactly where they are near.

use std::borrow::Cow;
use std::f64::consts::PI;

use glam::DVec3;
use kernel::form_factor::{between_areas, exchange_area};
use kernel::geometry::clip;
use smallvec::SmallVec;

use super::element::{Element, IN_PLANE};
use super::quadrature::Quadrature;

/// Relative error up to which a rule may stand for the exact exchange area.
pub const RULE_ERROR: f64 = 1e-7;

/// Pairs of points from which on the exact sum over contours is cheaper.
const MOST_POINT_PAIRS: usize = 2500;

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
