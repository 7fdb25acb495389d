//! Unoccluded form factors per second and core: each rule of the lanes alone, and what rows have of them.
//!
//! `cargo bench -p shared --bench form_factors`; the last lines set the rates against the arithmetic that the processor could do.

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{Criterion, Throughput};
use glam::DVec3;
use kernel::form_factor::{LANES, PreparedPolygon, ReceiverLanes, ViewLanes};
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::simd::widest;

/// Receivers of a row: as many as stay in the cache nearest to the processor, as a worker's do from one shooter to the next.
const RECEIVERS: usize = 512;

/// Sums, products, quotients and roots of a factor: the point rule alone, and with the contour sum of a quad on top.
const POINT_RULE_OPERATIONS: f64 = 49.0;
const CONTOUR_OPERATIONS: f64 = 304.0;

/// Random numbers enough for a benchmark, the same in each run.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn point(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit())
    }

    /// A receiver on one of the walls of the unit room, and its normal.
    fn on_a_wall(&mut self) -> (DVec3, DVec3) {
        let axis = (self.unit() * 3.0) as usize;
        let side = (self.unit() * 2.0).floor();
        let (mut position, mut normal) = (self.point(), DVec3::ZERO);
        position[axis] = side;
        normal[axis] = 1.0 - 2.0 * side;
        (position, normal)
    }

    /// A square share on a wall: edges of a tenth to three tenths of the room's.
    fn share(&mut self) -> PreparedPolygon {
        let (position, normal) = self.on_a_wall();
        let half = 0.05 + 0.1 * self.unit();
        let across = normal.any_orthonormal_vector();
        let up = normal.cross(across);
        let centre = position.clamp(DVec3::splat(half), DVec3::splat(1.0 - half));
        let centre = centre + normal * normal.dot(position - centre);
        quad(centre, across * half, up * half)
    }
}

fn quad(centre: DVec3, across: DVec3, up: DVec3) -> PreparedPolygon {
    let corners =
        vec![centre - across - up, centre + across - up, centre + across + up, centre - across + up];
    PreparedPolygon::new(&ConvexPolygon { plane: PlaneId(0), corners })
}

/// A polygon's side of the work: polygons that take turns over one set of receivers.
struct Mix {
    name: &'static str,
    polygons: Vec<PreparedPolygon>,
    receivers: Vec<(DVec3, DVec3)>,
    tolerance: f64,
}

fn mixes() -> Vec<Mix> {
    let mut random = Random(88_172_645_463_325_252);
    let floor = || vec![quad(DVec3::new(0.4, 0.0, 0.4), DVec3::Z * 0.1, DVec3::X * 0.1)];
    let mut receivers = |of: &mut dyn FnMut(&mut Random) -> (DVec3, DVec3)| -> Vec<_> {
        (0..RECEIVERS).map(|_| of(&mut random)).collect()
    };
    let ceiling = |random: &mut Random| (random.point().with_y(1.0), DVec3::NEG_Y);
    let far = receivers(&mut |random| (random.point() * 100.0 + DVec3::Y * 200.0, DVec3::NEG_Y));
    let above = receivers(&mut { ceiling });
    let cut = receivers(&mut |random| (DVec3::new(0.4, 0.2 + random.unit(), 0.4), DVec3::X));
    let walls = receivers(&mut |random| random.on_a_wall());
    // As a mesh numbers its vertices: those of a block lie in one tile of a wall, a tenth of it wide.
    let mut tile = (DVec3::ZERO, DVec3::X);
    let mut in_tile = 0..0;
    let tiles = receivers(&mut |random| {
        if in_tile.next().is_none() {
            tile = random.on_a_wall();
            in_tile = 1..LANES;
        }
        let within = (random.point() * 0.1).reject_from_normalized(tile.1);
        let on_wall = tile.0 * tile.1.abs();
        (on_wall + (tile.0 * 0.9).reject_from_normalized(tile.1) + within, tile.1)
    });
    let anywhere = receivers(&mut |random| (random.point(), (random.point() - 0.5).normalize()));
    let shares: Vec<_> = (0..16).map(|_| random.share()).collect();
    let mix = |name, polygons, receivers, tolerance| Mix { name, polygons, receivers, tolerance };
    vec![
        mix("point rule", floor(), far, 1e-5),
        mix("contour sum", floor(), above.clone(), 1e-5),
        mix("contour sum, full digits", floor(), above, 1e-8),
        mix("contour sum, cut by the horizon", floor(), cut, 1e-5),
        mix("room: shares and receivers on its walls", shares.clone(), tiles, 1e-5),
        mix("room, receivers in no order", shares.clone(), walls, 1e-5),
        mix("receivers anywhere, facing anywhere", shares, anywhere, 1e-5),
    ]
}

