//! Joining triangles into convex facets.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use kernel::geometry::area_vector;
use proptest::prelude::*;
use serde_json::json;

use crate::facet::Facet;
use crate::import::test_document::TestDocument;
use crate::model::Scene;

/// Vertices and triangles of a grid of `n` x `m` unit cells in z = 0; cells that `keep` refuses are left out.
fn grid(n: u32, m: u32, keep: impl Fn(u32, u32) -> bool) -> (Vec<DVec3>, Vec<u32>) {
    let at = |x: u32, y: u32| y * (n + 1) + x;
    let points = (0..=m).flat_map(|y| (0..=n).map(move |x| DVec3::new(f64::from(x), f64::from(y), 0.0)));
    let cells = (0..m).flat_map(|y| (0..n).map(move |x| (x, y))).filter(|&(x, y)| keep(x, y));
    let indices = cells.flat_map(|(x, y)| {
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
        if (x + y) % 2 == 0 { [a, b, c, a, c, d] } else { [a, b, d, b, c, d] }
    });
    (points.collect(), indices.collect())
}

fn rounded(points: &[DVec3], turn: DQuat) -> Vec<[f32; 3]> {
    points.iter().map(|&point| (turn * point).as_vec3().to_array()).collect()
}

fn positions(facet: &Facet) -> Vec<DVec3> {
    facet.positions().collect()
}

fn facets(scene: &Scene) -> &[Facet] {
    &scene.surfaces[0].facets
}

/// Every facet is flat and convex, but for `tolerance` frame units, and covers its triangles.
fn assert_sound(scene: &Scene, tolerance: f64) {
    for facet in facets(scene) {
        let corners = positions(facet);
        assert!(corners.len() >= 3);
        assert!((facet.normal.length() - 1.0).abs() < 1e-12);
        for i in 0..corners.len() {
            let (start, end) = (corners[i], corners[(i + 1) % corners.len()]);
            let inwards = facet.normal.cross(end - start).normalize();
            for &corner in &corners {
                assert!(
                    (corner - start).dot(inwards) >= -tolerance,
                    "concave by {}",
                    -(corner - start).dot(inwards)
                );
                assert!((corner - start).dot(facet.normal).abs() <= tolerance, "not flat");
            }
        }
        let triangles: DVec3 = facet.triangles.iter().map(|triangle| area_vector(&triangle.positions)).sum();
        let area = area_vector(&corners).dot(facet.normal);
        let perimeter: f64 =
            (0..corners.len()).map(|i| corners[i].distance(corners[(i + 1) % corners.len()])).sum();
        assert!(
            (triangles.length() - area).abs() <= tolerance * perimeter,
            "{} and {area}",
            triangles.length()
        );
    }
}

#[test]
fn grid_becomes_one_rectangle() {
    let (points, indices) = grid(7, 5, |_, _| true);
    let scene = TestDocument::with_triangles(&rounded(&points, DQuat::IDENTITY), &indices).scene();
    let [facet] = facets(&scene) else { panic!("{} facets", facets(&scene).len()) };
    assert_eq!((facet.corners.len(), facet.triangles.len()), (4, 70));
    assert_sound(&scene, 1e-9);
}

#[test]
fn grid_of_unshared_vertices_becomes_one_rectangle() {
    let (points, indices) = grid(4, 3, |_, _| true);
    let soup: Vec<DVec3> = indices.iter().map(|&index| points[index as usize]).collect();
    let all: Vec<u32> = (0..soup.len() as u32).collect();
    let scene = TestDocument::with_triangles(&rounded(&soup, DQuat::IDENTITY), &all).scene();
    assert_eq!((facets(&scene).len(), facets(&scene)[0].corners.len()), (1, 4));
}

#[test]
fn grid_whose_corners_were_rounded_becomes_one_rectangle() {
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    let (points, indices) = grid(20, 20, |_, _| true);
    let scene = TestDocument::with_triangles(&rounded(&points, turn), &indices).scene();
    assert_eq!((facets(&scene).len(), facets(&scene)[0].corners.len()), (1, 4));
    assert_sound(&scene, 1e-3);
}

#[test]
fn grid_in_any_order_becomes_one_rectangle() {
    let (points, indices) = grid(20, 20, |_, _| true);
    let turn = DQuat::from_axis_angle(DVec3::new(3.0, 1.0, 2.0).normalize(), 1.9);
    let mut triangles: Vec<&[u32]> = indices.chunks(3).collect();
    // 7919 is prime, so this visits every triangle once, far from where it was.
    triangles = (0..triangles.len()).map(|i| triangles[i * 7919 % triangles.len()]).collect();
    let scene = TestDocument::with_triangles(&rounded(&points, turn), &triangles.concat()).scene();
    assert_eq!((facets(&scene).len(), facets(&scene)[0].corners.len()), (1, 4));
}

