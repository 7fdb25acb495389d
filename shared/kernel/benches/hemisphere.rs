//! Rows of receivers: rays over hemispheres among finely tessellated things.

use std::f64::consts::{PI, TAU};
use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::hemisphere::{SeenPolygons, seen_from};
use kernel::replica::Receiver;

/// Balls along each axis of the room.
const BALLS: u32 = 3;

/// Steps of longitude of each ball.
const STEPS: u32 = 64;

/// Rays of a hemisphere.
const RAYS: u32 = 1024;

/// A point of a ball, by longitude and latitude in steps.
fn on_ball(centre: DVec3, radius: f64, longitude: u32, latitude: u32) -> DVec3 {
    let (turn, tilt) =
        (TAU * f64::from(longitude) / f64::from(STEPS), TAU * f64::from(latitude) / f64::from(STEPS));
    let (sine, height) = if 2 * latitude == STEPS { (0.0, -1.0) } else { tilt.sin_cos() };
    centre + radius * DVec3::new(sine * turn.cos(), sine * turn.sin(), height)
}

/// Balls in a cube of side 2 whose walls face inward; 53,568 triangles of the balls.
fn room() -> Vec<ConvexPolygon> {
    let mut corners: Vec<Vec<DVec3>> = vec![];
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let wall = |x: f64, y: f64| {
                let mut corner = DVec3::ZERO;
                (corner[axis], corner[(axis + 1) % 3], corner[(axis + 2) % 3]) = (sign, x, -sign * y);
                corner
            };
            corners.push(vec![wall(-1.0, -1.0), wall(1.0, -1.0), wall(1.0, 1.0), wall(-1.0, 1.0)]);
        }
    }
    let along = |index: u32| (f64::from(index) + 0.5) / f64::from(BALLS) * 2.0 - 1.0;
    for n in 0..BALLS.pow(3) {
        let centre = DVec3::new(along(n % BALLS), along(n / BALLS % BALLS), along(n / BALLS.pow(2)));
        let at = |longitude, latitude| on_ball(centre, 0.2, longitude, latitude);
        for (longitude, latitude) in (0..STEPS).flat_map(|l| (0..STEPS / 2).map(move |t| (l, t))) {
            let [a, b] = [longitude, longitude + 1].map(|l| at(l, latitude));
            let [c, d] = [longitude, longitude + 1].map(|l| at(l, latitude + 1));
            if latitude > 0 {
                corners.push(vec![a, c, b]);
            }
            if latitude + 1 < STEPS / 2 {
                corners.push(vec![b, c, d]);
            }
        }
    }
    corners
        .into_iter()
        .zip(0..)
        .map(|(corners, plane)| ConvexPolygon { plane: PlaneId(plane), corners })
        .collect()
}

/// Points of the floor, and of the ball in the middle.
fn receivers() -> Vec<Receiver> {
    let floor = (0..32_u32).map(|n| {
        let place = |step: f64| (step * f64::from(n)).fract() * 1.8 - 0.9;
        Receiver {
            position: DVec3::new(place(0.755), place(0.57), -1.0),
            normal: DVec3::Z,
            plane: PlaneId(0),
        }
    });
    let ball = (0..32_u32).map(|n| {
        let (height, turn) = (1.0 - (f64::from(n) + 0.5) / 16.0, PI * 2.4 * f64::from(n));
        let ring = (1.0 - height * height).sqrt();
        let normal = DVec3::new(ring * turn.cos(), ring * turn.sin(), height);
        Receiver { position: normal * 0.21, normal, plane: PlaneId::NONE }
    });
    floor.chain(ball).collect()
}

fn hemispheres(criterion: &mut Criterion) {
    let polygons = room();
    let seen = SeenPolygons::new(&polygons, &[]);
    let receivers = receivers();
    let mut group = criterion.benchmark_group("hemispheres among 53,568 triangles");
    group.warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(3)).sample_size(20);
    group.throughput(Throughput::Elements(receivers.len() as u64 * u64::from(RAYS)));
    group.bench_function("rays", |bench| {
        bench.iter(|| {
            let rows = (0..)
                .zip(&receivers)
                .map(|(seed, receiver)| seen_from(black_box(&seen), receiver, RAYS, seed));
            rows.map(|row| row.factors.len()).sum::<usize>()
        });
    });
    group.finish();
}

criterion_group!(benches, hemispheres);
criterion_main!(benches);
