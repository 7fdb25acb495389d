//! Visibility against exact values, against rays, and against itself.

mod many;

use glam::DVec3;
use proptest::prelude::*;

use super::*;
use crate::geometry::{ConvexPolygon, PlaneId};
use crate::occluder::convex_bodies;
use crate::replica::Receiver;

const PRECISION: Precision = Precision {
    rays_per_hemisphere: 4096,
    minimum_rays: 4096,
    maximum_rays: 4096,
    seed: 7,
    form_factor_error: 0.0,
    ..Precision::DEFAULT
};

fn square(centre: DVec3, u: DVec3, v: DVec3, plane: u32) -> ConvexPolygon {
    let corners = vec![centre - u - v, centre + u - v, centre + u + v, centre - u + v];
    ConvexPolygon { plane: PlaneId(plane), corners }
}

fn floor(x: f64, y: f64) -> Receiver {
    Receiver { position: DVec3::new(x, y, 0.0), normal: DVec3::Z, plane: PlaneId(0) }
}

fn visible(occluders: &[ConvexPolygon], receivers: &[Receiver], target: &ConvexPolygon) -> Vec<f64> {
    visible_by(&PRECISION, occluders, receivers, target, &|index| index as u32)
}

/// The same with these seeds of the receivers' rays: views of very many pieces are sampled.
fn visible_by(
    precision: &Precision,
    occluders: &[ConvexPolygon],
    receivers: &[Receiver],
    target: &ConvexPolygon,
    seeds: Seeds,
) -> Vec<f64> {
    let occluder = Occluder::new(occluders);
    let mut factors = vec![0.0; receivers.len()];
    let target = PreparedPolygon::new(target);
    let mut kernel = VisibilityKernel::new(&occluder, precision);
    kernel.add_form_factors(
        &ReceiverGroups::new(receivers.to_vec()),
        &target,
        seeds,
        &mut factors,
        &mut RowStatistics::default(),
    );
    factors
}

/// A ceiling of side 2 at height 2, facing down.
fn ceiling() -> ConvexPolygon {
    square(DVec3::Z * 2.0, DVec3::X, DVec3::NEG_Y, 1)
}

#[test]
fn half_a_ceiling_behind_an_edge_is_half_a_form_factor() {
    let half = square(DVec3::new(4.0, 0.0, 1.0), DVec3::X * 4.0, DVec3::Y * 8.0, 2);
    let [free] = visible(&[], &[floor(0.0, 0.0)], &ceiling())[..] else { panic!() };
    let [cut] = visible(&[half], &[floor(0.0, 0.0)], &ceiling())[..] else { panic!() };
    assert!((cut / free - 0.5).abs() < 1e-14, "{cut} of {free}");
}

#[test]
fn a_wall_of_triangles_lets_nothing_through() {
    let mut wall = vec![];
    for i in 0..6 {
        for j in 0..6 {
            let corner = DVec3::new(f64::from(i) - 3.0, f64::from(j) - 3.0, 1.0);
            for [a, b] in [[DVec3::X, DVec3::X + DVec3::Y], [DVec3::X + DVec3::Y, DVec3::Y]] {
                wall.push(ConvexPolygon { plane: PlaneId(2), corners: vec![corner, corner + a, corner + b] });
            }
        }
    }
    for position in [floor(0.0, 0.0), floor(0.3, -0.2), floor(1.0, 1.0)] {
        assert_eq!(visible(&wall, &[position], &ceiling()), [0.0]);
    }
}

#[test]
fn what_lies_behind_the_target_or_under_the_floor_blocks_nothing() {
    let behind = square(DVec3::Z * 2.5, DVec3::X, DVec3::Y, 2);
    let below = square(DVec3::Z * -0.5, DVec3::X, DVec3::Y, 3);
    let coplanar = square(DVec3::Z * 2.0, DVec3::X, DVec3::Y, 1);
    let receivers = [floor(0.2, 0.1)];
    assert_eq!(
        visible(&[behind, below, coplanar], &receivers, &ceiling()),
        visible(&[], &receivers, &ceiling())
    );
}

