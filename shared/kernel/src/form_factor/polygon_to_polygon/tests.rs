//! Identities that hold for polygons in any position; known values are in the suite of the workspace.

use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec2, DVec3};
use proptest::prelude::*;

use super::*;
use crate::form_factor::point_to_polygon;
use crate::geometry::PlaneId;

fn polygon(plane: u32, corners: &[DVec3]) -> ConvexPolygon {
    ConvexPolygon { plane: PlaneId(plane), corners: corners.to_vec() }
}

fn point() -> impl Strategy<Value = DVec3> {
    [-1.0..1.0, -1.0..1.0, -1.0..1.0].prop_map(DVec3::from_array)
}

/// A rotation.
fn turn() -> impl Strategy<Value = DMat3> {
    (point(), 0.0..6.0).prop_map(|(axis, angle)| {
        DMat3::from_quat(DQuat::from_axis_angle(axis.normalize_or(DVec3::X), angle))
    })
}

/// A regular polygon of radius 1 in the plane z = 0, lit from above.
fn regular(corners: u32) -> Vec<DVec3> {
    let corner = |i: u32| DVec3::from((DVec2::from_angle(TAU * f64::from(i) / f64::from(corners)), 0.0));
    (0..corners).map(corner).collect()
}

fn relative(found: f64, expected: f64) -> f64 {
    (found / expected - 1.0).abs()
}

/// A prism over a regular polygon, sheared so that nothing in it is at a right angle: its faces lit inside, the floor first.
fn sheared_prism(corners: u32, shear: DVec3) -> Vec<ConvexPolygon> {
    let floor = regular(corners);
    let up = DVec3::Z + shear * 0.5;
    let ceiling: Vec<DVec3> = floor.iter().rev().map(|corner| *corner + up).collect();
    let mut faces = vec![polygon(0, &floor), polygon(1, &ceiling)];
    for (i, &from) in floor.iter().enumerate() {
        let to = floor[(i + 1) % floor.len()];
        faces.push(polygon(2 + i as u32, &[to, from, from + up, to + up]));
    }
    faces
}

proptest! {
    /// The faces of a convex body fill each other's view: all of them share edges or corners, at all angles.
    #[test]
    fn convex_bodies_close(corners in 3_u32..7, shear in point(), turn in turn()) {
        let faces: Vec<ConvexPolygon> = sheared_prism(corners, shear)
            .into_iter()
            .map(|face| polygon(face.plane.0, &face.corners.iter().map(|corner| turn * *corner).collect::<Vec<_>>()))
            .collect();
        for face in &faces {
            let sum: f64 = faces.iter().map(|other| polygon_to_polygon(face, other)).sum();
            prop_assert!((sum - 1.0).abs() < 1e-13, "sum {sum}");
        }
    }

    /// A part of a polygon sends what the rest does not, whichever way of integration the parts get.
    #[test]
    fn parts_add_up(turn in turn(), centre in point(), distance in 0.0..8.0, place in 0.05..0.95) {
        let below = polygon(0, &regular(4));
        let offset = centre + DVec3::Z * distance;
        let above: Vec<DVec3> = regular(4).iter().map(|corner| turn * *corner * 0.7 + offset).collect();
        let [a, b, c, d] = above[..] else { panic!("four corners") };
        let (from, to) = (a.lerp(b, place), d.lerp(c, place));
        let whole = exchange_area(&below, &polygon(1, &above));
        let parts = exchange_area(&below, &polygon(1, &[a, from, to, d]))
            + exchange_area(&below, &polygon(1, &[from, b, c, to]));
        prop_assert!((whole - parts).abs() <= 1e-14 + 1e-13 * whole, "{whole} {parts}");
    }

    /// What leaves one for the other is what the other would send back.
    #[test]
    fn both_ways_are_the_same(corners in 3_u32..7, turn in turn(), centre in point(), size in 0.01..2.0) {
        let below = polygon(0, &regular(5));
        let above: Vec<DVec3> =
            regular(corners).iter().map(|corner| turn * *corner * size + centre * 3.0).collect();
        let above = polygon(1, &above);
        let (there, back) = (exchange_area(&below, &above), exchange_area(&above, &below));
        prop_assert!((there - back).abs() <= 1e-14 * there.max(size), "{there} {back}");
    }

    /// The factor is the mean of those of the polygon's points, here of pairs whose contour sums cancel little. Neither reaches
    /// behind the other, so that the points' factors are smooth and Gauss's rule exact.
    #[test]
    fn the_mean_over_points(axis in point(), angle in -0.4..0.4, centre in point()) {
        let below = polygon(0, &regular(4));
        let tilt = DQuat::from_axis_angle(axis.normalize_or(DVec3::X), angle);
        let above: Vec<DVec3> =
            regular(3).iter().rev().map(|corner| tilt * *corner + centre + DVec3::Z * 3.0).collect();
        let points = areas::points(&below.corners, gauss::MAX_NODES);
        let seen = |point: DVec3| point_to_polygon(point, DVec3::Z, &above);
        let mean = points.iter().map(|(point, area)| area * seen(*point)).sum::<f64>() / below.area();
        prop_assert!(mean > 0.01);
        let found = polygon_to_polygon(&below, &polygon(1, &above));
        prop_assert!(relative(found, mean) <= 1e-13, "{found} {mean}");
    }

    /// Scaling by a power of two changes no bit.
    #[test]
    fn scale_changes_no_bit(centre in point(), exponent in -20_i32..20) {
        let scale = 2.0_f64.powi(exponent);
        let above: Vec<DVec3> = regular(5).iter().rev().map(|corner| *corner + centre + DVec3::Z * 1.5).collect();
        let scaled = |corners: &[DVec3]| corners.iter().map(|corner| *corner * scale).collect::<Vec<_>>();
        let found = polygon_to_polygon(&polygon(0, &regular(4)), &polygon(1, &above));
        let other = polygon_to_polygon(&polygon(0, &scaled(&regular(4))), &polygon(1, &scaled(&above)));
        prop_assert_eq!(found, other);
    }
}

