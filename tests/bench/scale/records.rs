//! Energies in arrays of their own, or in the records of the vertices: what shooting takes, on one thread, and while another one
//! reads the geometry of the vertices, as making rows does.

use std::hint::black_box;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

use crate::processor::processor_time;

/// Numbers of vertices: in the innermost caches, in the outer ones, in memory.
const VERTICES: [usize; 3] = [5_000, 50_000, 500_000];

/// Each figure is the least of so many.
const REPEATS: usize = 7;

/// A vertex as an object, with all that belongs to it.
struct Vertex {
    position: [f64; 3],
    normal: [f64; 3],
    /// Share, surface, patches, numbers.
    _rest: [u64; 6],
    irradiance: [Energy; 3],
    unshot: [Energy; 3],
}

/// The geometry of a vertex without its energies.
struct Place {
    position: [f64; 3],
    normal: [f64; 3],
    _rest: [u64; 6],
}

/// The energies of a vertex by themselves.
#[derive(Default)]
struct Energies {
    irradiance: [Energy; 3],
    unshot: [Energy; 3],
}

/// Written by one thread while others may read beside it. Relaxed loads and stores are plain ones to the processor.
#[derive(Default)]
struct Energy(AtomicU64);

impl Energy {
    fn add(&self, more: f64) {
        let now = f64::from_bits(self.0.load(Ordering::Relaxed));
        self.0.store((now + more).to_bits(), Ordering::Relaxed);
    }
}

/// Prints both layouts side by side.
pub fn compare() {
    println!("\n## Energies apart and in the vertices\n");
    println!("nanoseconds per vertex of a shot, and of a look at its geometry:\n");
    println!(
        "| vertices | in the record | apart | apart is faster by | two threads: in the record | apart | faster by | looking: in the record | apart | faster by |"
    );
    println!("|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|");
    for count in VERTICES {
        let factors: Vec<f32> = (0..count).map(|index| 1e-6 * (index % 7) as f32).collect();
        let rest = [0; 6];
        let records: Vec<Vertex> = (0..count)
            .map(|index| Vertex {
                position: [index as f64, 1.0, 2.0],
                normal: [0.0, 1.0, 0.0],
                _rest: rest,
                irradiance: Default::default(),
                unshot: Default::default(),
            })
            .collect();
        let places: Vec<Place> = (0..count)
            .map(|index| Place { position: [index as f64, 1.0, 2.0], normal: [0.0, 1.0, 0.0], _rest: rest })
            .collect();
        let energies: Vec<Energies> = (0..count).map(|_| Energies::default()).collect();

        let shoot_records = || {
            for (vertex, factor) in records.iter().zip(&factors) {
                shoot(&vertex.irradiance, &vertex.unshot, *factor);
            }
        };
        let shoot_apart = || {
            for (energies, factor) in energies.iter().zip(&factors) {
                shoot(&energies.irradiance, &energies.unshot, *factor);
            }
        };
        let look_records = || {
            black_box(records.iter().map(|vertex| looked_at(&vertex.position, &vertex.normal)).sum::<f64>());
        };
        let look_apart = || {
            black_box(places.iter().map(|place| looked_at(&place.position, &place.normal)).sum::<f64>());
        };
        let [alone_in, alone_apart] = [least(count, &shoot_records), least(count, &shoot_apart)];
        let [both_in, both_apart] =
            [both(count, &shoot_records, &look_records), both(count, &shoot_apart, &look_apart)];
        let faster = |slow: f64, fast: f64| 100.0 * (slow / fast - 1.0);
        println!(
            "| {count} | {alone_in:.2} | {alone_apart:.2} | {:.0} % | {:.2} | {:.2} | {:.0} % | {:.2} | {:.2} | {:.0} % |",
            faster(alone_in, alone_apart),
            both_in[0],
            both_apart[0],
            faster(both_in[0], both_apart[0]),
            both_in[1],
            both_apart[1],
            faster(both_in[1], both_apart[1]),
        );
    }
}

fn shoot(irradiance: &[Energy; 3], unshot: &[Energy; 3], factor: f32) {
    let light = f64::from(factor);
    for channel in 0..3 {
        irradiance[channel].add(light * 0.5);
        unshot[channel].add(light * 0.25);
    }
}

fn looked_at(position: &[f64; 3], normal: &[f64; 3]) -> f64 {
    (0..3).map(|axis| position[axis] * normal[axis]).sum()
}

/// Nanoseconds of processor time per vertex: the least of several runs of about equal length.
fn least(count: usize, work: &dyn Fn()) -> f64 {
    let times = (5_000_000 / count).max(1);
    let run = |_| {
        let start = processor_time();
        (0..times).for_each(|_| work());
        (processor_time() - start) as f64 / (times * count) as f64
    };
    (0..REPEATS).map(run).fold(f64::INFINITY, f64::min)
}

/// The same of two at once, each on a thread of its own.
fn both(count: usize, first: &(dyn Fn() + Sync), second: &(dyn Fn() + Sync)) -> [f64; 2] {
    let over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let beside = scope.spawn(|| {
            let mut best = f64::INFINITY;
            while !over.load(Ordering::Relaxed) {
                best = best.min(at_once(count, second));
            }
            best
        });
        let start = Instant::now();
        let mut best = f64::INFINITY;
        while start.elapsed().as_millis() < 1500 {
            best = best.min(at_once(count, first));
        }
        over.store(true, Ordering::Relaxed);
        [best, beside.join().expect("it only adds")]
    })
}

fn at_once(count: usize, work: &dyn Fn()) -> f64 {
    let times = (1_000_000 / count).max(1);
    let start = processor_time();
    (0..times).for_each(|_| work());
    (processor_time() - start) as f64 / (times * count) as f64
}