fn small_square() -> impl Strategy<Value = ConvexPolygon> {
    let vector = || prop::array::uniform3(-1.0..1.0).prop_map(DVec3::from_array);
    (vector(), vector(), vector(), 2_u32..1000).prop_filter_map("needs area", |(centre, u, v, plane)| {
        let v = v - u * (u.dot(v) / u.length_squared());
        let centre = DVec3::new(centre.x, centre.y, 1.0 + 0.8 * centre.z);
        (u.length() > 0.1 && v.length() > 0.1).then(|| square(centre, u * 0.4, v * 0.4, plane))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Cutting and sampling are two ways to one number. 4,096 rays have a standard error under .008 of the factor.
    #[test]
    fn cutting_agrees_with_rays(occluders in prop::collection::vec(small_square(), 1..5), x in -1.0..1.0, y in -1.0..1.0) {
        let receiver = floor(x, y);
        let target = ceiling();
        let [cut] = visible(&occluders, &[receiver], &target)[..] else { panic!() };
        let occluder = Occluder::new(&occluders);
        let prepared = PreparedPolygon::new(&target);
        let view = prepared.view(receiver.position, receiver.normal, 1e-5).unwrap();
        let planes = [receiver.plane, target.plane];
        let blocked = |to: DVec3| occluder.blocks(receiver.position, receiver.position + to, planes);
        let sample = sample::sample_visibility(&view.corners, receiver.normal, prepared.normal(), 4096, 1, blocked);
        prop_assert!((cut / view.factor - sample.fraction).abs() < 0.03, "{} {}", cut / view.factor, sample.fraction);
        let [free] = visible(&[], &[receiver], &target)[..] else { panic!() };
        prop_assert!((0.0..=free).contains(&cut));
    }

    /// Dividing the target must not change what is seen of it.
    #[test]
    fn parts_sum_to_the_whole(occluders in prop::collection::vec(small_square(), 0..6), x in -1.0..1.0, y in -1.0..1.0) {
        let [whole] = visible(&occluders, &[floor(x, y)], &ceiling())[..] else { panic!() };
        let half = DVec3::X * 0.5;
        let quarter = |sx: f64, sy: f64| square(DVec3::new(sx * 0.5, sy * 0.5, 2.0), half, DVec3::NEG_Y * 0.5, 1);
        let parts: f64 = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(sx, sy)| visible(&occluders, &[floor(x, y)], &quarter(sx, sy))[0]).iter().sum();
        prop_assert!((whole - parts).abs() < 1e-12, "{whole} {parts}");
    }

    /// The group that a pair is in must not change a bit of it: jobs may be cut anywhere.
    #[test]
    fn groups_do_not_matter(
        mut occluders in prop::collection::vec(small_square(), 0..12),
        boxes in prop::collection::vec((-1.0..1.0, -1.0..1.0, 0.1..1.8, -1.0..1.0), 0..4),
        places in prop::collection::vec((-2.0..2.0, -2.0..2.0), 1..400),
        // With more occluders than this, rays sample what is seen.
        most in prop::sample::select(vec![0, 2, 5, 40]),
    ) {
        for (number, (x, y, z, angle)) in (0..).zip(boxes) {
            let body = turned([x, y, z], [0.3, 0.2, 0.15], [angle, 0.5 * angle]);
            occluders.extend(body.into_iter().map(|face| ConvexPolygon {
                plane: PlaneId(face.plane.0 + 1000 * (number + 1)),
                ..face
            }));
        }
        let receivers: Vec<Receiver> = places.iter().map(|(x, y)| floor(*x, *y)).collect();
        let precision = Precision { exact_occluders: most, minimum_rays: 64, maximum_rays: 64, ..PRECISION };
        let together = visible_by(&precision, &occluders, &receivers, &ceiling(), &|index| index as u32);
        let alone = |(index, receiver): (usize, &Receiver)| {
            visible_by(&precision, &occluders, &[*receiver], &ceiling(), &|_| index as u32)[0]
        };
        let alone: Vec<f64> = receivers.iter().enumerate().map(alone).collect();
        prop_assert_eq!(together, alone);
    }
}

/// A box of these half axes, its faces showing outwards.
fn solid(centre: DVec3, axes: [DVec3; 3], first_plane: u32) -> Vec<ConvexPolygon> {
    let corner = |signs: [f64; 3]| centre + axes[0] * signs[0] + axes[1] * signs[1] + axes[2] * signs[2];
    let face = |axis: usize, side: f64| {
        let at = |a: f64, b: f64| {
            let mut signs = [side; 3];
            (signs[(axis + 1) % 3], signs[(axis + 2) % 3]) = (a * side, b);
            corner(signs)
        };
        vec![at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)]
    };
    let faces = (0..6).map(|i| face(i / 2, if i % 2 == 0 { 1.0 } else { -1.0 }));
    faces
        .zip(first_plane..)
        .map(|(corners, plane)| ConvexPolygon { plane: PlaneId(plane), corners })
        .collect()
}

