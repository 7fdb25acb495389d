//! Segments through the tree, on every kind of processor, against each triangle by itself in f64.

use glam::DVec3;
use proptest::prelude::*;
use pulp::WithSimd;

use super::{Blocking, Occluder};
use crate::geometry::{ConvexPolygon, PlaneId};
use crate::triangles::{Fan, crosses};

/// Not the plane of any polygon here.
const ELSEWHERE: [PlaneId; 2] = [PlaneId::NONE; 2];

/// One answer, whatever computes it.
fn blocks(occluder: &Occluder, from: DVec3, to: DVec3, planes: [PlaneId; 2]) -> bool {
    let blocked = occluder.blocks(from, to, planes);
    let portable = occluder.segment([&from, &(to - from)], planes, None).with_simd(pulp::Scalar);
    let others = occluder.polygons.iter().filter(|polygon| !planes.contains(&polygon.plane));
    let one_by_one = others
        .flat_map(|polygon| (0..polygon.triangle_count()).map(|place| polygon.triangle(place)))
        .any(|corners| crosses(corners, from, to - from, occluder.clearance));
    assert_eq!(blocked, one_by_one, "{from} to {to}");
    assert_eq!(portable.is_some(), one_by_one, "{from} to {to}, lane by lane");
    blocked
}

fn polygon(plane: u32, corners: &[DVec3]) -> ConvexPolygon {
    ConvexPolygon { plane: PlaneId(plane), corners: corners.to_vec() }
}

/// A wavy sheet of `count` x `count` triangulated squares around the origin; heights are not round numbers.
fn sheet(count: i32, size: f64, offset: DVec3) -> (Occluder, Vec<DVec3>) {
    let corner = |x: i32, y: i32| {
        let (x, y) = (f64::from(x) / f64::from(count) - 0.5, f64::from(y) / f64::from(count) - 0.5);
        offset + DVec3::new(x, y, 0.1 * (7.0 * x).sin() * (5.0 * y).cos()) * size
    };
    let squares = (0..count).flat_map(|x| (0..count).map(move |y| (x, y)));
    let polygons: Vec<ConvexPolygon> = squares
        .flat_map(|(x, y)| {
            let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
            let plane = 2 * (x * count + y) as u32;
            [polygon(plane, &[a, b, c]), polygon(plane + 1, &[a, c, d])]
        })
        .collect();
    let inner = (1..count).flat_map(|x| (1..count).map(move |y| (x, y)));
    (Occluder::new(&polygons), inner.map(|(x, y)| corner(x, y)).collect())
}

#[test]
fn nothing_passes_through_edges_and_corners() {
    for offset in [DVec3::ZERO, DVec3::new(310.7, -1021.3, 77.1)] {
        let (occluder, corners) = sheet(24, 700.0, offset);
        let lamp = offset + DVec3::new(31.3, -17.7, 900.1);
        for pair in corners.windows(2) {
            for part in [0.0, 0.37, 0.5] {
                let target = pair[0].lerp(pair[1], part);
                assert!(blocks(&occluder, lamp, lamp + (target - lamp) * 2.0, ELSEWHERE), "{target}");
            }
        }
    }
}

#[test]
fn boxes_do_not_lose_what_is_far_away_from_them() {
    // The sheet is small and its boxes are padded by its own size: the ray's rounding is a matter of where it comes from.
    let (occluder, corners) = sheet(16, 0.01, DVec3::ZERO);
    for corner in corners {
        let from = DVec3::new(613.1, 401.7, 999.3);
        assert!(blocks(&occluder, from, from + (corner - from) * 1.5, ELSEWHERE), "{corner}");
    }
}

#[test]
fn planes_of_both_ends_do_not_block() {
    let square = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
    let occluder = Occluder::new(&[polygon(3, &square)]);
    let (from, to) = (DVec3::new(0.3, 0.4, -1.0), DVec3::new(0.3, 0.4, 1.0));
    assert!(blocks(&occluder, from, to, ELSEWHERE));
    assert!(!blocks(&occluder, from, to, [PlaneId(3), PlaneId(0)]));
    assert!(!blocks(&occluder, from, to, [PlaneId(0), PlaneId(3)]));
}

#[test]
fn segments_along_an_axis_and_within_a_box_side_find_what_they_cross() {
    let (occluder, corners) = sheet(8, 8.0, DVec3::ZERO);
    for corner in corners {
        for shift in [DVec3::ZERO, DVec3::X * 0.3, DVec3::Y * 0.3] {
            let (from, to) = (corner + shift + DVec3::Z * 5.0, corner + shift - DVec3::Z * 5.0);
            assert!(blocks(&occluder, from, to, ELSEWHERE), "{corner}");
        }
    }
}

fn point(reach: f64) -> impl Strategy<Value = DVec3> {
    (-reach..reach, -reach..reach, -reach..reach).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

/// Small and large triangles, slivers among them.
fn triangles() -> impl Strategy<Value = Vec<[DVec3; 3]>> {
    let triangle = (point(1000.0), point(1.0), point(1.0), 0.01..500.0_f64, 0.0..1.0_f64);
    let corners =
        triangle.prop_map(|(at, b, c, size, width)| [at, at + b * size, at + c * (size * width.powi(6))]);
    prop::collection::vec(corners, 1..120)
}

proptest! {
    #[test]
    fn segments_meet_what_they_meet_one_by_one(
        triangles in triangles(), ends in prop::collection::vec((point(1200.0), point(1200.0)), 1..40)
    ) {
        let polygons: Vec<ConvexPolygon> =
            triangles.iter().enumerate().map(|(index, corners)| polygon(index as u32, corners)).collect();
        let occluder = Occluder::new(&polygons);
        let mut blocking = Blocking::default();
        for (from, to) in ends {
            let blocked = blocks(&occluder, from, to, ELSEWHERE);
            prop_assert_eq!(occluder.blocks_again(from, to, ELSEWHERE, &mut blocking), blocked);
            // Now by what blocked it.
            prop_assert_eq!(occluder.blocks_again(from, to, ELSEWHERE, &mut blocking), blocked);
            // Through corners and middles of edges, up to a triangle and beyond.
            for [a, b, _] in &triangles {
                for (through, part) in [(*a, 1.0), (*a, 1.5), ((*a + *b) * 0.5, 1.5)] {
                    let (to, planes) = (from + (through - from) * part, [PlaneId(0), PlaneId(1)]);
                    let blocked = blocks(&occluder, from, to, planes);
                    prop_assert_eq!(occluder.blocks_again(from, to, planes, &mut blocking), blocked);
                }
            }
        }
    }
}