#[test]
fn long_strip_is_joined_in_pieces() {
    let (points, indices) = grid(2000, 1, |_, _| true);
    let scene = TestDocument::with_triangles(&rounded(&points, DQuat::IDENTITY), &indices).scene();
    assert!(facets(&scene).len() <= 16, "{}", facets(&scene).len());
    assert_sound(&scene, 1e-9);
}

#[test]
fn concave_outlines_are_cut_into_convex_facets() {
    // An L, and a frame round a hole.
    let (points, indices) = grid(4, 4, |x, y| x < 2 || y < 2);
    let scene = TestDocument::with_triangles(&rounded(&points, DQuat::IDENTITY), &indices).scene();
    assert_eq!(facets(&scene).len(), 2);
    assert_sound(&scene, 1e-9);
    let (points, indices) = grid(5, 5, |x, y| x == 0 || y == 0 || x == 4 || y == 4);
    let scene = TestDocument::with_triangles(&rounded(&points, DQuat::IDENTITY), &indices).scene();
    assert_eq!(facets(&scene).len(), 4);
    assert_sound(&scene, 1e-9);
}

#[test]
fn straight_corners_stay_where_another_facet_has_a_real_one() {
    // Two cells below, one above them on the left: an upright rectangle and a square, or a flat one and a square.
    let (points, indices) = grid(2, 2, |x, y| y == 0 || x == 0);
    let scene = TestDocument::with_triangles(&rounded(&points, DQuat::IDENTITY), &indices).scene();
    let mut corners: Vec<usize> = facets(&scene).iter().map(|facet| facet.corners.len()).collect();
    corners.sort_unstable();
    assert_eq!(corners, [4, 5]);
    let middle = scene.frame.to_frame(DVec3::new(1.0, 1.0, 0.0));
    assert!(facets(&scene).iter().all(|facet| positions(facet).contains(&middle)));
}

#[test]
fn divided_faces_of_a_folded_sheet_lose_their_common_straight_corners() {
    let (mut points, indices) = grid(6, 4, |_, _| true);
    for point in &mut points {
        // Folded upwards at x = 3.
        point.z = (point.x - 3.0).max(0.0);
    }
    let scene = TestDocument::with_triangles(&rounded(&points, DQuat::IDENTITY), &indices).scene();
    assert_eq!((facets(&scene).len(), scene.plane_count), (2, 2));
    assert!(facets(&scene).iter().all(|facet| facet.corners.len() == 4));
    assert_sound(&scene, 1e-9);
}

#[test]
fn surfaces_that_bend_are_not_flattened() {
    // A cylinder of many sides, and a bowl so shallow that neighbours differ by less than a degree.
    let around = |i: u32| f64::from(i) / 400.0 * TAU;
    let (mut points, indices) = grid(400, 3, |_, _| true);
    for point in &mut points {
        let angle = around(point.x as u32);
        *point = DVec3::new(angle.cos(), angle.sin(), point.y);
    }
    let scene = TestDocument::with_triangles(&rounded(&points, DQuat::IDENTITY), &indices).scene();
    assert_eq!(facets(&scene).len(), 400);
    assert_sound(&scene, 1e-3);

    let (mut points, indices) = grid(30, 30, |_, _| true);
    for point in &mut points {
        point.z = 1e-3 * point.length_squared();
    }
    let scene = TestDocument::with_triangles(&rounded(&points, DQuat::IDENTITY), &indices).scene();
    assert!(facets(&scene).len() >= 900, "{}", facets(&scene).len());
    assert_sound(&scene, 1e-3);
}

#[test]
fn small_things_in_large_scenes_are_not_flattened() {
    // A bowl of a millimetre in a hall of a kilometre: far below the scene's resolution, not below the file's.
    let (mut points, indices) = grid(10, 10, |_, _| true);
    for point in &mut points {
        *point = DVec3::new(point.x, point.y, 0.02 * point.length_squared()) * 1e-4;
    }
    let mut document = TestDocument::with_triangles(&rounded(&points, DQuat::IDENTITY), &indices);
    document.root["nodes"][0]["translation"] = json!([10, 20, 30]);
    document.light(json!({ "type": "point" }), json!({ "translation": [1000, 0, 0] }));
    assert!(facets(&document.scene()).len() >= 100);
}

#[test]
fn disc_keeps_its_outline() {
    let rim = (0..64)
        .map(|i| DVec3::new((f64::from(i) / 64.0 * TAU).cos(), (f64::from(i) / 64.0 * TAU).sin(), 0.0));
    let points: Vec<DVec3> = std::iter::once(DVec3::ZERO).chain(rim).collect();
    let indices: Vec<u32> = (0..64).flat_map(|i| [0, 1 + i, 1 + (i + 1) % 64]).collect();
    let scene = TestDocument::with_triangles(&rounded(&points, DQuat::IDENTITY), &indices).scene();
    assert_sound(&scene, 1e-3);
    let area: f64 = facets(&scene).iter().map(|facet| area_vector(&positions(facet)).z).sum();
    let expected = 32.0 * (TAU / 64.0).sin() / scene.frame.scale.powi(2);
    assert!((area / expected - 1.0).abs() < 1e-6, "{area} {expected}");
    assert!(facets(&scene).len() <= 3, "{}", facets(&scene).len());
}

