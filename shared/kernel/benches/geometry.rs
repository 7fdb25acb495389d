//! Clipping of small polygons.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use glam::DVec3;
use kernel::geometry::{Corners, clip, clip_by_plane};

fn square() -> Corners {
    let corners = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.2], [0.0, 1.0, 1.2]];
    corners.into_iter().map(DVec3::from_array).collect()
}

fn clipping(criterion: &mut Criterion) {
    let square = square();
    let mut group = criterion.benchmark_group("clip a square");
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1)).sample_size(20);
    group.bench_function("by heights, through two edges", |bench| {
        bench.iter(|| clip(black_box(&square), black_box(&[-0.5, 0.5, 0.5, -0.5])));
    });
    group.bench_function("by heights, all kept", |bench| {
        bench.iter(|| clip(black_box(&square), black_box(&[0.5, 0.25, 0.5, 1.0])));
    });
    group.bench_function("by a plane through a corner", |bench| {
        bench.iter(|| clip_by_plane(black_box(&square), black_box(DVec3::new(1.0, -1.0, 0.2))));
    });
    group.finish();
}

criterion_group!(benches, clipping);
criterion_main!(benches);
