use glam::DVec3;

use super::*;
use crate::geometry::{ConvexPolygon, PlaneId};

fn square(plane: u32, centre: DVec3, normal: DVec3, half: f64) -> ConvexPolygon {
    let (u, v) = normal.any_orthonormal_pair();
    let corner = |(a, b): (f64, f64)| centre + u * (a * half) + v * (b * half);
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(corner).to_vec();
    ConvexPolygon { plane: PlaneId(plane), corners }
}

fn receiver() -> Receiver {
    Receiver { position: DVec3::ZERO, normal: DVec3::Z, plane: PlaneId(0) }
}

fn factor(seen: &Seen, polygon: usize) -> f64 {
    seen.factors.iter().find(|(index, _)| *index == polygon).map_or(0.0, |(_, factor)| f64::from(*factor))
}

/// From a point below the middle of a square, at half of its side (Siegel and Howell, configuration of a differential element to
/// a parallel rectangle, four times a quarter).
const BELOW_SQUARE: f64 = 0.554_1;

#[test]
fn a_square_overhead_has_its_form_factor() {
    let scene = [square(1, DVec3::Z, -DVec3::Z, 1.0)];
    let seen = seen_from(&SeenPolygons::new(&scene, &[]), &receiver(), 4096, 7);
    assert!((factor(&seen, 0) - BELOW_SQUARE).abs() < 2e-3, "{seen:?}");
    assert!((factor(&seen, 0) + f64::from(seen.sky) - 1.0).abs() < 1e-6, "{seen:?}");
    assert_eq!(seen.rays, 4096);
}

#[test]
fn what_lies_behind_is_hidden_and_backs_count_for_nobody() {
    let front = square(1, DVec3::Z, -DVec3::Z, 1.0);
    let behind = square(2, DVec3::Z * 2.0, -DVec3::Z, 1.0);
    let turned = square(1, DVec3::Z, DVec3::Z, 1.0);
    let hidden = seen_from(&SeenPolygons::new(&[front, behind.clone()], &[]), &receiver(), 1024, 7);
    assert_eq!(factor(&hidden, 1), 0.0);
    let dark = seen_from(&SeenPolygons::new(&[turned, behind], &[]), &receiver(), 1024, 7);
    assert!(dark.factors.is_empty(), "{dark:?}");
    assert_eq!(dark.sky, hidden.sky, "a back hides the sky, too");
}

#[test]
fn of_a_sheet_the_front_is_seen_whichever_comes_first() {
    let (front, back) = (square(1, DVec3::Z, -DVec3::Z, 1.0), square(1, DVec3::Z, DVec3::Z, 1.0));
    let one = seen_from(&SeenPolygons::new(&[front.clone(), back.clone()], &[]), &receiver(), 4096, 7);
    let other = seen_from(&SeenPolygons::new(&[back, front], &[]), &receiver(), 4096, 7);
    assert!((factor(&one, 0) - BELOW_SQUARE).abs() < 2e-3 && one.factors.len() == 1, "{one:?}");
    assert_eq!(factor(&one, 0), factor(&other, 1));
}

#[test]
fn the_back_of_a_sheet_that_is_divided_otherwise_hides_nothing_of_its_front() {
    // A hair nearer to the receiver, as where the corners of a plane are as flat as the numbers of a file.
    let nearer = DVec3::Z * (1.0 - 1e-6);
    let (front, back) = (square(1, DVec3::Z, -DVec3::Z, 5.0), square(1, nearer, DVec3::Z, 5.0));
    let alone = seen_from(&SeenPolygons::new(std::slice::from_ref(&front), &[]), &receiver(), 4096, 7);
    for scene in [[front.clone(), back.clone()], [back, front]] {
        let index = usize::from(scene[0].corners[0].z < 1.0);
        let seen = seen_from(&SeenPolygons::new(&scene, &[]), &receiver(), 4096, 7);
        assert_eq!(factor(&seen, index), factor(&alone, 0), "{seen:?}");
    }
}

