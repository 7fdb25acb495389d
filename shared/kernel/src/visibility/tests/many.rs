//! Shooters of many polygons.

use super::*;
use crate::row::{CHANNELS, Shape};

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
    (rays_per_hemisphere, seeds): (u32, Seeds),
) -> Vec<f64> {
    as_one_with_rays(occluders, polygons, receivers, (rays_per_hemisphere, seeds)).0
}

/// The same with the number of rays.
fn as_one_with_rays(
    occluders: &[ConvexPolygon],
    polygons: &[ConvexPolygon],
    receivers: &[Receiver],
    draw: (u32, Seeds),
) -> (Vec<f64>, u64) {
    let (factors, statistics) = of_shape(occluders, &Shape::Polygons(polygons.to_vec()), receivers, draw);
    (factors, statistics.rays)
}

/// The same of any shape, with all that is told of its rows.
fn of_shape(
    occluders: &[ConvexPolygon],
    shape: &Shape,
    receivers: &[Receiver],
    (rays_per_hemisphere, seeds): (u32, Seeds),
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
        let (_, cast) = as_one_with_rays(&[wall], &tiles(), &receivers, (rays, &|_| 5));
        assert_eq!(cast, wanted, "{x}, {rays}");
    }
    for (end, most) in [(-0.074, 0.02), (-0.06, 0.02), (0.0, 0.002), (0.07, 0.002)] {
        let wall = square(DVec3::new(end - 1.0, 0.0, 1.49), DVec3::X, DVec3::Y, 2);
        let exact = visible(std::slice::from_ref(&wall), &receivers, &lamp)[0];
        assert!(exact > 0.0 && exact < whole, "{end}: {exact} of {whole}");
        for (rays, most) in [(256, most), (2048, 0.002)] {
            let draws = 2000;
            let draw = |seed| as_one(std::slice::from_ref(&wall), &tiles(), &receivers, (rays, &|_| seed))[0];
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
            let one = as_one(&wall, &lamps, &[receiver], (256, &|_| seed))[0];
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
    let together = as_one(&walls, &tiles(), &receivers, (256, &|index| index as u32));
    assert!(together.iter().filter(|factor| **factor > 0.0).count() > 10, "{together:?}");
    for (index, receiver) in receivers.iter().enumerate() {
        let alone = as_one(&walls, &tiles(), std::slice::from_ref(receiver), (256, &|_| index as u32));
        assert_eq!(alone, [together[index]], "{receiver:?}");
    }
}

/// A form factor of each tile may be off by little, that of all of them by less.
#[test]
fn what_is_far_counts_as_points_within_a_thousandth() {
    for receiver in [floor(0.0, 0.0), floor(0.5, -0.3), floor(4.0, 1.0)] {
        let exact: f64 = tiles().iter().map(|tile| visible(&[], &[receiver], tile)[0]).sum();
        let one = as_one(&[], &tiles(), &[receiver], (256, &|_| 0))[0];
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
        let many = factors_of_many(many, among, &precision, &|_| seed, &|| false, &mut statistics);
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

/// A channel that no ray went to is as hidden as the others, not as bright as if nothing were hidden.
#[test]
fn what_is_faint_and_hidden_stays_dark() {
    let apart = |index: usize, tile: ConvexPolygon| {
        let by = DVec3::new(0.05 * (index % 8) as f64, 0.05 * (index / 8) as f64, 0.0);
        let corners = tile.corners.iter().map(|corner| *corner + by).collect();
        ConvexPolygon { corners, ..tile }
    };
    let weights = |index: usize| if index == 5 { [0.0, 0.0, 1e-4] } else { [1.0, 0.0, 0.0] };
    let lamps: Vec<_> =
        tiles().into_iter().enumerate().map(|(index, tile)| (apart(index, tile), weights(index))).collect();
    let walls = [square(DVec3::new(0.0, 0.0, 1.2), DVec3::X, DVec3::Y, 2)];
    let (occluder, groups) = (Occluder::new(&walls), ReceiverGroups::new(vec![floor(0.0, 0.0)]));
    let [shape, ..] = Shape::of_colours(lamps);
    for seed in 0..100 {
        let mut statistics = RowStatistics::default();
        let (many, among) = ((&shape, &groups), (&occluder, None));
        let many = factors_of_many(many, among, &PRECISION, &|_| seed, &|| false, &mut statistics);
        assert_eq!(many.factors, [[0.0; CHANNELS]], "{seed}");
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
    let draw = |seed| of_shape(&wall, &shape, &[receiver], (2048, &|_| seed));
    let mean = (0..draws).map(|seed| draw(seed).0[0]).sum::<f64>() / f64::from(draws);
    assert!((mean / exact - 1.0).abs() <= 0.002, "{mean}, not {exact}");
    assert_eq!(draw(0).1.factors, lamps.len() as u64);
}
