//! The row kernel in a room like Cornell's: form factors of one shooter at many receivers, two blocks between them.

#[path = "../tests/suite/room/mod.rs"]
mod room;

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use kernel::geometry::ConvexPolygon;
use kernel::row::{Precision, Shape, Shooter};
use kernel::visibility::ReceiverGroups;
use worker::engine::{Scene, compute_row};

use room::{block, polygon, wall_receivers};

/// Receivers along an edge of a wall.
const ALONG: usize = 20;

/// Receivers of a row.
const RECEIVERS: usize = 5 * ALONG * ALONG;

/// Side of the room.
const SIDE: f64 = 5.5;

/// What blocks light: the walls of a convex room do not.
fn blocks() -> Vec<ConvexPolygon> {
    let turn = |angle: f64| [angle.cos(), angle.sin()];
    let tall = block(10, DVec3::new(1.9, 0.0, 3.5), DVec3::new(0.82, 1.65, 0.82), turn(0.3));
    tall.into_iter().chain(block(20, DVec3::new(3.7, 0.0, 1.7), DVec3::splat(0.82), turn(-0.3))).collect()
}

fn kernel(criterion: &mut Criterion) {
    let (scene, receivers) =
        (Scene::new(&blocks()), ReceiverGroups::new(wall_receivers(SIDE, ALONG).collect()));
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