/// A wall that reaches through the floor counts as far as it stands above it, and the floor as far as it lies before the wall.
#[test]
fn only_what_is_in_front_counts() {
    let floor = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]].map(DVec3::from_array);
    let wall = |low: f64| {
        [[0.0, 0.0, low], [0.0, 1.0, low], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]].map(DVec3::from_array)
    };
    let whole = exchange_area(&polygon(0, &floor), &polygon(1, &wall(0.0)));
    let through = exchange_area(&polygon(0, &floor), &polygon(1, &wall(-1.0)));
    assert!(relative(through, whole) < 1e-15);
    let behind = floor.map(|corner| DVec3::new(2.0 * corner.x - 1.0, corner.y, corner.z));
    assert!(relative(exchange_area(&polygon(0, &behind), &polygon(1, &wall(-1.0))), whole) < 1e-15);
}

#[test]
fn what_cannot_be_seen_is_zero() {
    let square = regular(4);
    let lifted = |height: f64| square.iter().map(|corner| *corner + DVec3::Z * height).collect::<Vec<_>>();
    let below = polygon(0, &square);
    assert_eq!(polygon_to_polygon(&below, &polygon(0, &lifted(0.1))), 0.0, "one plane by number");
    assert_eq!(polygon_to_polygon(&below, &polygon(1, &lifted(0.0))), 0.0, "one plane by place");
    assert_eq!(polygon_to_polygon(&below, &polygon(1, &lifted(1.0))), 0.0, "the back of the other");
    assert_eq!(polygon_to_polygon(&below, &polygon(1, &lifted(-1.0))), 0.0, "under the horizon");
    let line = [DVec3::ZERO, DVec3::X, DVec3::X * 2.0];
    let facing: Vec<DVec3> = lifted(1.0).into_iter().rev().collect();
    assert_eq!(polygon_to_polygon(&polygon(2, &line), &polygon(1, &facing)), 0.0, "no area");
    assert_eq!(polygon_to_polygon(&polygon(1, &facing), &polygon(2, &line)), 0.0, "no area");
    assert!(polygon_to_polygon(&below, &polygon(1, &facing)) > 0.1, "and this one can be seen");
}
