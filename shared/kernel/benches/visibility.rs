//! Exact cutting: blockers out of what stands behind them.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use glam::DVec3;
use kernel::geometry::Corners;
use kernel::visibility::{Cones, Pieces, cut};

fn square(x: f64, y: f64, z: f64, half: f64, turn: f64) -> Corners {
    let corner = |quarter: usize| {
        let angle = turn + std::f64::consts::FRAC_PI_2 * quarter as f64;
        DVec3::new(x + half * angle.cos(), y + half * angle.sin(), z)
    };
    (0..4).map(corner).collect()
}

/// Squares that overlap the base and a little each other, turned in all ways.
fn blockers(count: usize) -> Vec<Corners> {
    let golden = 2.399_963_229_728_653;
    (0..count)
        .map(|index| {
            let (radius, angle) = (0.4 * ((index as f64 + 0.5) / count as f64).sqrt(), golden * index as f64);
            square(radius * angle.cos(), radius * angle.sin(), 1.0, 0.1, angle)
        })
        .collect()
}

fn cutting(criterion: &mut Criterion) {
    let base = square(0.0, 0.0, 2.0, 1.2, 0.4);
    let mut group = criterion.benchmark_group("cut out of a square");
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1)).sample_size(20);
    for count in [1, 4, 12] {
        let blockers = blockers(count);
        group.bench_function(BenchmarkId::new("blockers", count), |bench| {
            let (mut pieces, mut scratch, mut cones) =
                (Pieces::default(), Pieces::default(), Cones::default());
            bench.iter(|| {
                pieces.clear();
                pieces.push(black_box(&base));
                cones.clear();
                blockers.iter().for_each(|blocker| cones.push_polygon(blocker));
                for cone in cones.iter() {
                    cut(&mut pieces, cone, &mut scratch);
                }
                pieces.len()
            });
        });
    }
    group.finish();
}

criterion_group!(benches, cutting);
criterion_main!(benches);
