//! Rays and shafts among boxes.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use kernel::form_factor::PreparedPolygon;
use kernel::geometry::lanes::LANES;
use kernel::geometry::{Bounds, ConvexPolygon, PlaneId};
use kernel::occluder::{CandidateList, Occluder, Pyramids, Shaft};
use kernel::replica::Receiver;
use kernel::visibility::ReceiverLanes;

/// Boxes along each axis.
const BOXES: u32 = 12;

/// Rays cast, shafts asked about.
const RAYS: usize = 1000;

/// No polygon lies in it.
const ELSEWHERE: [PlaneId; 2] = [PlaneId::NONE; 2];

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
    // From groups of points below the lattice to squares above it that face down.
    let groups: Vec<Vec<Receiver>> = points(RAYS / LANES, 0.5)
        .map(|point| {
            let receiver = |i: usize| Receiver {
                position: DVec3::new(point.x + 0.02 * (i % 4) as f64, point.y + 0.02 * (i / 4) as f64, -1.5),
                normal: DVec3::Z,
                plane: PlaneId::NONE,
            };
            (0..LANES).map(receiver).collect()
        })
        .collect();
    let squares: Vec<PreparedPolygon> = points(RAYS / LANES, 5000.3)
        .map(|point| {
            let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)];
            let corner = |(x, y): (f64, f64)| DVec3::new(point.x + 0.1 * x, point.y + 0.1 * y, 1.5);
            let corners = corners.into_iter().map(corner).collect();
            PreparedPolygon::new(&ConvexPolygon { plane: PlaneId(u32::MAX - 1), corners })
        })
        .collect();
    let around = |group: &[Receiver]| Bounds::around(group.iter().map(|receiver| receiver.position));
    let mut group = criterion.benchmark_group("shafts through 10,368 squares");
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2)).sample_size(20);
    group.throughput(Throughput::Elements(RAYS as u64));
    group.bench_function("candidates of a shaft", |bench| {
        let mut candidates = vec![];
        bench.iter(|| {
            let found = groups.iter().zip(&squares).map(|(group, square)| {
                let above = Bounds::around(square.corners());
                occluder.candidates(&Shaft::new(&around(group), &above, 0.0), &mut candidates);
                candidates.len()
            });
            found.sum::<usize>()
        });
    });
    group.bench_function("what the occluders do to sixteen pyramids", |bench| {
        let (mut list, mut pyramids) = (CandidateList::default(), Pyramids::default());
        bench.iter(|| {
            let mut reached = 0;
            for (group, square) in groups.iter().zip(&squares) {
                list.collect(&occluder, &around(group), square);
                let lanes = ReceiverLanes::new(group);
                pyramids.aim(&lanes.positions, square.corners());
                for part in 0..list.len() as u32 {
                    reached += list.reach(&occluder, part, &pyramids, &lanes.planes).partly.count_ones();
                }
            }
            reached
        });
    });
    group.finish();
}

criterion_group!(benches, rays, shafts);
criterion_main!(benches);