impl Mix {
    fn blocks(&self) -> Vec<ReceiverLanes> {
        self.receivers.chunks(LANES).map(|block| ReceiverLanes::new(block.iter().copied())).collect()
    }

    fn factors(&self) -> u64 {
        (self.polygons.len() * self.receivers.len()) as u64
    }

    fn in_lanes(&self, blocks: &[ReceiverLanes], views: &mut [ViewLanes]) {
        for polygon in &self.polygons {
            widest(
                #[inline(always)]
                || polygon.view_row(blocks, self.tolerance, views),
            );
            black_box(&mut *views);
        }
    }

    fn one_by_one(&self, factors: &mut [f64]) {
        for polygon in &self.polygons {
            for ((position, normal), factor) in self.receivers.iter().zip(factors.iter_mut()) {
                *factor = polygon.view(*position, *normal, self.tolerance).map_or(0.0, |view| view.factor);
            }
            black_box(&mut *factors);
        }
    }

    /// Shares, in per cent, of factors that are not 0, that the horizon cuts, and that are left to the scalar code.
    fn shares(&self, blocks: &[ReceiverLanes], views: &mut [ViewLanes]) -> [f64; 3] {
        let (mut seen, mut cut, mut unanswered) = (0, 0, 0);
        for polygon in &self.polygons {
            polygon.view_row(blocks, self.tolerance, views);
            for view in &*views {
                seen += view.factors.iter().filter(|factor| **factor > 0.0).count();
                cut += view.cut.count_ones() as usize;
                unanswered += view.unanswered.count_ones() as usize;
            }
        }
        [seen, cut, unanswered].map(|count| 100.0 * count as f64 / self.factors() as f64)
    }
}

/// Cycles per second, from multiplications that wait for each other: three cycles each on the processors of today.
fn clock() -> f64 {
    const STEPS: u32 = 3_000_000;
    let once = || {
        let start = Instant::now();
        let mut product = black_box(3u64);
        for _ in 0..STEPS {
            product = product.wrapping_mul(product);
        }
        black_box(product);
        start.elapsed().as_secs_f64()
    };
    3.0 * f64::from(STEPS) / (0..30).map(|_| once()).fold(f64::INFINITY, f64::min)
}

/// Fewest seconds that the work took: what other programs on the machine take is not the work's.
fn fewest_seconds(mut work: impl FnMut()) -> f64 {
    let until = Instant::now() + Duration::from_millis(700);
    let mut fewest = f64::INFINITY;
    while Instant::now() < until {
        let start = Instant::now();
        work();
        fewest = fewest.min(start.elapsed().as_secs_f64());
    }
    fewest
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let mixes = mixes();
    let mut group = criterion.benchmark_group("form factors");
    for mix in &mixes {
        let blocks = mix.blocks();
        let mut views = vec![ViewLanes::default(); blocks.len()];
        let mut factors = vec![0.0; mix.receivers.len()];
        group.throughput(Throughput::Elements(mix.factors()));
        group.bench_function(format!("{}, in lanes", mix.name), |b| {
            b.iter(|| mix.in_lanes(&blocks, &mut views))
        });
        group
            .bench_function(format!("{}, one by one", mix.name), |b| b.iter(|| mix.one_by_one(&mut factors)));
    }
    group.finish();
    criterion.final_summary();

    let clock = clock();
    let peak = 8.0 * 2.0 * clock;
    println!(
        "clock {:.2} GHz; 8 lanes x 2 x clock: {:.1} billion operations per second",
        clock / 1e9,
        peak / 1e9
    );
    for mix in &mixes {
        let blocks = mix.blocks();
        let mut views = vec![ViewLanes::default(); blocks.len()];
        let rate = mix.factors() as f64 / fewest_seconds(|| mix.in_lanes(&blocks, &mut views));
        let mut factors = vec![0.0; mix.receivers.len()];
        let scalar = mix.factors() as f64 / fewest_seconds(|| mix.one_by_one(&mut factors));
        let [seen, cut, unanswered] = mix.shares(&blocks, &mut views);
        let of_peak = match mix.name {
            "point rule" => format!(", {:.0} % of the peak", 100.0 * rate * POINT_RULE_OPERATIONS / peak),
            "contour sum" => format!(", {:.0} % of the peak", 100.0 * rate * CONTOUR_OPERATIONS / peak),
            _ => String::new(),
        };
        println!(
            "{}: {:.1} million factors per second{of_peak}; one by one {:.1}; {seen:.1} % seen, {cut:.1} % cut, \
             {unanswered:.2} % left to one by one",
            mix.name,
            rate / 1e6,
            scalar / 1e6
        );
    }
}
