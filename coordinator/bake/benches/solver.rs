//! The solution of a room in one channel beside that in three: what a grey scene saves.

use bake::solver::cache::RowCache;
use bake::solver::shooting::Shooting;
use bake::solver::sweeps::solve;
use bake::solver::{Light, ShareEnergy};
use criterion::{Criterion, criterion_group, criterion_main};
use glam::DVec3;
use kernel::row::Row;
use std::hint::black_box;

/// Shares of the room.
const SHARES: usize = 1500;

/// Receivers, of which the first are the shares' own vertices.
const RECEIVERS: usize = 3000;

/// A closed room whose surfaces see each other evenly, but for a ripple.
fn rows() -> Vec<Row> {
    let factor = |x: usize, a: usize| (1.0 + 0.5 * ((7 * x + 3 * a) as f32).sin()) / SHARES as f32;
    (0..SHARES).map(|x| Row::new(&(0..RECEIVERS).map(|a| factor(x, a)).collect::<Vec<_>>())).collect()
}

fn shares<L: Light>() -> Vec<ShareEnergy<L>> {
    let reflectance = |index: usize| 0.3 + 0.4 * (index % 5) as f64 / 4.0;
    let share = |receiver| ShareEnergy {
        receiver,
        area: 1.0,
        reflectance: L::reflectance(DVec3::splat(reflectance(receiver))),
    };
    (0..SHARES).map(share).collect()
}

/// Shooting and sweeps, as a bake has them.
fn solved<L: Light>(rows: &mut Vec<Row>) -> f64 {
    let direct = vec![L::from_rgb(DVec3::ONE, DVec3::ONE); RECEIVERS];
    let mut cache = RowCache::new(usize::MAX);
    let set = cache.add_set(SHARES);
    let mut shooting = Shooting::<L>::new(shares(), direct.clone(), set, 32, 1e-3);
    let mut wanted = shooting.start(&cache);
    while let Some(share) = wanted.pop() {
        wanted.extend(shooting.row_arrived(share, rows[share.index()].clone(), &mut cache));
    }
    let Ok(solution) = solve(&shares::<L>(), rows, direct, shooting.into_shot(), 1e-6, 1000);
    solution.radiosity.into_iter().map(Light::sum_of_channels).sum()
}

fn channels(criterion: &mut Criterion) {
    let mut rows = rows();
    let mut group = criterion.benchmark_group("solution of 1,500 shares");
    group.sample_size(10);
    group.bench_function("one channel", |bench| bench.iter(|| solved::<f64>(black_box(&mut rows))));
    group.bench_function("three channels", |bench| bench.iter(|| solved::<DVec3>(black_box(&mut rows))));
    group.finish();
}

criterion_group!(benches, channels);
criterion_main!(benches);
