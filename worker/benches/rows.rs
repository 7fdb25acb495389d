//! The row kernel in a room like Cornell's: form factors of one shooter at many receivers, two blocks between them.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::replica::Receiver;
use kernel::row::{Precision, Shape, Shooter};
use kernel::visibility::ReceiverGroups;
use worker::engine::{Scene, compute_row};

/// Receivers along an edge of a wall.
const ALONG: usize = 20;

/// Receivers of a row.
const RECEIVERS: usize = 5 * ALONG * ALONG;

/// Side of the room.
const SIDE: f64 = 5.5;

fn polygon(plane: u32, corners: [DVec3; 4]) -> ConvexPolygon {
    ConvexPolygon { plane: PlaneId(plane), corners: corners.to_vec() }
}

/// A box that stands on the floor; its planes are numbered from `plane`.
fn block(plane: u32, centre: DVec3, half: DVec3, turn: f64) -> Vec<ConvexPolygon> {
    let along = DVec3::new(turn.cos(), 0.0, turn.sin()) * half.x;
    let across = DVec3::new(-turn.sin(), 0.0, turn.cos()) * half.z;
    let up = DVec3::Y * 2.0 * half.y;
    let [a, b, c, d] =
        [-along - across, along - across, along + across, -along + across].map(|corner| centre + corner);
    let sides = [[a, d], [d, c], [c, b], [b, a]].map(|[left, right]| [left, right, right + up, left + up]);
    let all = sides.into_iter().chain([[d + up, c + up, b + up, a + up], [a, b, c, d]]);
    (plane..).zip(all).map(|(plane, corners)| polygon(plane, corners)).collect()
}

/// What blocks light: the walls of a convex room do not.
fn blocks() -> Vec<ConvexPolygon> {
    let tall = block(10, DVec3::new(1.9, 0.0, 3.5), DVec3::new(0.82, 1.65, 0.82), 0.3);
    tall.into_iter().chain(block(20, DVec3::new(3.7, 0.0, 1.7), DVec3::new(0.82, 0.82, 0.82), -0.3)).collect()
}

/// A lattice on four walls and the floor; walls have the planes 0 to 4.
fn receivers() -> Vec<Receiver> {
    let step = |index: usize| (index as f64 + 0.5) / ALONG as f64 * SIDE;
    let walls = [
        (DVec3::ZERO, DVec3::X, DVec3::Z, DVec3::Y),
        (DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z),
        (DVec3::Z * SIDE, DVec3::X, DVec3::Y, DVec3::NEG_Z),
        (DVec3::ZERO, DVec3::Z, DVec3::Y, DVec3::X),
        (DVec3::X * SIDE, DVec3::Z, DVec3::Y, DVec3::NEG_X),
    ];
    let on = |(plane, (corner, u, v, normal)): (u32, (DVec3, DVec3, DVec3, DVec3))| {
        (0..ALONG * ALONG).map(move |index| Receiver {
            position: corner + u * step(index % ALONG) + v * step(index / ALONG),
            normal,
            plane: PlaneId(plane),
        })
    };
    (0..).zip(walls).flat_map(on).collect()
}

fn kernel(criterion: &mut Criterion) {
    let (scene, receivers) = (Scene::new(&blocks()), ReceiverGroups::new(receivers()));
    let ceiling = |low: f64, size: f64| {
        let [x, y, z] = [low, SIDE - 0.01, low];
        let corner = |u: f64, v: f64| DVec3::new(x + u * size, y, z + v * size);
        polygon(5, [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)])
    };
    let shooter = |shape: Shape| Shooter { key: 1, shape };
    let lamp = shooter(Shape::Polygons(vec![ceiling(2.1, 1.3)]));
    let point = shooter(Shape::Point(DVec3::new(2.75, 5.0, 2.75)));
    let sampled = Precision { exact_occluders: 0, ..Precision::DEFAULT };
    let mut group = criterion.benchmark_group("row of 2,000 receivers in a room");
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2)).sample_size(20);
    group.throughput(Throughput::Elements(RECEIVERS as u64));
    for (name, shooter, precision) in [
        ("lamp, visibility computed", &lamp, &Precision::DEFAULT),
        ("lamp, visibility sampled", &lamp, &sampled),
        ("point light", &point, &Precision::DEFAULT),
    ] {
        group.bench_function(name, |bench| {
            bench.iter(|| compute_row(&scene, black_box(&receivers), 0, shooter, precision));
        });
    }
    group.finish();
}

criterion_group!(benches, kernel);
criterion_main!(benches);
