//! Rows on the wire.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use kernel::row::{Precision, Rounding, Row, decode_row, encode_row};

/// Receivers of a row.
const RECEIVERS: usize = 20_000;

/// A row in which every third receiver sees nothing, as walls that face away do, and the others stand beside receivers with much
/// the same factor.
fn row() -> Row {
    let rounding = Rounding::new(Precision::DEFAULT.factor_rounding);
    let factor = |index: usize| {
        let place = index as f64;
        let factor = 1e-4 * (3.0 * (place / 50.0).sin() + place.sin()).exp2();
        if (index / 11).is_multiple_of(3) {
            0.0
        } else {
            rounding.apply(factor, (index as u32).wrapping_mul(0x9e37_79b9))
        }
    };
    Row::new(&(0..RECEIVERS).map(factor).collect::<Vec<f32>>())
}

fn codec(criterion: &mut Criterion) {
    let row = row();
    let encoded = encode_row(&row);
    let mut group = criterion.benchmark_group("row of 20,000 receivers");
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1)).sample_size(20);
    group.throughput(Throughput::Elements(row.count() as u64));
    group.bench_function("encode", |bench| bench.iter(|| encode_row(black_box(&row))));
    group.bench_function("decode", |bench| bench.iter(|| decode_row(black_box(&encoded), RECEIVERS)));
    group.finish();
}

criterion_group!(benches, codec);
criterion_main!(benches);
