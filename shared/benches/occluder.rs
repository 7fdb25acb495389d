//! Rays and shafts among boxes.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use shared::geometry::{ConvexPolygon, Corners, PlaneId};
use shared::occluder::{Bounds, Bundle, Occluder, Shaft};

/// Boxes along each axis.
const BOXES: u32 = 12;

/// Rays cast, shafts asked about.
const RAYS: usize = 1000;

/// No polygon lies in it.
const ELSEWHERE: [PlaneId; 2] = [PlaneId(u32::MAX); 2];

/// A lattice of boxes with gaps between them, in a cube of side 2: some rays pass, most do not.
fn boxes() -> Vec<ConvexPolygon> {
    let side = |centre: DVec3, axis: usize, sign: f64, half: f64| {
        let turn = |x: f64, y: f64| {
            let mut corner = DVec3::ZERO;
            (corner[axis], corner[(axis + 1) % 3], corner[(axis + 2) % 3]) = (sign, x, y);
            centre + corner * half
        };
        vec![turn(-1.0, -1.0), turn(1.0, -1.0), turn(1.0, 1.0), turn(-1.0, 1.0)]
    };
    let half = 0.25 / f64::from(BOXES);
    let along = |index: u32| (f64::from(index) + 0.5) / f64::from(BOXES) * 2.0 - 1.0;
    let lattice = (0..BOXES.pow(3))
        .map(|n| DVec3::new(along(n % BOXES), along(n / BOXES % BOXES), along(n / BOXES.pow(2))));
    let sides = lattice.flat_map(|centre| {
        (0..3).flat_map(move |axis| [-1.0, 1.0].map(|sign| side(centre, axis, sign, half)))
    });
    sides.zip(0..).map(|(corners, plane)| ConvexPolygon { plane: PlaneId(plane), corners }).collect()
}

/// Points that fill a cube of side 2 evenly: the sequence R3 of M. Roberts (2018).
fn points(count: usize, start: f64) -> impl Iterator<Item = DVec3> {
    let step = DVec3::new(0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_97);
    (0..count).map(move |index| (step * (index as f64 + start)).fract() * 2.0 - 1.0)
}

fn rays(criterion: &mut Criterion) {
    let polygons = boxes();
    let occluder = Occluder::new(&polygons);
    let ends: Vec<(DVec3, DVec3)> = points(RAYS, 0.5).zip(points(RAYS, 5000.3)).collect();
    let mut group = criterion.benchmark_group("occluder of 10,368 squares");
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2)).sample_size(20);
    group.bench_function("build", |bench| bench.iter(|| Occluder::new(black_box(&polygons))));
    group.throughput(Throughput::Elements(RAYS as u64));
    group.bench_function("rays", |bench| {
        bench.iter(|| ends.iter().filter(|(from, to)| occluder.blocks(*from, *to, ELSEWHERE)).count());
    });
    group.finish();
}

fn shafts(criterion: &mut Criterion) {
    let occluder = Occluder::new(&boxes());
    let square = |centre: DVec3| -> Corners {
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        corners.into_iter().map(|(x, y)| centre + DVec3::new(x, y, 0.0) * 0.1).collect()
    };
    // From below the lattice to squares above it that face down.
    let apexes: Vec<DVec3> = points(RAYS, 0.5).map(|point| DVec3::new(point.x, point.y, -1.5)).collect();
    let bases: Vec<Corners> = apexes
        .iter()
        .zip(points(RAYS, 5000.3))
        .map(|(apex, point)| {
            let base = square(DVec3::new(point.x, point.y, 1.5) - *apex);
            base.into_iter().rev().collect()
        })
        .collect();
    let mut group = criterion.benchmark_group("shafts through 10,368 squares");
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2)).sample_size(20);
    group.throughput(Throughput::Elements(RAYS as u64));
    group.bench_function("candidates of a bundle", |bench| {
        let mut candidates = vec![];
        bench.iter(|| {
            let found = apexes.iter().zip(&bases).map(|(apex, base)| {
                let below = Bounds::around([*apex - 0.05, *apex + 0.05].into_iter());
                let above = Bounds::around(base.iter().map(|corner| *corner + *apex));
                occluder.candidates(&Bundle::new(&below, &above), &mut candidates);
                candidates.len()
            });
            found.sum::<usize>()
        });
    });
    group.bench_function("blockers of a shaft", |bench| {
        let mut blockers = vec![];
        bench.iter(|| {
            let found = apexes.iter().zip(&bases).map(|(apex, base)| {
                let shaft = Shaft::new(*apex, base, DVec3::NEG_Z, ELSEWHERE);
                occluder.collect_blockers(&shaft, None, &mut blockers);
                blockers.len()
            });
            found.sum::<usize>()
        });
    });
    group.finish();
}

criterion_group!(benches, rays, shafts);
criterion_main!(benches);