fn turned(centre: [f64; 3], half: [f64; 3], angles: [f64; 2]) -> Vec<ConvexPolygon> {
    let turn = glam::DQuat::from_rotation_z(angles[0]) * glam::DQuat::from_rotation_x(angles[1]);
    let axes = [DVec3::X * half[0], DVec3::Y * half[1], DVec3::Z * half[2]].map(|axis| turn * axis);
    solid(DVec3::from_array(centre), axes, 2)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// The outline of a body blocks what its faces block. A face that is there twice makes them no body.
    #[test]
    fn a_body_blocks_what_its_faces_block(
        x in -1.0..1.0, y in -1.0..1.0, z in prop_oneof![Just(0.2_f64), 0.0..2.2],
        half in prop::array::uniform3(0.05..0.5), angle in -1.0..1.0, tilt in prop_oneof![Just(0.0), -1.0..1.0],
        places in prop::collection::vec((-2.0..2.0, -2.0..2.0), 1..40),
    ) {
        let half = [half[0], half[1], if tilt == 0.0 && z == 0.2 { 0.2 } else { half[2] }];
        let body = turned([x, y, z], half, [angle, tilt]);
        prop_assert_eq!(convex_bodies(&body).len(), 1);
        let mut faces = body.clone();
        faces.push(body[0].clone());
        let mut receivers: Vec<Receiver> = places.iter().map(|(x, y)| floor(*x, *y)).collect();
        // In line with an edge, and in the planes of two faces when the box stands on the floor.
        let (from, to) = (body[0].corners[0], body[0].corners[1]);
        receivers.extend([-2.0, -0.1, 1.1, 3.0].map(|t| from + (to - from) * t).map(|p| floor(p.x, p.y)));
        let (outline, faces) = (visible(&body, &receivers, &ceiling()), visible(&faces, &receivers, &ceiling()));
        for (i, (outline, faces)) in outline.iter().zip(&faces).enumerate() {
            prop_assert!((outline - faces).abs() < 1e-12, "{i}: {outline} {faces}");
        }
    }
}

/// A polygon on the inside of a body is not hidden by it from points inside, however large the group around them is.
#[test]
fn a_room_does_not_hide_its_own_ceiling() {
    let room = solid(DVec3::Z * 1.5, [DVec3::X, DVec3::Y, DVec3::Z * 1.5], 2);
    let above = room.iter().find(|face| face.normal().z > 0.5).unwrap().plane;
    let target = square(DVec3::Z * 3.0, DVec3::X * 0.5, DVec3::NEG_Y * 0.5, above.0);
    let ring = |radius: f64| {
        (0..16).map(move |i| {
            let angle = std::f64::consts::TAU * f64::from(i) / 16.0;
            let place = floor(radius * angle.cos(), radius * angle.sin());
            Receiver { position: place.position + DVec3::Z * 0.1, plane: PlaneId(100), ..place }
        })
    };
    let receivers: Vec<Receiver> = ring(0.5).chain(ring(4.0)).collect();
    let seen = visible(&room, &receivers, &target);
    assert!(seen[..16].iter().all(|factor| *factor > 0.01), "{seen:?}");
    assert!(seen[16..].iter().all(|factor| *factor == 0.0), "{seen:?}");
}