#[test]
fn finely_divided_concave_arcs_do_not_pass_as_straight() {
    // A ring with so many sides that each turns by less than rounding explains.
    const SIDES: u32 = 4000;
    let on = |i: u32, radius: f64| {
        let angle = f64::from(i) / f64::from(SIDES) * TAU;
        DVec3::new(radius * angle.cos(), radius * angle.sin(), 0.0)
    };
    let points: Vec<DVec3> = (0..SIDES).flat_map(|i| [on(i, 0.5), on(i, 1.0)]).collect();
    let indices: Vec<u32> = (0..SIDES)
        .flat_map(|i| {
            let [a, b, c, d] = [2 * i, 2 * i + 1, 2 * ((i + 1) % SIDES) + 1, 2 * ((i + 1) % SIDES)];
            [a, b, c, a, c, d]
        })
        .collect();
    let scene = TestDocument::with_triangles(&rounded(&points, DQuat::IDENTITY), &indices).scene();
    assert_sound(&scene, 2e-3);
}

#[test]
fn edges_of_three_triangles_are_not_joined_across() {
    let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.5, -1.0, 0.0], [0.5, -2.0, 1.0]];
    let scene = TestDocument::with_triangles(&points, &[0, 1, 2, 1, 0, 3, 1, 0, 4]).scene();
    assert_eq!(facets(&scene).len(), 3);
}

/// Two triangles with texture coordinates and colours; the second has vertices of its own.
fn two_triangles_with(attribute: &str, values: &[[f32; 2]; 6]) -> Scene {
    let positions = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0; 3], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let mut document = TestDocument::with_triangles(&positions, &[0, 1, 2, 3, 4, 5]);
    let accessor = if attribute.starts_with("COLOR") {
        document.floats("VEC3", &values.map(|[u, v]| [u, v, 0.5]))
    } else {
        document.floats("VEC2", values)
    };
    document.root["meshes"][0]["primitives"][0]["attributes"][attribute] = accessor.into();
    document.scene()
}

#[test]
fn attributes_that_run_on_are_joined_and_others_not() {
    let affine = [[0.1, 0.2], [0.3, 0.2], [0.3, 0.6], [0.1, 0.2], [0.3, 0.6], [0.1, 0.6]];
    let mut kink = affine;
    kink[5] = [0.1, 0.6002];
    let mut seam = affine;
    seam[3] = [0.1002, 0.2];
    let mut nearly = affine;
    nearly[5] = [0.1, 0.60005];
    for attribute in ["TEXCOORD_0", "TEXCOORD_1", "COLOR_0"] {
        for (values, expected) in [(affine, 1), (nearly, 1), (kink, 2), (seam, 2)] {
            let scene = two_triangles_with(attribute, &values);
            assert_eq!(facets(&scene).len(), expected, "{attribute} {values:?}");
        }
    }
}

#[test]
fn result_does_not_depend_on_the_run() {
    let (points, indices) = grid(9, 8, |x, y| (x * 7 + y * 5) % 4 != 0);
    let document = TestDocument::with_triangles(&rounded(&points, DQuat::IDENTITY), &indices);
    let (first, second) = (document.scene(), document.scene());
    for (a, b) in facets(&first).iter().zip(facets(&second)) {
        assert_eq!((&a.corners, &a.triangles, a.plane), (&b.corners, &b.triangles, b.plane));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Any part of a grid, any way round in space, stretched, and rounded to f32.
    #[test]
    fn facets_cover_their_triangles(
        cells in prop::collection::vec(any::<bool>(), 64),
        axis in prop::array::uniform3(-1.0f64..1.0),
        angle in 0.0..TAU,
        stretch in 0.01f64..10.0,
    ) {
        prop_assume!(cells.contains(&true));
        let turn = DQuat::from_axis_angle(DVec3::from_array(axis).try_normalize().unwrap_or(DVec3::X), angle);
        let (points, indices) = grid(8, 8, |x, y| cells[(8 * y + x) as usize]);
        let stretched: Vec<DVec3> = points.iter().map(|&point| point * DVec3::new(stretch, 1.0, 1.0)).collect();
        let scene = TestDocument::with_triangles(&rounded(&stretched, turn), &indices).scene();
        assert_sound(&scene, 2e-3);
        let triangles: usize = facets(&scene).iter().map(|facet| facet.triangles.len()).sum();
        prop_assert_eq!(triangles, 2 * cells.iter().filter(|&&cell| cell).count());
        // The normal of a sliver by itself is less certain: it may have a plane of its own.
        if stretch > 0.1 {
            prop_assert_eq!(scene.plane_count, 1);
        }
    }
}
