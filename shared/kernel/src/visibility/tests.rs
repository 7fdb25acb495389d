//! Visibility against exact values, against rays, and against itself.

use glam::DVec3;
use proptest::prelude::*;

use super::*;
use crate::geometry::{ConvexPolygon, PlaneId};
use crate::occluder::convex_bodies;
use crate::replica::Receiver;
use crate::row::{CHANNELS, Shape};

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
    visible_by(&PRECISION, occluders, receivers, target, |index| index as u32)
}

/// The same with these seeds of the receivers' rays: views of very many pieces are sampled.
fn visible_by(
    precision: &Precision,
    occluders: &[ConvexPolygon],
    receivers: &[Receiver],
    target: &ConvexPolygon,
    seeds: impl Fn(usize) -> u32,
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
        let together = visible_by(&precision, &occluders, &receivers, &ceiling(), |index| index as u32);
        let alone = |(index, receiver): (usize, &Receiver)| {
            visible_by(&precision, &occluders, &[*receiver], &ceiling(), |_| index as u32)[0]
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

/// A small lamp of many tiles over the floor that share corners, facing down: the least number of rays goes to it.
fn tiles() -> Vec<ConvexPolygon> {
    let tile = |i: u32| {
        let corner = |(x, y): (u32, u32)| {
            let at = |place: u32| 0.02 * f64::from(place) - 0.08;
            DVec3::new(at(i % 8 + x), at(i / 8 + y), 1.5)
        };
        let corners = [(0, 0), (0, 1), (1, 1), (1, 0)].map(corner).to_vec();
        ConvexPolygon { plane: PlaneId(1), corners }
    };
    (0..64).map(tile).collect()
}

/// Factors of many polygons as one, all of the same weight.
fn as_one(
    occluders: &[ConvexPolygon],
    polygons: &[ConvexPolygon],
    receivers: &[Receiver],
    (rays_per_hemisphere, seeds): (u32, impl Fn(usize) -> u32),
) -> Vec<f64> {
    as_one_with_rays(occluders, polygons, receivers, (rays_per_hemisphere, seeds)).0
}

/// The same with the number of rays.
fn as_one_with_rays(
    occluders: &[ConvexPolygon],
    polygons: &[ConvexPolygon],
    receivers: &[Receiver],
    draw: (u32, impl Fn(usize) -> u32),
) -> (Vec<f64>, u64) {
    let (factors, statistics) = of_shape(occluders, &Shape::Polygons(polygons.to_vec()), receivers, draw);
    (factors, statistics.rays)
}

/// The same of any shape, with all that is told of its rows.
fn of_shape(
    occluders: &[ConvexPolygon],
    shape: &Shape,
    receivers: &[Receiver],
    (rays_per_hemisphere, seeds): (u32, impl Fn(usize) -> u32),
) -> (Vec<f64>, RowStatistics) {
    let occluder = Occluder::new(occluders);
    let precision = Precision { rays_per_hemisphere, ..Precision::DEFAULT };
    let groups = ReceiverGroups::new(receivers.to_vec());
    let mut statistics = RowStatistics::default();
    let among = (&occluder, None);
    let many = factors_of_many((shape, &groups), among, &precision, seeds, &|| false, &mut statistics);
    (many.factors.into_iter().map(|[factor, ..]| factor).collect(), statistics)
}

/// Where few rays are asked for, those that all arrive are fewer still, and tell a little too much; where many are, and where little
/// is seen, the mean of many draws is right.
#[test]
fn rays_end_early_only_where_few_are_asked_for() {
    let lamp = square(DVec3::Z * 1.5, 0.08 * DVec3::X, 0.08 * DVec3::NEG_Y, 1);
    let receivers = [floor(0.0, 0.0)];
    let whole = visible(&[], &receivers, &lamp)[0];
    // One wall is before nothing, one before all.
    for (x, rays, wanted) in [(3.0, 256, 16), (3.0, 2048, 64), (0.0, 256, 64)] {
        let wall = square(DVec3::new(x, 0.0, 1.49), DVec3::X, DVec3::Y, 2);
        let (_, cast) = as_one_with_rays(&[wall], &tiles(), &receivers, (rays, |_| 5));
        assert_eq!(cast, wanted, "{x}, {rays}");
    }
    for (end, most) in [(-0.074, 0.02), (-0.06, 0.02), (0.0, 0.002), (0.07, 0.002)] {
        let wall = square(DVec3::new(end - 1.0, 0.0, 1.49), DVec3::X, DVec3::Y, 2);
        let exact = visible(std::slice::from_ref(&wall), &receivers, &lamp)[0];
        assert!(exact > 0.0 && exact < whole, "{end}: {exact} of {whole}");
        for (rays, most) in [(256, most), (2048, 0.002)] {
            let draws = 2000;
            let draw = |seed| as_one(std::slice::from_ref(&wall), &tiles(), &receivers, (rays, |_| seed))[0];
            let mean = (0..draws).map(draw).sum::<f64>() / f64::from(draws);
            assert!((mean - exact).abs() <= most * whole, "{end}, {rays}: {mean}, not {exact} of {whole}");
        }
    }
}

/// Most of the lamps that lie apart are hidden: where each of the others gets rays, they tell its light, not how often it was met. In
/// the mean it is right where they are too many for that.
#[test]
fn lamps_that_lie_apart_are_told_one_by_one() {
    for (along_edge, reach, off, off_in_the_mean) in [(4, 0.6, 1e-3, 1e-3), (20, 1.8, f64::INFINITY, 0.02)] {
        let step = 2.0 * reach / f64::from(along_edge - 1);
        let lamp = |index: u32| {
            let at = |index: u32| step * f64::from(index) - reach;
            let centre = DVec3::new(at(index % along_edge), at(index / along_edge), 2.0);
            square(centre, 0.02 * DVec3::X, 0.02 * DVec3::NEG_Y, 1)
        };
        let lamps: Vec<ConvexPolygon> = (0..along_edge * along_edge).map(lamp).collect();
        // All but those of the last column are behind a wall that ends before no lamp.
        let end = reach - 0.5 * step;
        let wall = [square(DVec3::new(end - 3.0, 0.0, 1.99), 3.0 * DVec3::X, 9.0 * DVec3::Y, 2)];
        let receiver = floor(0.0, 0.0);
        let exact: f64 = lamps.iter().map(|lamp| visible(&wall, &[receiver], lamp)[0]).sum();
        let all: f64 = lamps.iter().map(|lamp| visible(&[], &[receiver], lamp)[0]).sum();
        assert!(exact > 0.01 * all && exact < 0.25 * all, "{exact} of {all}");
        let draws = 4000;
        let mut mean = 0.0;
        for seed in 0..draws {
            let one = as_one(&wall, &lamps, &[receiver], (256, |_| seed))[0];
            assert!((one / exact - 1.0).abs() <= off, "{seed}: {one}, not {exact} of {all}");
            mean += one / f64::from(draws);
        }
        assert!((mean / exact - 1.0).abs() <= off_in_the_mean, "{mean}, not {exact} of {all}");
    }
}

/// Receivers of all sorts, the last group of them not full.
#[test]
fn what_a_receiver_sees_of_many_polygons_does_not_depend_on_the_others() {
    let receiver = |index: u32| {
        let at = |step: u32| 0.37 * f64::from(index * step % 11) - 1.9;
        let normal = DVec3::new(at(3), at(5), 2.0 + at(7)).normalize();
        let position = DVec3::new(at(1), at(2), f64::from(index % 5) / 4.0);
        Receiver { position, normal, plane: PlaneId(index % 3) }
    };
    let receivers: Vec<Receiver> = (0..53).map(receiver).collect();
    let walls = [square(DVec3::new(0.3, 0.2, 1.2), DVec3::X * 0.4, DVec3::Y * 0.3, 2)];
    let together = as_one(&walls, &tiles(), &receivers, (256, |index| index as u32));
    assert!(together.iter().filter(|factor| **factor > 0.0).count() > 10, "{together:?}");
    for (index, receiver) in receivers.iter().enumerate() {
        let alone = as_one(&walls, &tiles(), std::slice::from_ref(receiver), (256, |_| index as u32));
        assert_eq!(alone, [together[index]], "{receiver:?}");
    }
}

/// A form factor of each tile may be off by little, that of all of them by less.
#[test]
fn what_is_far_counts_as_points_within_a_thousandth() {
    for receiver in [floor(0.0, 0.0), floor(0.5, -0.3), floor(4.0, 1.0)] {
        let exact: f64 = tiles().iter().map(|tile| visible(&[], &[receiver], tile)[0]).sum();
        let one = as_one(&[], &tiles(), &[receiver], (256, |_| 0))[0];
        assert!((one / exact - 1.0).abs() <= 5e-4, "{one}, not {exact}");
    }
}

/// Rays that are shared tell of each channel what its own would, also where some hide one colour.
#[test]
fn shared_rays_are_right_in_each_channel() {
    let weights = |tile: &ConvexPolygon| {
        let at = tile.corner_mean();
        [(0.5 + 5.0 * at.x).clamp(0.0, 1.0), f64::from(at.y > 0.0), 0.02]
    };
    let lamps: Vec<_> = tiles().into_iter().map(|tile| (tile.clone(), weights(&tile))).collect();
    let receiver = floor(0.0, 0.0);
    let wall = [square(DVec3::new(-1.0, 0.0, 1.3), DVec3::X, DVec3::Y, 2)];
    let (occluder, groups) = (Occluder::new(&wall), ReceiverGroups::new(vec![receiver]));
    let precision = Precision { rays_per_hemisphere: 2048, ..Precision::DEFAULT };
    let [shape, ..] = Shape::of_colours(lamps.clone());
    let draws = 1000;
    let mut means = [0.0; CHANNELS];
    for seed in 0..draws {
        let mut statistics = RowStatistics::default();
        let (many, among) = ((&shape, &groups), (&occluder, None));
        let many = factors_of_many(many, among, &precision, |_| seed, &|| false, &mut statistics);
        for (mean, factor) in means.iter_mut().zip(many.factors[0]) {
            *mean += factor / f64::from(draws);
        }
        assert!(many.variances.iter().all(|variance| *variance > 0.0));
    }
    for (channel, mean) in means.iter().enumerate() {
        let sum = |walls: &[ConvexPolygon]| -> f64 {
            lamps.iter().map(|(lamp, weights)| weights[channel] * visible(walls, &[receiver], lamp)[0]).sum()
        };
        let (exact, all) = (sum(&wall), sum(&[]));
        assert!(exact > 0.02 * all && exact < 0.98 * all, "{exact} of {all}");
        assert!((mean / exact - 1.0).abs() <= 0.004, "{channel}: {mean}, not {exact}");
    }
}

/// Two lamps side by side, of tiles that are the brighter the farther along x; far away they are few places.
#[test]
fn rays_to_polygons_that_count_as_one_know_which_are_bright() {
    let weight = |tile: &ConvexPolygon| (0.5 + 5.0 * tile.corner_mean().x).clamp(0.0, 1.0);
    let lamps = [DVec3::ZERO, DVec3::new(0.3, 0.0, 2.5)].into_iter().flat_map(|by| {
        let moved = move |tile: ConvexPolygon| ConvexPolygon {
            corners: tile.corners.iter().map(|corner| *corner + by + DVec3::Z * 2.5).collect(),
            ..tile
        };
        tiles().into_iter().map(moved)
    });
    let lamps: Vec<(ConvexPolygon, f64)> = lamps.map(|tile| (tile.clone(), weight(&tile))).collect();
    let receiver = floor(0.0, 0.0);
    // Half of the first lamp is hidden, and a little of the other.
    let wall = [square(DVec3::new(-1.0, 0.0, 3.99), DVec3::X, DVec3::Y, 2)];
    let sum = |walls: &[ConvexPolygon]| -> f64 {
        lamps.iter().map(|(lamp, weight)| weight * visible(walls, &[receiver], lamp)[0]).sum()
    };
    let (exact, all) = (sum(&wall), sum(&[]));
    assert!(exact > 0.5 * all && exact < 0.95 * all, "{exact} of {all}");
    let (shape, draws) = (Shape::of_one_colour(lamps.clone()), 2000);
    let draw = |seed| of_shape(&wall, &shape, &[receiver], (2048, |_| seed));
    let mean = (0..draws).map(|seed| draw(seed).0[0]).sum::<f64>() / f64::from(draws);
    assert!((mean / exact - 1.0).abs() <= 0.002, "{mean}, not {exact}");
    assert_eq!(draw(0).1.factors, lamps.len() as u64);
}
