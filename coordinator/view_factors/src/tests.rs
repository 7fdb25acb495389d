//! Culling against random segments: what it calls hidden or free must be so for all of them.

use glam::{DQuat, DVec3};
use kernel::geometry::{Bounds, ConvexPolygon, PlaneId, uniform_point};
use proptest::prelude::*;

use super::element::Element;
use super::shaft::{Between, Blocker, box_corners};
use super::tree::Tree;

fn point(reach: f64) -> impl Strategy<Value = DVec3> {
    [-reach..reach, -reach..reach, -reach..reach].prop_map(DVec3::from_array)
}

fn turn() -> impl Strategy<Value = DQuat> {
    (point(1.0), 0.0..6.0)
        .prop_map(|(axis, angle)| DQuat::from_axis_angle(axis.normalize_or(DVec3::X), angle))
}

fn rectangle(size: [f64; 2], turn: DQuat, centre: DVec3) -> Vec<DVec3> {
    let corner = |x: f64, y: f64| turn * DVec3::new(x * size[0], y * size[1], 0.0) + centre;
    vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]
}

fn convex(plane: u32, corners: Vec<DVec3>) -> ConvexPolygon {
    ConvexPolygon { plane: PlaneId(plane), corners }
}

/// Whether a segment crosses a rectangle.
fn crosses(from: DVec3, to: DVec3, rectangle: &[DVec3]) -> bool {
    let (u, v) = (rectangle[1] - rectangle[0], rectangle[3] - rectangle[0]);
    let normal = u.cross(v);
    let (before, behind) = (normal.dot(from - rectangle[0]), normal.dot(to - rectangle[0]));
    let offset = from.lerp(to, before / (before - behind)) - rectangle[0];
    let (x, y) = (offset.dot(u) / u.length_squared(), offset.dot(v) / v.length_squared());
    before * behind < 0.0 && (0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&y)
}

/// Segments between two convex polygons, 256 of them.
fn segments<'a>(from: &'a [DVec3], to: &'a [DVec3]) -> impl Iterator<Item = (DVec3, DVec3)> + 'a {
    (0..256).map(move |index| {
        let [a, b, c, d] = sobol_burley::sample_4d(index, 0, 7).map(f64::from);
        (uniform_point(from, a, b), uniform_point(to, c, d))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// What is hidden is hidden along every segment; what the shaft does not hold is met by none, with or without the tighter
    /// planes.
    #[test]
    fn culling_is_conservative(
        turns in [turn(), turn(), turn()], sizes in [[5.0..40.0, 5.0..40.0], [5.0..40.0, 5.0..40.0]],
        wall in [10.0..400.0, 10.0..400.0], offset in point(60.0), place in point(60.0), distance in 60.0..300.0,
    ) {
        let from = rectangle(sizes[0], turns[0], place);
        let to = rectangle(sizes[1], turns[1], DVec3::X * distance + offset);
        let wall = rectangle(wall, turns[2], DVec3::X * distance * 0.5);
        let blocker = Blocker::new(&convex(2, wall.clone()));
        let boxes = [Bounds::around(&from), Bounds::around(&to)];
        let mut shaft = Between::new(boxes, [Some(PlaneId(0)), Some(PlaneId(1))]);
        let loose = shaft.may_hold(&blocker);
        shaft.tighten(&from, &to);
        let tight = shaft.may_hold(&blocker);
        prop_assert!(loose || !tight);
        let boxes = boxes.map(box_corners);
        let hides_boxes = blocker.hides(&boxes[0], &boxes[1], [false; 2]);
        let hides = blocker.hides(&from, &to, [true; 2]);
        prop_assert!(hides || !hides_boxes);
        for (a, b) in segments(&from, &to) {
            let met = crosses(a, b, &wall);
            prop_assert!(met || !hides, "a segment gets past");
            prop_assert!(tight || !met, "a segment is blocked");
        }
    }
}

/// All of it hidden, half of it, none of it; touching is hiding where no element lies in the plane.
#[test]
fn walls_hide_what_is_behind_them() {
    let square = |half: f64, x: f64, z: f64| rectangle([half, half], DQuat::IDENTITY, DVec3::new(x, 0.0, z));
    let wall = Blocker::new(&convex(0, square(10.0, 0.0, 0.0)));
    let (near, far) = (square(5.0, 0.0, 20.0), square(5.0, 0.0, -20.0));
    assert!(wall.hides(&near, &far, [false; 2]));
    assert!(wall.hides(&far, &near, [false; 2]));
    assert!(!wall.hides(&near, &square(5.0, 20.0, -20.0), [true; 2]), "some segments pass beside it");
    assert!(!wall.hides(&near, &square(5.0, 0.0, 40.0), [true; 2]), "both on one side");
    let standing: Vec<DVec3> =
        near.iter().map(|corner| DVec3::new(corner.x, corner.z - 15.0, corner.y + 5.0)).collect();
    assert!(wall.hides(&standing, &far, [true; 2]));
    assert!(!wall.hides(&standing, &far, [false; 2]));
    assert!(!wall.hides(&square(5.0, 0.0, 0.0), &far, [true; 2]), "in its plane");
}

/// Boxes have every corner once, flat ones too.
#[test]
fn boxes_have_their_corners() {
    let corners = |low, high| box_corners(Bounds { low, high });
    assert_eq!(corners(DVec3::ZERO, DVec3::ONE).len(), 8);
    assert_eq!(corners(DVec3::ZERO, DVec3::new(1.0, 0.0, 2.0)).len(), 4);
    assert_eq!(corners(DVec3::ONE, DVec3::ONE).as_slice(), [DVec3::ONE]);
}

/// The halves of every cluster hold its elements, and a cluster that is behind another has no element that sees it.
#[test]
fn clusters_hold_their_elements() {
    let elements: Vec<Element> = (0..60)
        .map(|index: u32| {
            let [x, y, z, angle] = sobol_burley::sample_4d(index, 0, 3).map(f64::from);
            let turn = DQuat::from_axis_angle(DVec3::new(z, x, y).normalize(), angle * 6.0);
            let centre = DVec3::new(x, y, z) * 500.0;
            Element::new(index, convex(index, rectangle([10.0, 20.0], turn, centre)))
        })
        .collect();
    let tree = Tree::new(&elements);
    assert_eq!(tree.clusters.len(), 2 * elements.len() - 1);
    let mut sorted = tree.order.clone();
    sorted.sort_unstable();
    assert!(sorted.into_iter().eq(0..60));
    let members = |index: usize| {
        tree.order[tree.clusters[index].elements.clone()].iter().map(|i| &elements[*i as usize])
    };
    let mut behind = 0;
    for (a, cluster) in tree.clusters.iter().enumerate() {
        if let Some([first, second]) = cluster.halves {
            let [first, second] = [first, second].map(|half| tree.clusters[half].elements.clone());
            assert_eq!(
                (first.start, first.end, second.end),
                (cluster.elements.start, second.start, cluster.elements.end)
            );
        }
        for (b, other) in tree.clusters.iter().enumerate() {
            if cluster.is_behind(other) {
                behind += 1;
                assert!(members(a).all(|front| members(b).all(|element| front.is_behind(element))));
            }
        }
    }
    assert!(behind > 500, "{behind}");
}