/// What it has of its own light is in its radiosity.
#[test]
fn a_pane_lets_its_part_through_and_hides_nothing_of_itself() {
    let scene = [square(1, DVec3::Z, -DVec3::Z, 1.0), square(2, DVec3::Z * 1.5, -DVec3::Z, 20.0)];
    let opaque = seen_from(&SeenPolygons::new(&scene, &[]), &receiver(), 4096, 7);
    let pane = seen_from(&SeenPolygons::new(&scene, &[0.25, 1.0]), &receiver(), 4096, 7);
    assert_eq!(factor(&pane, 0), factor(&opaque, 0));
    let through = factor(&pane, 1) - factor(&opaque, 1);
    assert!((through - 0.75 * factor(&opaque, 0)).abs() < 1e-6);
    let alone = seen_from(&SeenPolygons::new(&scene[..1], &[0.25]), &receiver(), 4096, 7);
    assert!((f64::from(alone.sky) - (1.0 - 0.25 * factor(&alone, 0))).abs() < 1e-6, "{alone:?}");
}

#[test]
fn what_lies_in_the_plane_of_the_receiver_is_not_seen() {
    let scene = [square(0, DVec3::Z, -DVec3::Z, 1.0)];
    assert!(seen_from(&SeenPolygons::new(&scene, &[]), &receiver(), 64, 1).factors.is_empty());
}

#[test]
fn a_closed_room_has_factors_that_sum_to_one() {
    let sides = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    let scene: Vec<_> = (1..).zip(sides).map(|(plane, side)| square(plane, side, -side, 1.0)).collect();
    let polygons = SeenPolygons::new(&scene, &[]);
    for (seed, normal) in
        (0..).zip([DVec3::Z, DVec3::ONE.normalize(), DVec3::new(0.3, -0.9, 0.1).normalize()])
    {
        let inside = Receiver { position: DVec3::new(0.1, 0.2, -0.3), normal, plane: PlaneId(0) };
        let seen = seen_from(&polygons, &inside, 4096, seed);
        let sum: f64 = seen.factors.iter().map(|(_, factor)| f64::from(*factor)).sum();
        assert!((sum - 1.0).abs() < 1e-6, "{sum}");
        assert_eq!(seen.sky, 0.0);
    }
}

#[test]
fn panes_let_the_product_of_their_parts_through() {
    let panes = [1.0, 2.0, 3.0].map(|z| square(z as u32, DVec3::Z * z, -DVec3::Z, 1.0));
    let polygons = SeenPolygons::new(&panes, &[0.5, 0.2, 1.0]);
    let through = |to: f64, planes: [u32; 2]| {
        polygons.transmittance(DVec3::ZERO, DVec3::new(0.1, 0.2, to), planes.map(PlaneId))
    };
    assert!((through(0.9, [0, 9]) - 1.0).abs() < 1e-7);
    assert!((through(1.5, [0, 9]) - 0.5).abs() < 1e-7);
    assert!((through(2.5, [0, 9]) - 0.4).abs() < 1e-7);
    assert_eq!(through(3.5, [0, 9]), 0.0);
    // Nothing in the planes of the ends counts.
    assert!((through(2.5, [1, 9]) - 0.8).abs() < 1e-7);
    assert!((through(2.0, [0, 2]) - 0.5).abs() < 1e-7);
}

/// On the floor, a hair from its edges and corners: the receiver's own plane is not seen, and all else is.
#[test]
fn nothing_is_lost_beside_the_edges_of_a_room() {
    let sides = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    let scene: Vec<_> =
        (1..).zip(sides).map(|(plane, side)| square(plane, side * 700.0, -side, 700.0)).collect();
    let polygons = SeenPolygons::new(&scene, &[]);
    let places = [-699.9, -350.0, -0.3, 0.0, 350.0, 699.9];
    let all = places.iter().flat_map(|x| places.iter().map(move |y| DVec3::new(*x, *y, -700.0)));
    for (seed, position) in (0..).zip(all) {
        let receiver = Receiver { position, normal: DVec3::Z, plane: PlaneId(6) };
        for (_, direction) in directions(receiver.normal, 1024, seed) {
            let hit = polygons.nearest(position, direction, 0.0, receiver.plane);
            assert!(hit.is_some_and(|hit| hit.is_front), "{position} {direction} {hit:?}");
        }
    }
}
